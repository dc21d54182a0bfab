// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <linux/hid.h>
#include <linux/input.h>
#include <linux/uhid.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <string>
#include <thread>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "base/fd.hpp"
#include "base/time.hpp"
#include "tests/vm/virtual_can.hpp"

namespace srfs::vm {

/// A GPIO chip with four lines and a real kernel driver on top. It emulates, through uhid, Microchip's USB
/// bridge MCP2221 (data sheet DS20005565, sections 3.1.11 and 3.1.12). Debian's kernel includes that driver,
/// but neither gpio-sim nor gpio-mockup. Needs root and the modules uhid and hid-mcp2221. The destructor
/// unplugs the device.
class VirtualGpio {
 public:
  static constexpr std::size_t line_count = 4;

  static bool kernel_has_it() {
    return ::access("/dev/uhid", R_OK | W_OK) == 0 && std::filesystem::exists("/sys/bus/hid/drivers/mcp2221");
  }

  VirtualGpio()
      : name_(unique_name()),
        uhid_(::open("/dev/uhid", O_RDWR | O_CLOEXEC)),
        stop_(::eventfd(0, EFD_CLOEXEC)) {
    EXPECT_TRUE(uhid_) << "/dev/uhid: " << errno_text(errno);
    // Vendor-defined reports of 64 octets in each direction.
    constexpr std::array<std::uint8_t, 29> reports{0x06, 0x00, 0xFF, 0x09, 0x01, 0xA1, 0x01, 0x09, 0x02, 0x15,
                                                   0x00, 0x26, 0xFF, 0x00, 0x75, 0x08, 0x95, 0x40, 0x81, 0x02,
                                                   0x09, 0x03, 0x95, 0x40, 0x91, 0x02, 0xC0, 0x00, 0x00};
    uhid_event event{};
    event.type = UHID_CREATE2;
    std::strncpy(reinterpret_cast<char*>(event.u.create2.name), "MCP2221", sizeof event.u.create2.name - 1);
    std::strncpy(reinterpret_cast<char*>(event.u.create2.uniq), name_.c_str(),
                 sizeof event.u.create2.uniq - 1);
    event.u.create2.rd_size = reports.size() - 2;
    event.u.create2.bus = BUS_USB;
    event.u.create2.vendor = 0x04D8;
    event.u.create2.product = 0x00DD;
    std::memcpy(event.u.create2.rd_data, reports.data(), reports.size());
    say(event);
    thread_ = std::thread([this] { serve(); });
  }
  ~VirtualGpio() {
    const std::uint64_t one = 1;
    EXPECT_EQ(::write(stop_.get(), &one, sizeof one), 8);
    thread_.join();
  }
  VirtualGpio(const VirtualGpio&) = delete;
  VirtualGpio& operator=(const VirtualGpio&) = delete;

  /// Waits for /dev/gpiochipN. The device appears half a minute after the constructor, because the driver of
  /// Linux 6.1 sends its first requests before it accepts answers.
  [[nodiscard]] const std::filesystem::path& device() {
    if (device_.empty()) device_ = find_device();
    EXPECT_FALSE(device_.empty()) << "no GPIO chip came of it: is the module hid-mcp2221 there?";
    return device_;
  }
  /// The driven level; nullopt while the line is an input.
  [[nodiscard]] std::optional<bool> driven(std::size_t line) const {
    const std::lock_guard lock(mutex_);
    return pins_.at(line).output ? std::optional(pins_.at(line).value) : std::nullopt;
  }
  /// Number of changes of level or direction.
  [[nodiscard]] std::size_t changes(std::size_t line) const {
    const std::lock_guard lock(mutex_);
    return pins_.at(line).changes;
  }
  /// Sets the external level of an input line.
  void apply(std::size_t line, bool level) {
    const std::lock_guard lock(mutex_);
    pins_.at(line).value = level;
  }

 private:
  struct Pin {
    bool value = false;
    bool output = false;
    std::size_t changes = 0;
  };
  static constexpr std::size_t report_size = 64;
  using Report = std::array<std::uint8_t, report_size>;

  void say(const uhid_event& event) {
    EXPECT_EQ(::write(uhid_.get(), &event, sizeof event), static_cast<ssize_t>(sizeof event));
  }

  void serve() {
    while (true) {
      std::array<pollfd, 2> fds{{{uhid_.get(), POLLIN, 0}, {stop_.get(), POLLIN, 0}}};
      ::poll(fds.data(), fds.size(), -1);
      if (fds[1].revents != 0) return;
      uhid_event event{};
      if (::read(uhid_.get(), &event, sizeof event) <= 0 || event.type != UHID_OUTPUT) continue;
      Report request{};
      std::memcpy(request.data(), event.u.output.data,
                  std::min<std::size_t>(event.u.output.size, report_size));
      const Report reply = answer(request);
      uhid_event input{};
      input.type = UHID_INPUT2;
      input.u.input2.size = report_size;
      std::memcpy(input.u.input2.data, reply.data(), report_size);
      say(input);
    }
  }

  Report answer(const Report& request) {
    constexpr std::uint8_t set_gpio = 0x50;
    constexpr std::uint8_t get_gpio = 0x51;
    constexpr std::uint8_t not_supported = 0x01;
    const std::lock_guard lock(mutex_);
    Report reply = request;  // the answer to SET repeats the settings
    reply[1] = 0;
    if (request[0] == set_gpio) {
      for (std::size_t n = 0; n < line_count; ++n) {
        const std::uint8_t* const of_line =
            &request[2 + 4 * n];  // alter value, value, alter direction, direction
        Pin wanted = pins_[n];
        if (of_line[0] != 0) wanted.value = of_line[1] != 0;
        if (of_line[2] != 0) wanted.output = of_line[3] == 0;
        if (wanted.value != pins_[n].value || wanted.output != pins_[n].output) ++wanted.changes;
        pins_[n] = wanted;
      }
    } else if (request[0] == get_gpio) {
      for (std::size_t n = 0; n < line_count; ++n) {
        // Level, then direction. The driver of Debian's 6.1 reads the level from the direction octet, and
        // requests the direction only at the start.
        reply[2 + 2 * n] = reply[3 + 2 * n] = pins_[n].value ? 1 : 0;
      }
    } else {
      reply[1] = not_supported;
    }
    return reply;
  }

  std::filesystem::path find_device() const {
    const MonotonicTime end = monotonic_now() + 4 * patience;
    while (monotonic_now() < end) {
      for (const auto& chip : std::filesystem::directory_iterator("/sys/bus/gpio/devices")) {
        std::error_code gone;
        std::ifstream file(std::filesystem::canonical(chip.path(), gone).parent_path() / "uevent");
        const std::filesystem::path device = "/dev" / chip.path().filename();
        for (std::string line; std::getline(file, line);) {
          if (line == "HID_UNIQ=" + name_ && std::filesystem::exists(device)) return device;
        }
      }
      ::usleep(10'000);
    }
    return {};
  }

  std::string name_;
  Fd uhid_;
  Fd stop_;
  mutable std::mutex mutex_;
  std::array<Pin, line_count> pins_{};
  std::thread thread_;
  std::filesystem::path device_;
};

}  // namespace srfs::vm
