// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw/open.hpp"

#include <algorithm>
#include <optional>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <net/if.h>

#include "base/text.hpp"
#include "hw/backends.hpp"

namespace srfs::hw {
namespace {

std::optional<unsigned> number_up_to(std::string_view text, unsigned highest) {
  const auto value = to_number<unsigned>(text);
  return value && *value <= highest ? value : std::nullopt;
}

Result<DeviceUri, HwError> parse_without_query(std::string_view uri,
                                               const std::vector<std::string>& expected) {
  auto parsed = parse_device_uri(uri, expected);
  if (parsed && !parsed->query.empty()) {
    return Err(HwError{fmt::format("device '{}': '?{}=' is not an option of {}:", uri,
                                   parsed->query.front().first, parsed->scheme)});
  }
  return parsed;
}

Result<std::map<std::uint8_t, unsigned>, HwError> chip_offsets(std::string_view uri,
                                                               const DeviceUri& parsed) {
  std::map<std::uint8_t, unsigned> offsets;
  for (const auto& [key, value] : parsed.query) {
    const auto line = number_up_to(key, gpio_first_input + gpio_input_count - 1);
    const auto offset = number_up_to(value, 1023);
    if (!line || !offset) {
      return Err(HwError{fmt::format(
          "device '{}': '{}={}', expected LINE=OFFSET with line 0-11 and offset 0-1023", uri, key, value)});
    }
    offsets[static_cast<std::uint8_t>(*line)] = *offset;
  }
  return offsets;
}

}  // namespace

std::filesystem::path below_var(const std::string& path, const std::filesystem::path& var_dir) {
  return var_dir / path;  // an absolute right side replaces the left one
}

Result<DeviceUri, HwError> parse_device_uri(std::string_view uri, const std::vector<std::string>& expected) {
  const auto schemes = [&expected] { return fmt::format("{}:", fmt::join(expected, ":, ")); };
  const std::size_t colon = uri.find(':');
  if (colon == std::string_view::npos) {
    return Err(HwError{fmt::format("device '{}': no scheme, expected {}", uri, schemes())});
  }
  DeviceUri parsed{.scheme = std::string(uri.substr(0, colon)), .rest = {}, .query = {}};
  if (std::find(expected.begin(), expected.end(), parsed.scheme) == expected.end()) {
    return Err(
        HwError{fmt::format("device '{}': unknown scheme '{}', expected {}", uri, parsed.scheme, schemes())});
  }
  std::string_view rest = uri.substr(colon + 1);
  const std::size_t question = rest.find('?');
  parsed.rest = std::string(rest.substr(0, question));
  if (parsed.rest.empty()) {
    return Err(HwError{
        fmt::format("device '{}': nothing after '{}:', expected a path or a name", uri, parsed.scheme)});
  }
  rest = question == std::string_view::npos ? std::string_view{} : rest.substr(question + 1);
  while (!rest.empty()) {
    const std::string_view pair = rest.substr(0, rest.find('&'));
    const std::size_t equals = pair.find('=');
    if (equals == std::string_view::npos) {
      return Err(HwError{fmt::format("device '{}': '{}' after '?', expected KEY=VALUE", uri, pair)});
    }
    parsed.query.emplace_back(pair.substr(0, equals), pair.substr(equals + 1));
    rest.remove_prefix(std::min(rest.size(), pair.size() + 1));
  }
  return parsed;
}

Result<std::unique_ptr<CanBus>, HwError> open_can(std::string_view uri, const std::filesystem::path& var_dir,
                                                  std::vector<CanFilter> filters) {
  const auto parsed = parse_without_query(uri, {"socketcan", "sim"});
  if (!parsed) return Err(parsed.error());
  if (parsed->scheme == "sim") {
    return make_sim_can(std::string(uri), below_var(parsed->rest, var_dir), std::move(filters));
  }
  if (parsed->rest.size() >= IFNAMSIZ || parsed->rest.find('/') != std::string::npos) {
    return Err(HwError{fmt::format("device '{}': '{}' is not an interface name, expected one like can0", uri,
                                   parsed->rest)});
  }
  return make_socketcan(std::string(uri), parsed->rest, std::move(filters));
}

Result<std::unique_ptr<SerialPort>, HwError> open_serial(std::string_view uri, std::uint32_t baud,
                                                         const std::filesystem::path& var_dir) {
  const auto parsed = parse_without_query(uri, {"serial"});
  if (!parsed) return Err(parsed.error());
  const unsigned speed = termios_speed(baud);
  if (speed == 0) {
    return Err(HwError{fmt::format(
        "device '{}': {} baud, expected a standard rate (1200 ... 115200, 921600 ... 4000000)", uri, baud)});
  }
  return make_serial(std::string(uri), below_var(parsed->rest, var_dir), speed);
}

Result<std::unique_ptr<PulseSource>, HwError> open_pulse(std::string_view uri,
                                                         const std::filesystem::path& var_dir) {
  const auto parsed = parse_device_uri(uri, {"pps", "gpiochip", "sim"});
  if (!parsed) return Err(parsed.error());
  const auto path = below_var(parsed->rest, var_dir);
  if (parsed->scheme == "gpiochip") {
    const bool named = parsed->query.size() == 1 && parsed->query.front().first == "line";
    const auto line = named ? number_up_to(parsed->query.front().second, 1023) : std::nullopt;
    if (!line) return Err(HwError{fmt::format("device '{}': expected ?line=<offset on the chip>", uri)});
    return make_gpio_pulse(std::string(uri), path, *line);
  }
  if (!parsed->query.empty())
    return Err(HwError{fmt::format("device '{}': {}: has no options", uri, parsed->scheme)});
  return parsed->scheme == "pps" ? make_pps(std::string(uri), path) : make_sim_pulse(std::string(uri), path);
}

Result<std::unique_ptr<GpioLines>, HwError> open_gpio(std::string_view uri,
                                                      const std::filesystem::path& var_dir) {
  const auto parsed = parse_device_uri(uri, {"gpiochip", "sim"});
  if (!parsed) return Err(parsed.error());
  const auto path = below_var(parsed->rest, var_dir);
  if (parsed->scheme == "sim") {
    if (!parsed->query.empty()) return Err(HwError{fmt::format("device '{}': sim: has no options", uri)});
    return make_sim_gpio(std::string(uri), path);
  }
  auto offsets = chip_offsets(uri, *parsed);
  if (!offsets) return Err(offsets.error());
  return make_gpio_chip(std::string(uri), path, std::move(*offsets));
}

Result<std::unique_ptr<Watchdog>, HwError> open_watchdog(std::string_view uri,
                                                         const std::filesystem::path& var_dir,
                                                         seconds timeout) {
  const auto parsed = parse_without_query(uri, {"dev", "sim"});
  if (!parsed) return Err(parsed.error());
  if (timeout < seconds(1) || timeout > seconds(3600)) {
    return Err(HwError{fmt::format("device '{}': time-out {} s, expected 1-3600 s", uri, timeout.count())});
  }
  const auto path = below_var(parsed->rest, var_dir);
  if (parsed->scheme == "sim") return make_sim_watchdog(std::string(uri), path);
  return make_watchdog_device(std::string(uri), path, timeout);
}

}  // namespace srfs::hw
