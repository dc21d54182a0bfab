// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <atomic>
#include <fstream>
#include <thread>

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include "hw/open.hpp"
#include "hw/sim/seqpacket.hpp"
#include "tests/node/hw/poll_until.hpp"

namespace srfs::hw {
namespace {

/// The simulator's end of a SEQPACKET socket file, one client at a time.
class Server {
 public:
  explicit Server(std::filesystem::path path)
      : path_(std::move(path)), listener_(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0)) {
    const auto address = unix_address(path_).value();
    ::unlink(path_.c_str());
    EXPECT_EQ(::bind(listener_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(::listen(listener_.get(), 4), 0);
  }
  void accept() { client_ = Fd(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC)); }
  void send(const void* octets, std::size_t size) {
    EXPECT_EQ(::send(client_.get(), octets, size, MSG_NOSIGNAL), static_cast<ssize_t>(size));
  }
  std::string receive() {
    std::array<char, 64> buffer{};
    const ssize_t n = ::recv(client_.get(), buffer.data(), buffer.size(), 0);
    return n > 0 ? std::string(buffer.data(), static_cast<std::size_t>(n)) : "";
  }

 private:
  std::filesystem::path path_;
  Fd listener_;
  Fd client_;
};

TEST(SimPulse, GivesEdgeAndCounterOfEveryPulse) {
  const TemporaryFolder folder;
  Server gps(folder.path() / "pulse.sock");
  const auto source = open_pulse("sim:pulse.sock", folder.path()).value();
  gps.accept();
  for (std::uint64_t i = 1; i <= 3; ++i) {
    const std::array<std::uint64_t, 2> raw{i * 1'000'000'000, i};
    gps.send(raw.data(), sizeof raw);
  }
  for (std::uint64_t i = 1; i <= 3; ++i) {
    std::optional<Pulse> pulse;
    ASSERT_TRUE(poll_until(source->fd(), [&] { return (pulse = source->read()).has_value(); }));
    EXPECT_EQ(pulse->edge, MonotonicTime(seconds(i)));
    EXPECT_EQ(pulse->counter, i);
  }
  gps.send("short", 5);
  EXPECT_TRUE(poll_until(source->fd(), [&] { return !source->read() && source->counters().malformed == 1; }));
}

TEST(SimPulse, ComesBackWithItsSource) {
  const TemporaryFolder folder;
  auto gps = std::make_unique<Server>(folder.path() / "pulse.sock");
  const auto source = open_pulse("sim:pulse.sock", folder.path()).value();
  gps->accept();
  gps = nullptr;
  EXPECT_TRUE(poll_until(source->fd(), [&] { return !source->read() && !source->reason().empty(); }));
  Server again(folder.path() / "pulse.sock");
  EXPECT_TRUE(poll_until(source->fd(), [&] { return !source->read() && source->reason().empty(); }));
  EXPECT_EQ(source->counters().reopened, 1U);
}

TEST(SimGpio, AsksAndIsAnswered) {
  const TemporaryFolder folder;
  Server simulator(folder.path() / "gpio.sock");
  const auto gpio = open_gpio("sim:gpio.sock", folder.path()).value();
  std::thread board([&] {
    simulator.accept();
    EXPECT_EQ(simulator.receive(), std::string("\x01\x02\x01\x00", 4));
    simulator.send("\x00\x02\x01\x00", 4);
    EXPECT_EQ(simulator.receive(), std::string("\x00\x09\x00\x00", 4));
    simulator.send("\x00\x09\x01\x00", 4);
    EXPECT_EQ(simulator.receive(), std::string("\x02\x00\x00\x00", 4));
    simulator.send("\x00\x00\x0A\x00", 4);
    EXPECT_EQ(simulator.receive(), std::string("\x01\x00\x00\x00", 4));
    simulator.send("\x02\x00\x00\x00", 4);
  });
  EXPECT_TRUE(gpio->set_line(2, true));
  EXPECT_EQ(gpio->read_line(9), true);
  EXPECT_EQ(gpio->read_bank(), 0x0A);
  EXPECT_EQ(gpio->set_line(0, false).error(), GpioError::refused);
  EXPECT_EQ(gpio->set_line(9, true).error(), GpioError::no_line);
  board.join();
}

TEST(SimGpio, DoesNotWaitLongForASilentSimulator) {
  const TemporaryFolder folder;
  Server simulator(folder.path() / "gpio.sock");
  const auto gpio = open_gpio("sim:gpio.sock", folder.path()).value();
  EXPECT_EQ(gpio->read_bank().error(), GpioError::timeout);
  EXPECT_EQ(gpio->read_bank().error(), GpioError::gone);  // a new connection is due in 100 ms
}

TEST(SimWatchdog, IsFedAndDisarmed) {
  const TemporaryFolder folder;
  Server simulator(folder.path() / "watchdog.sock");
  const auto watchdog = open_watchdog("sim:watchdog.sock", folder.path(), seconds(5)).value();
  simulator.accept();
  ASSERT_TRUE(watchdog->feed());
  EXPECT_EQ(simulator.receive(), "F");
  ASSERT_TRUE(watchdog->disarm());
  EXPECT_EQ(simulator.receive(), "V");
  EXPECT_FALSE(watchdog->timeout());
  EXPECT_FALSE(watchdog->facts().reset_by_watchdog) << "it has no status register";
}

TEST(SimWatchdog, TellsTheBootAndTheCauseOfTheLastReset) {
  const TemporaryFolder folder;
  const Server simulator(folder.path() / "watchdog.sock");
  const auto told = [&](const std::string& status) {
    std::ofstream(folder.path() / "watchdog.boot") << status;
    const auto watchdog = open_watchdog("sim:watchdog.sock", folder.path(), seconds(5)).value();
    return std::pair(watchdog->facts(), watchdog->timeout());
  };
  const auto [fresh, timeout] = told("boot 12.0\nwatchdog 0\ntimeout_ms 10000\n");
  EXPECT_EQ(fresh.boot, "12.0");
  EXPECT_EQ(fresh.reset_by_watchdog, false);
  EXPECT_EQ(timeout, seconds(10));
  EXPECT_EQ(told("boot 12.1\nwatchdog 1\ntimeout_ms 10000\n").first.reset_by_watchdog, true);
  EXPECT_FALSE(told("boot").first.reset_by_watchdog);
}

}  // namespace
}  // namespace srfs::hw
