// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The board's drivers on a computer without the devices: they report clearly that the devices are missing, do
// not block, and end quickly.

#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hw/open.hpp"
#include "tests/node/hw/poll_until.hpp"

namespace srfs::hw {
namespace {

TEST(SocketCan, SaysWhyItIsGone) {
  const auto bus = open_can("socketcan:no_such_can", "/", {isotp_to(0x01)}).value();
  EXPECT_EQ(bus->state(), CanBusState::gone);
  EXPECT_THAT(bus->reason(),
              ::testing::AnyOf(::testing::HasSubstr("no SocketCAN"), ::testing::HasSubstr("no_such_can")));
  EXPECT_EQ(bus->send({.id = 1}).error(), CanError::gone);
  EXPECT_FALSE(bus->receive());
}

TEST(SocketCan, RefusesImpossibleFramesEvenThen) {
  const auto bus = open_can("socketcan:no_such_can", "/").value();
  EXPECT_EQ(bus->send({.id = 1U << 29}).error(), CanError::invalid_frame);
  EXPECT_EQ(bus->send({.id = 0x800, .extended = false}).error(), CanError::invalid_frame);
  EXPECT_EQ(bus->send({.id = 1, .size = 9}).error(), CanError::invalid_frame);
}

TEST(PulsePerSecond, SaysWhyItIsGoneAndEndsQuickly) {
  const MonotonicTime begin = monotonic_now();
  {
    const auto source = open_pulse("pps:/dev/null", "/").value();
    EXPECT_TRUE(
        poll_until(
            source->fd(), [&] { return !source->reason().empty() || source->read(); }, milliseconds(50)) ||
        !source->reason().empty());
    EXPECT_FALSE(source->read());
  }
  EXPECT_LT(monotonic_now() - begin, seconds(2));
}

TEST(PulseOnAGpioLine, SaysWhyItIsGone) {
  for (const char* chip : {"/dev/no_such_chip", "/dev/null"}) {
    const auto source = open_pulse(std::string("gpiochip:") + chip + "?line=17", "/").value();
    EXPECT_FALSE(source->read());
    EXPECT_NE(source->reason().find(chip), std::string::npos) << source->reason();
  }
}

TEST(KernelClock, TellsTheSystemsTimeAndRate) {
  const auto clock = open_kernel_clock();
  const UtcTime before = system_utc_now();
  const UtcTime told = clock->utc_at(monotonic_now());
  const UtcTime after = system_utc_now();
  // The clock keeps an offset between steps; this is the worst error of its measurement.
  EXPECT_GE(told, before - (after - before) - milliseconds(1));
  EXPECT_LE(told, after + (after - before) + milliseconds(1));
  EXPECT_LE(std::abs(clock->frequency_ppm()), KernelClock::frequency_limit_ppm);
}

TEST(GpioChip, SaysThatItIsGone) {
  const auto gpio = open_gpio("gpiochip:/dev/no_such_chip?0=17", "/").value();
  EXPECT_EQ(gpio->set_line(0, true).error(), GpioError::gone);
  EXPECT_EQ(gpio->read_line(gpio_first_input + gpio_input_count).error(), GpioError::no_line);
}

TEST(WatchdogDevice, SaysThatItIsGone) {
  const auto watchdog = open_watchdog("dev:/dev/no_such_watchdog", "/", seconds(10)).value();
  EXPECT_EQ(watchdog->feed().error(), WatchdogError::gone);
  EXPECT_THAT(watchdog->reason(), ::testing::HasSubstr("ENOENT"));
  EXPECT_FALSE(watchdog->timeout());
  EXPECT_EQ(watchdog->counters().failed, 1U);
}

}  // namespace
}  // namespace srfs::hw
