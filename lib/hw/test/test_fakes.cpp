// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>

#include <gtest/gtest.h>
#include <poll.h>

#include "hw/fake/fake_can_bus.hpp"
#include "hw/fake/fake_devices.hpp"
#include "hw/fake/fake_serial_port.hpp"

namespace srfs::hw {
namespace {

bool readable(int fd) {
  pollfd p{.fd = fd, .events = POLLIN, .revents = 0};
  return ::poll(&p, 1, 0) == 1;
}

TEST(FakeCanBus, IsReadableWhileFramesWait) {
  FakeCanBus bus;
  EXPECT_FALSE(readable(bus.fd()));
  bus.deliver({.id = 1});
  bus.deliver({.id = 2});
  EXPECT_TRUE(readable(bus.fd()));
  EXPECT_EQ(bus.receive()->id, 1U);
  EXPECT_TRUE(readable(bus.fd()));
  EXPECT_EQ(bus.receive()->id, 2U);
  EXPECT_FALSE(readable(bus.fd()));
}

TEST(FakeCanBus, EchoesAtOnceOrWhenTold) {
  FakeCanBus bus;
  ASSERT_TRUE(bus.send({.id = 1}));
  EXPECT_TRUE(bus.receive()->is_echo);
  bus.auto_echo = false;
  ASSERT_TRUE(bus.send({.id = 2}));
  EXPECT_EQ(bus.unconfirmed(), 1U);
  EXPECT_FALSE(bus.receive());
  bus.confirm_oldest(MonotonicTime(seconds(1)));
  EXPECT_EQ(bus.receive()->id, 2U);
}

TEST(FakeSerialPort, HasARoomAndAnOtherEnd) {
  FakeSerialPort port;
  port.room = 2;
  const Octets octets{1, 2, 3};
  EXPECT_EQ(port.write(octets), 2U);
  EXPECT_EQ(port.write(octets), 0U);
  port.deliver(octets);
  EXPECT_TRUE(readable(port.fd()));
  std::array<std::uint8_t, 8> into{};
  EXPECT_EQ(port.read(into), 3U);
  EXPECT_FALSE(readable(port.fd()));
}

TEST(FakeDevices, RememberWhatWasDone) {
  FakeGpioLines gpio;
  ASSERT_TRUE(gpio.set_line(1, true));
  EXPECT_EQ(gpio.history.size(), 1U);
  EXPECT_EQ(gpio.set_line(gpio_first_input, true).error(), GpioError::no_line);
  gpio.levels[gpio_first_input + 2] = true;
  EXPECT_EQ(gpio.read_bank(), 0b100);

  FakePulseSource pulses;
  pulses.deliver({.edge = MonotonicTime(seconds(1)), .counter = 4});
  EXPECT_TRUE(readable(pulses.fd()));
  EXPECT_EQ(pulses.read()->counter, 4U);

  FakeWatchdog watchdog;
  EXPECT_TRUE(watchdog.feed());
  EXPECT_EQ(watchdog.disarm().error(), WatchdogError::not_allowed);
  EXPECT_EQ(watchdog.counters().fed, 1U);
}

}  // namespace
}  // namespace srfs::hw
