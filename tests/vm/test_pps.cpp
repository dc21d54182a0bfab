// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The pulse back-end on a pulse-per-second device of the kernel (RFC 2783).

#include <poll.h>

#include <functional>
#include <memory>
#include <optional>

#include <gtest/gtest.h>

#include "hw/open.hpp"
#include "tests/temporary_folder.hpp"
#include "tests/vm/virtual_pps.hpp"

namespace srfs::hw {
namespace {

using vm::VirtualPps;

class PulsesOfTheKernel : public testing::Test {
 protected:
  void SetUp() override {
    if (!VirtualPps::kernel_has_it()) GTEST_SKIP() << "no pps_parport on a port of QEMU's here";
  }

  static std::unique_ptr<PulseSource> open(const std::filesystem::path& device) {
    return open_pulse("pps:" + device.string(), "/").value();
  }
  static bool wait_until(const std::function<bool()>& condition) {
    const MonotonicTime end = monotonic_now() + vm::patience;
    while (!condition()) {
      if (monotonic_now() > end) return false;
      ::usleep(10'000);
    }
    return true;
  }
  /// Sends pulses until one arrives, which shows that the source is listening.
  [[nodiscard]] std::optional<Pulse> first_pulse(PulseSource& source) {
    std::optional<Pulse> pulse;
    wait_until([&] {
      pps_.pulse();
      return (pulse = next_pulse(source, 100)).has_value();
    });
    while (const auto later = next_pulse(source, 300)) pulse = later;
    return pulse;
  }
  static std::optional<Pulse> next_pulse(PulseSource& source, int wait_ms) {
    pollfd readable{.fd = source.fd(), .events = POLLIN, .revents = 0};
    ::poll(&readable, 1, wait_ms);
    return source.read();
  }

  VirtualPps pps_;
};

constexpr milliseconds standstill{100};

TEST_F(PulsesOfTheKernel, AreReadOnceEachWithTheTimeOfTheirEdge) {
  const auto source = open(VirtualPps::device());
  auto last = first_pulse(*source);
  ASSERT_TRUE(last) << source->reason();
  for (int n = 0; n < 5; ++n) {
    const MonotonicTime before = monotonic_now();
    pps_.pulse();
    const auto pulse = next_pulse(*source, static_cast<int>(vm::patience.count()));
    const MonotonicTime after = monotonic_now();
    ASSERT_TRUE(pulse);
    // The interrupt may be slightly later than the pulse. The kernel stamps the edge with the system clock,
    // which is read just before or after the monotonic clock. On a busy host the emulated processor may stand
    // still between the two readings.
    EXPECT_GE(pulse->edge, before - standstill);
    EXPECT_LE(pulse->edge, after + standstill);
    EXPECT_EQ(pulse->counter, last->counter + 1);
    EXPECT_EQ(source->read(), std::nullopt) << "once";
    last = pulse;
  }
  EXPECT_EQ(source->counters().malformed, 0U);
}

TEST_F(PulsesOfTheKernel, OfTheTimeBeforeSomebodyListenedAreNoNews) {
  pps_.pulse();
  ::sleep(2);  // older than the limit for a pulse on the monotonic clock
  const auto source = open(VirtualPps::device());
  EXPECT_EQ(next_pulse(*source, 500), std::nullopt);
  EXPECT_TRUE(first_pulse(*source)) << source->reason();
}

TEST_F(PulsesOfTheKernel, AreMissedWhileTheirDeviceIsAwayAndBackWithIt) {
  const testing_support::TemporaryFolder folder;
  const std::filesystem::path link = folder.path() / "pulse";  // like a lasting device name from udev
  std::filesystem::create_symlink(VirtualPps::device(), link);
  const auto source = open(link);
  ASSERT_TRUE(first_pulse(*source)) << source->reason();

  pps_.unplug();
  EXPECT_TRUE(wait_until([&] { return !source->reason().empty(); })) << "nobody says that it is gone";

  pps_.plug();
  EXPECT_TRUE(wait_until([&] { return source->reason().empty(); })) << source->reason();
  EXPECT_TRUE(first_pulse(*source)) << source->reason();
  EXPECT_EQ(source->counters().reopened, 1U);
}

}  // namespace
}  // namespace srfs::hw
