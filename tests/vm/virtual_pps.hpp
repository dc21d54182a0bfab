// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fcntl.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include <gtest/gtest.h>

#include "base/fd.hpp"
#include "tests/vm/virtual_can.hpp"

namespace srfs::vm {

/// A pulse-per-second device of the kernel: the driver pps_parport on a parallel port emulated by QEMU. The
/// port raises an interrupt, as after each octet sent, when the control register is written without the
/// strobe. Needs root and the modules parport_pc and pps_parport; both stay loaded.
class VirtualPps {
 public:
  static bool kernel_has_it() { return ::access("/dev/port", W_OK) == 0 && !find().empty(); }

  VirtualPps() : port_(::open("/dev/port", O_RDWR | O_CLOEXEC)) {
    EXPECT_TRUE(port_) << "/dev/port: " << errno_text(errno);
  }

  /// /dev/ppsN; empty while the device is unplugged.
  [[nodiscard]] static std::filesystem::path device() { return find(); }

  void pulse() { control(initialised | selected | interrupts); }

  void unplug() {
    shell("modprobe --remove pps_parport");
    // The driver of Linux 6.1 crashes on an interrupt while it is being loaded, so none may be pending then.
    for (int n = 0; n < 2; ++n) control(initialised | selected);
    std::uint8_t status = 0;
    EXPECT_EQ(::pread(port_.get(), &status, 1, base + 1), 1) << errno_text(errno);  // clears the last one
  }
  void plug() { shell("modprobe pps_parport"); }

 private:
  static constexpr off_t base = 0x378;
  static constexpr std::uint8_t initialised = 0x04;
  static constexpr std::uint8_t selected = 0x08;
  static constexpr std::uint8_t interrupts = 0x10;

  void control(std::uint8_t value) {
    EXPECT_EQ(::pwrite(port_.get(), &value, 1, base + 2), 1) << errno_text(errno);
  }
  static std::filesystem::path find() {
    std::error_code none;
    for (const auto& entry : std::filesystem::directory_iterator("/sys/class/pps", none)) {
      std::ifstream file(entry.path() / "name");
      std::string name;
      if (std::getline(file, name) && name == "pps_parport") return "/dev" / entry.path().filename();
    }
    return {};
  }

  Fd port_;
};

}  // namespace srfs::vm
