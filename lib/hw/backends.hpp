// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "hw/open.hpp"

/// Constructors of the back-ends; open.cpp alone uses them. @p uri stands in log lines.
namespace srfs::hw {

using std::filesystem::path;

[[nodiscard]] std::unique_ptr<CanBus> make_socketcan(const std::string& uri, const std::string& interface,
                                                     std::vector<CanFilter> filters);
[[nodiscard]] std::unique_ptr<CanBus> make_sim_can(const std::string& uri, const path& socket,
                                                   std::vector<CanFilter> filters);
/// @param speed  a termios code, B9600 and so on
[[nodiscard]] std::unique_ptr<SerialPort> make_serial(const std::string& uri, const path& tty,
                                                      unsigned speed);
[[nodiscard]] std::unique_ptr<PulseSource> make_pps(const std::string& uri, const path& device);
/// @param line  offset on the chip
[[nodiscard]] std::unique_ptr<PulseSource> make_gpio_pulse(const std::string& uri, const path& chip,
                                                           unsigned line);
[[nodiscard]] std::unique_ptr<PulseSource> make_sim_pulse(const std::string& uri, const path& socket);
/// @param offsets  line of the suite -> offset on the chip, where they differ
[[nodiscard]] std::unique_ptr<GpioLines> make_gpio_chip(const std::string& uri, const path& chip,
                                                        std::map<std::uint8_t, unsigned> offsets);
[[nodiscard]] std::unique_ptr<GpioLines> make_sim_gpio(const std::string& uri, const path& socket);
[[nodiscard]] std::unique_ptr<Watchdog> make_watchdog_device(const std::string& uri, const path& device,
                                                             seconds timeout);
[[nodiscard]] std::unique_ptr<Watchdog> make_sim_watchdog(const std::string& uri, const path& socket);

/// true if @p id of that kind passes one of @p filters, or there are none.
[[nodiscard]] inline bool passes(std::uint32_t id, bool extended, const std::vector<CanFilter>& filters) {
  if (filters.empty()) return true;
  for (const CanFilter& filter : filters) {
    if (extended == filter.extended && (id & filter.mask) == (filter.match & filter.mask)) return true;
  }
  return false;
}

/// The termios code of a baud rate; 0 when there is none.
[[nodiscard]] unsigned termios_speed(std::uint32_t baud);

}  // namespace srfs::hw
