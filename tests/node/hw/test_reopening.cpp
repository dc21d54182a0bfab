// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <poll.h>
#include <sys/eventfd.h>

#include <algorithm>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "hw/reopening.hpp"

namespace srfs::hw {
namespace {

/// A device that fails to open a chosen number of times.
struct Device : ::testing::Test {
  int failures = 0;
  std::vector<MonotonicTime> tries;
  std::optional<Reopening> device;

  void SetUp() override {
    device.emplace("test:device", [this]() -> Result<Fd, std::string> {
      tries.push_back(monotonic_now());
      if (failures > 0) {
        --failures;
        return Err(std::string("not there"));
      }
      return Fd(::eventfd(0, EFD_CLOEXEC));
    });
    ASSERT_TRUE(device->present());
    tries.clear();
  }
  /// Like the owner's loop, waits for an event of the device, then reads its state.
  bool wait_until_present() {
    const MonotonicTime end = monotonic_now() + seconds(20);
    while (monotonic_now() < end) {
      pollfd p{.fd = device->fd(), .events = POLLIN, .revents = 0};
      ::poll(&p, 1, 1000);
      if (device->device() >= 0) return true;
    }
    return false;
  }
};
using ReopeningTest = Device;

TEST_F(ReopeningTest, OpensADeviceThatIsExpectedBackWithTheNextLook) {
  device->lost("down", Reopening::Retry::at_once);
  EXPECT_FALSE(device->present());
  EXPECT_TRUE(wait_until_present());
  EXPECT_EQ(tries.size(), 1U);
  EXPECT_EQ(device->reopened(), 1U);
}

TEST_F(ReopeningTest, TriesSoonAgainWhileItIsExpectedAndEverMoreSeldomUpToItsInterval) {
  failures = 9;
  device->lost("down", Reopening::Retry::at_once);
  ASSERT_TRUE(wait_until_present());
  ASSERT_EQ(tries.size(), 10U);
  // Lower bounds only: a busy machine makes each wait longer.
  nanoseconds wait = Reopening::first_retry_interval;
  for (std::size_t i = 1; i < tries.size(); ++i) {
    EXPECT_GE(tries[i] - tries[i - 1], wait) << i;
    wait = std::min<nanoseconds>(2 * wait, Reopening::retry_interval);
  }
  EXPECT_EQ(wait, Reopening::retry_interval);
}

TEST_F(ReopeningTest, WaitsItsIntervalForADeviceThatIsGone) {
  const MonotonicTime lost = monotonic_now();
  device->lost("gone");
  ASSERT_TRUE(wait_until_present());
  EXPECT_GE(tries.front() - lost, Reopening::retry_interval);
}

TEST_F(ReopeningTest, WaitsItsIntervalAgainOnceItCameBack) {
  device->lost("down", Reopening::Retry::at_once);
  ASSERT_TRUE(wait_until_present());
  failures = 1;
  const MonotonicTime lost = monotonic_now();
  device->lost("gone");
  ASSERT_TRUE(wait_until_present());
  ASSERT_EQ(tries.size(), 3U);
  EXPECT_GE(tries[2] - lost, 2 * Reopening::retry_interval);
}

}  // namespace
}  // namespace srfs::hw
