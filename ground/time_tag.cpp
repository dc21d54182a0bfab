// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/time_tag.hpp"

#include <cmath>
#include <string>
#include <utility>

#include "base/text.hpp"

namespace srfs::ground {
namespace {

constexpr double longest_s = 7 * 86400.0;

}  // namespace

std::optional<milliseconds> parse_duration(std::string_view text) {
  double factor_ms = 1000;
  for (const auto& [unit, factor] : {std::pair<std::string_view, double>{"ms", 1},
                                     {"min", 60000},
                                     {"s", 1000},
                                     {"m", 60000},
                                     {"h", 3600000}}) {
    if (text.size() <= unit.size() || !text.ends_with(unit)) continue;
    text.remove_suffix(unit.size());
    factor_ms = factor;
    break;
  }
  const double value = to_number<double>(text).value_or(-1);
  if (!std::isfinite(value) || value < 0 || value * factor_ms > longest_s * 1000) return std::nullopt;
  return milliseconds(static_cast<std::int64_t>(value * factor_ms));
}

std::optional<TimeTag> parse_time_tag(std::string_view text) {
  TimeTag tag;
  if (text.starts_with('+')) {
    const auto after = parse_duration(text.substr(1));
    if (!after) return std::nullopt;
    tag.after = *after;
    return tag;
  }
  tag.absolute = from_iso8601(std::string(text));
  return tag.absolute ? std::optional(tag) : std::nullopt;
}

}  // namespace srfs::ground
