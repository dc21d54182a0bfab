// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/pass/tle.hpp"

#include <cmath>
#include <numbers>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "base/text.hpp"

namespace srfs::ground::pass {
namespace {

constexpr std::size_t line_columns = 69;
constexpr double radian = std::numbers::pi / 180;
constexpr double minutes_a_day = 1440;
constexpr std::int64_t day_s = 86'400;

std::vector<std::string> lines_of(std::string_view text) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    std::string line(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
    if (!line.empty() && line.front() != '#') lines.push_back(std::move(line));
  }
  return lines;
}

/// Modulo 10: digits count themselves, a minus sign 1, all else nothing.
unsigned checksum(std::string_view line) {
  unsigned sum = 0;
  for (const char c : line.substr(0, line_columns - 1)) {
    if (c >= '0' && c <= '9') sum += static_cast<unsigned>(c - '0');
    if (c == '-') ++sum;
  }
  return sum % 10;
}

/// What is wrong with a line as such; empty: nothing.
std::string wrong_line(const std::string& line, char number) {
  if (line.size() < line_columns) return fmt::format("line {}: {} columns, expected 69", number, line.size());
  if (line[0] != number || line[1] != ' ')
    return fmt::format("line {}: does not begin with '{} '", number, number);
  const unsigned expected = checksum(line);
  if (line[line_columns - 1] != static_cast<char>('0' + expected))
    return fmt::format("line {}: checksum {}, expected {}", number, line[line_columns - 1], expected);
  return "";
}

/// Columns from @p first (from 1) on, without the spaces around them.
std::string_view columns(std::string_view line, std::size_t first, std::size_t last) {
  std::string_view field = line.substr(first - 1, last - first + 1);
  while (!field.empty() && field.front() == ' ') field.remove_prefix(1);
  while (!field.empty() && field.back() == ' ') field.remove_suffix(1);
  return field;
}

std::optional<double> number(std::string_view field) {
  const auto value = to_number<double>(field);
  return value && std::isfinite(*value) ? value : std::nullopt;
}

/// "28098-4" is 0.28098e-4, a sign may stand before it.
std::optional<double> decimal_with_exponent(std::string_view field) {
  const bool negative = field.starts_with('-');
  if (negative || field.starts_with('+')) field.remove_prefix(1);
  const std::size_t sign = field.find_first_of("+-");
  if (sign == std::string_view::npos || sign == 0 || sign > 5) return std::nullopt;
  const auto digits = to_number<unsigned>(field.substr(0, sign));
  const auto exponent = to_number<unsigned>(field.substr(sign + 1));
  if (!digits || !exponent || *exponent > 9) return std::nullopt;
  const double power = field[sign] == '-' ? -static_cast<double>(*exponent) : static_cast<double>(*exponent);
  const double value = *digits * std::pow(10.0, power - static_cast<double>(sign));
  return negative ? -value : value;
}

std::int64_t days_before_year(int year) {
  const int before = year - 1;
  return static_cast<std::int64_t>(before) * 365 + before / 4 - before / 100 + before / 400;
}

/// "06176.82412014": year 57 is 1957, 56 is 2056; day 1 is the first of January.
std::optional<UtcTime> epoch_of(std::string_view field) {
  if (field.size() < 5) return std::nullopt;
  const std::size_t point = field.find('.');
  const auto year = to_number<int>(columns(field, 1, 2));
  const auto day = to_number<int>(columns(field, 3, 5));
  const auto fraction = point == 5 ? number("0" + std::string(field.substr(point))) : std::optional(0.0);
  if (!year || !day || *day < 1 || *day > 366 || !fraction || *fraction < 0 || *fraction >= 1)
    return std::nullopt;
  const std::int64_t days =
      days_before_year(*year < 57 ? *year + 2000 : *year + 1900) - days_before_year(1970) + *day - 1;
  const auto part = static_cast<std::int64_t>(std::llround(*fraction * static_cast<double>(day_s) * 1e9));
  return UtcTime(seconds(days * day_s) + nanoseconds(part));
}

/// An angle in degrees, 0 to @p highest.
std::optional<double> angle_rad(std::string_view field, double highest_deg) {
  const auto degrees = number(field);
  if (!degrees || *degrees < 0 || *degrees > highest_deg) return std::nullopt;
  return *degrees * radian;
}

}  // namespace

Result<TwoLineElements, std::string> parse_tle(std::string_view text) {
  const auto lines = lines_of(text);
  if (lines.size() != 2 && lines.size() != 3)
    return Err(
        fmt::format("{} lines; expected one element set: two lines, or three with a name", lines.size()));
  const std::string& first = lines[lines.size() - 2];
  const std::string& second = lines.back();
  for (const auto& wrong : {wrong_line(first, '1'), wrong_line(second, '2')}) {
    if (!wrong.empty()) return Err(wrong);
  }
  TwoLineElements tle;
  if (lines.size() == 3) tle.name = lines.front().starts_with("0 ") ? lines.front().substr(2) : lines.front();
  tle.catalogue = std::string(columns(first, 3, 7));
  if (tle.catalogue != columns(second, 3, 7))
    return Err(std::string("the lines are of different spacecraft"));
  const auto take = [](const std::optional<double>& value, double& to) {
    to = value.value_or(0);
    return value.has_value();
  };
  const auto epoch = epoch_of(columns(first, 19, 32));
  if (!epoch) return Err(std::string("line 1: columns 19 to 32 are no epoch"));
  tle.epoch = *epoch;
  double motion_revolutions_day = 0;
  const bool whole = take(decimal_with_exponent(columns(first, 54, 61)), tle.drag_per_earth_radius) &&
                     take(angle_rad(columns(second, 9, 16), 180), tle.inclination_rad) &&
                     take(angle_rad(columns(second, 18, 25), 360), tle.right_ascension_rad) &&
                     take(number("0." + std::string(columns(second, 27, 33))), tle.eccentricity) &&
                     take(angle_rad(columns(second, 35, 42), 360), tle.argument_of_perigee_rad) &&
                     take(angle_rad(columns(second, 44, 51), 360), tle.mean_anomaly_rad) &&
                     take(number(columns(second, 53, 63)), motion_revolutions_day) &&
                     motion_revolutions_day > 0 && motion_revolutions_day < 20;
  if (!whole) return Err(std::string("a number of the elements is missing or out of its range"));
  tle.mean_motion_rad_min = motion_revolutions_day * 2 * std::numbers::pi / minutes_a_day;
  return tle;
}

}  // namespace srfs::ground::pass
