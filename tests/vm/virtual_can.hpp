// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <optional>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "base/fd.hpp"
#include "base/time.hpp"

namespace srfs::vm {

inline constexpr milliseconds patience{
    30'000};  // the guest's processor is emulated, and the host may be busy

/// Runs an iproute2 command line; its failure fails the test.
inline void shell(const std::string& command) {
  EXPECT_EQ(std::system(command.c_str()), 0) << command;
}

/// An interface name that no other run uses.
inline std::string unique_name() {
  static int next = 0;
  return fmt::format("sv{}{}", ::getpid(), static_cast<char>('a' + next++ % 26));
}

inline void set_up(const std::string& interface, bool up) {
  const Fd socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ifreq request{};
  std::strncpy(request.ifr_name, interface.c_str(), IFNAMSIZ - 1);
  ASSERT_EQ(::ioctl(socket.get(), SIOCGIFFLAGS, &request), 0) << interface;
  const int others = request.ifr_flags & ~IFF_UP;
  request.ifr_flags = static_cast<short>(up ? others | IFF_UP : others);
  ASSERT_EQ(::ioctl(socket.get(), SIOCSIFFLAGS, &request), 0) << interface;
}

/// A vcan interface that is up; the destructor removes it. A test may delete and create it in between.
class VirtualCan {
 public:
  VirtualCan() : name_(unique_name()) { create(); }
  ~VirtualCan() {
    if (there_) remove();
  }
  VirtualCan(const VirtualCan&) = delete;
  VirtualCan& operator=(const VirtualCan&) = delete;

  void create() {
    shell(fmt::format("ip link add {0} type vcan && ip link set {0} mtu 72 up", name_));
    there_ = true;
  }
  void remove() {
    shell(fmt::format("ip link del {}", name_));
    there_ = false;
  }
  void up() { set_up(name_, true); }
  void down() { set_up(name_, false); }
  /// Limits the interface to @p octets_per_second (a frame counts 16 octets) and to @p frames queued frames.
  void pace(unsigned octets_per_second, unsigned frames) {
    shell(fmt::format("tc qdisc replace dev {} root tbf rate {}bps burst 80 limit {}", name_,
                      octets_per_second, frames * sizeof(can_frame)));
  }
  /// true: the interface echoes a frame when it leaves; false: the socket layer echoes it at once.
  [[nodiscard]] bool echoes_when_sent() const {
    std::string flags;
    std::ifstream("/sys/class/net/" + name_ + "/flags") >> flags;
    constexpr unsigned long iff_echo = 1UL << 18U;
    return (std::stoul(flags, nullptr, 16) & iff_echo) != 0;
  }
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::string uri() const { return "socketcan:" + name_; }

 private:
  std::string name_;
  bool there_ = false;
};

/// The other stations on the bus: a raw socket that receives every frame and may write any frame.
class OtherStation {
 public:
  explicit OtherStation(const std::string& interface)
      : socket_(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW)) {
    const int on = 1;
    EXPECT_EQ(::setsockopt(socket_.get(), SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on), 0);
    sockaddr_can address{};
    address.can_family = AF_CAN;
    address.can_ifindex = static_cast<int>(::if_nametoindex(interface.c_str()));
    EXPECT_EQ(::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }

  bool write(canid_t id, std::uint8_t size = 8, std::uint8_t fill = 0) {
    can_frame frame{};
    frame.can_id = id;
    frame.len = size;
    std::memset(frame.data, fill, size);
    return write(frame);
  }
  bool write(const can_frame& frame) {
    return ::write(socket_.get(), &frame, sizeof frame) == static_cast<ssize_t>(sizeof frame);
  }
  bool write(const canfd_frame& frame) {
    return ::write(socket_.get(), &frame, sizeof frame) == static_cast<ssize_t>(sizeof frame);
  }
  /// Writes an error frame like a driver (linux/can/error.h).
  bool report_error(canid_t classes, std::uint8_t controller = 0) {
    can_frame frame{};
    frame.can_id = CAN_ERR_FLAG | classes;
    frame.len = CAN_ERR_DLC;
    frame.data[1] = controller;
    return write(frame);
  }
  /// Waits for the next frame on the bus.
  std::optional<can_frame> read() {
    pollfd p{.fd = socket_.get(), .events = POLLIN, .revents = 0};
    canfd_frame frame{};
    if (::poll(&p, 1, static_cast<int>(patience.count())) != 1) return std::nullopt;
    if (::read(socket_.get(), &frame, sizeof frame) < static_cast<ssize_t>(CAN_MTU)) return std::nullopt;
    can_frame classic{};
    std::memcpy(&classic, &frame, sizeof classic);
    return classic;
  }

 private:
  Fd socket_;
};

}  // namespace srfs::vm
