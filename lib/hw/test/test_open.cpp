// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw/open.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace srfs::hw {
namespace {

using ::testing::HasSubstr;

const std::filesystem::path var = "/nonexistent/var";

TEST(DeviceUri, IsTakenApart) {
  const auto uri = parse_device_uri("gpiochip:/dev/gpiochip0?0=17&1=18", {"gpiochip", "sim"});
  ASSERT_TRUE(uri);
  EXPECT_EQ(uri->scheme, "gpiochip");
  EXPECT_EQ(uri->rest, "/dev/gpiochip0");
  ASSERT_EQ(uri->query.size(), 2U);
  EXPECT_EQ(uri->query[1], std::pair(std::string("1"), std::string("18")));
}

TEST(DeviceUri, HasRelativePathsBelowVar) {
  EXPECT_EQ(below_var("run/can_hub.sock", "/srv/var"), "/srv/var/run/can_hub.sock");
  EXPECT_EQ(below_var("/dev/ttyS3", "/srv/var"), "/dev/ttyS3");
}

TEST(OpenDevice, NamesTheUnknownSchemeAndWhatWasExpected) {
  const auto can = open_can("foo:bar", var);
  ASSERT_FALSE(can);
  EXPECT_THAT(can.error().message, HasSubstr("unknown scheme 'foo', expected socketcan:, sim:"));
  EXPECT_THAT(can.error().message, HasSubstr("foo:bar"));

  EXPECT_THAT(open_serial("can0", 9600, var).error().message, HasSubstr("no scheme, expected serial:"));
  EXPECT_THAT(open_pulse("dev:/dev/pps0", var).error().message, HasSubstr("expected pps:, gpiochip:, sim:"));
  for (const char* uri :
       {"gpiochip:/dev/gpiochip0", "gpiochip:/dev/gpiochip0?line=", "gpiochip:/dev/gpiochip0?line=x",
        "gpiochip:/dev/gpiochip0?0=17", "gpiochip:/dev/gpiochip0?line=1&line=2"}) {
    EXPECT_THAT(open_pulse(uri, var).error().message, HasSubstr("expected ?line=")) << uri;
  }
  EXPECT_THAT(open_pulse("pps:/dev/pps0?line=1", var).error().message, HasSubstr("has no options"));
  EXPECT_THAT(open_gpio("pps:/dev/pps0", var).error().message, HasSubstr("expected gpiochip:, sim:"));
  EXPECT_THAT(open_watchdog("sim", var, seconds(5)).error().message, HasSubstr("expected dev:, sim:"));
}

TEST(OpenDevice, RefusesWhatCanNeverWork) {
  EXPECT_THAT(open_can("sim:", var).error().message, HasSubstr("nothing after 'sim:'"));
  EXPECT_THAT(open_can("socketcan:a_name_too_long_for_linux", var).error().message,
              HasSubstr("not an interface name"));
  EXPECT_THAT(open_can("sim:x?loss=1", var).error().message, HasSubstr("not an option"));
  EXPECT_THAT(open_serial("serial:tty", 9601, var).error().message, HasSubstr("9601 baud"));
  EXPECT_THAT(open_gpio("gpiochip:/dev/gpiochip0?12=1", var).error().message, HasSubstr("line 0-11"));
  EXPECT_THAT(open_gpio("gpiochip:/dev/gpiochip0?1", var).error().message, HasSubstr("KEY=VALUE"));
  EXPECT_THAT(open_watchdog("dev:/dev/watchdog", var, seconds(0)).error().message, HasSubstr("1-3600 s"));
}

TEST(OpenDevice, AcceptsAnAbsentDeviceAndSaysThatItIsGone) {
  auto can = open_can("sim:run/can_hub.sock", var).value();
  EXPECT_EQ(can->state(), CanBusState::gone);
  EXPECT_THAT(can->reason(), HasSubstr("/nonexistent/var/run/can_hub.sock"));
  EXPECT_EQ(can->send({.id = 1}).error(), CanError::gone);
  EXPECT_FALSE(can->receive());
  EXPECT_GE(can->fd(), 0);

  auto serial = open_serial("serial:run/tty", 921600, var).value();
  std::array<std::uint8_t, 4> buffer{};
  EXPECT_EQ(serial->read(buffer).error(), SerialError::gone);
  EXPECT_EQ(serial->write(buffer).error(), SerialError::gone);
  EXPECT_EQ(serial->output_pending(), 0U);

  EXPECT_FALSE(open_pulse("sim:run/gps_pulse.sock", var).value()->read());
  EXPECT_EQ(open_gpio("sim:run/gpio.sock", var).value()->read_bank().error(), GpioError::gone);
  EXPECT_EQ(open_gpio("gpiochip:run/chip", var).value()->read_bank().error(), GpioError::gone);
  EXPECT_EQ(open_watchdog("sim:run/watchdog.sock", var, seconds(5)).value()->feed().error(),
            WatchdogError::gone);
}

TEST(OpenDevice, NeverDisarmsAHardwareWatchdog) {
  EXPECT_EQ(open_watchdog("dev:run/watchdog", var, seconds(5)).value()->disarm().error(),
            WatchdogError::not_allowed);
}

TEST(CanFilter, SelectsTheFramesToUsAndOurEchoes) {
  const CanFilter filter = isotp_to(0x11);
  EXPECT_EQ(0x18DA1101U & filter.mask, filter.match);
  EXPECT_NE(0x18DA1201U & filter.mask, filter.match);
  EXPECT_EQ(0x18DA0111U & filter.echo_mask, filter.echo_match);
}

}  // namespace
}  // namespace srfs::hw
