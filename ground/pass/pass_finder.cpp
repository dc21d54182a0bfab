// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/pass/pass_finder.hpp"

#include <algorithm>
#include <sstream>

#include <fmt/format.h>

namespace srfs::ground::pass {
namespace {

constexpr seconds step{60};  // the elevation has one maximum in each turn of 85 minutes or more
constexpr std::chrono::minutes longest_pass{240};
constexpr milliseconds fine{10};

/// Elevations around a maximum, step by step, and what is needed of them.
class Search {
 public:
  Search(const SightAt& sight, double lowest_deg) : sight_(sight), lowest_deg_(lowest_deg) {}

  [[nodiscard]] std::optional<double> elevation(UtcTime time) const {
    const auto sight = sight_(time);
    return sight ? std::optional(sight->elevation_deg) : std::nullopt;
  }

  /// Between two times around it, by thirds. nullopt: the orbit is not known there
  [[nodiscard]] std::optional<UtcTime> highest(UtcTime from, UtcTime to) const {
    while (to - from > fine) {
      const nanoseconds third = (to - from) / 3;
      const auto left = elevation(from + third);
      const auto right = elevation(to - third);
      if (!left || !right) return std::nullopt;
      if (*left < *right)
        from = from + third;
      else
        to = to - third;
    }
    return from;
  }

  /// Where the lowest elevation is crossed between a time above it and one below it.
  [[nodiscard]] UtcTime crossing(UtcTime above, UtcTime below) const {
    while (above - below > fine || below - above > fine) {
      const UtcTime middle = below + (above - below) / 2;
      (is_above(middle) ? above : below) = middle;
    }
    return above;
  }

  /// The end of the pass on one side of its maximum.
  [[nodiscard]] UtcTime end(UtcTime highest, nanoseconds towards) const {
    UtcTime above = highest;
    UtcTime next = above + towards;
    while (is_above(next) && next - highest < longest_pass && highest - next < longest_pass) {
      above = next;
      next += towards;
    }
    return crossing(above, next);
  }

 private:
  /// Where the orbit is not known, the spacecraft is not.
  [[nodiscard]] bool is_above(UtcTime time) const { return elevation(time).value_or(-90) >= lowest_deg_; }

  const SightAt& sight_;
  double lowest_deg_;
};

PassTimes around(const Search& search, const SightAt& sight, UtcTime highest) {
  PassTimes pass;
  pass.rise = search.end(highest, -step);
  pass.set = search.end(highest, step);
  pass.highest = PassTimes::Highest{highest, sight(highest).value_or(Sight{})};
  pass.rise_azimuth_deg = sight(pass.rise).value_or(Sight{}).azimuth_deg;
  pass.set_azimuth_deg = sight(pass.set).value_or(Sight{}).azimuth_deg;
  return pass;
}

}  // namespace

FoundPasses find_passes(const SightAt& sight, double lowest_elevation_deg, UtcTime from, UtcTime to) {
  const Search search(sight, lowest_elevation_deg);
  FoundPasses found;
  // A pass that is under way has its maximum before, one that rises at the end after.
  const UtcTime last = std::min(to, from + longest_forecast) + longest_pass;
  std::optional<double> before;
  std::optional<double> here;
  for (UtcTime time = from - longest_pass; time < last && found.passes.size() < passes_max; time += step) {
    const auto next = search.elevation(time);
    if (!next && time >= from) {
      found.unknown_from = time;
      break;
    }
    const bool maximum = before && here && next && *here >= *before && *here > *next;
    if (maximum) {
      const auto highest = search.highest(time - 2 * step, time);
      if (highest && search.elevation(*highest).value_or(-90) >= lowest_elevation_deg) {
        const PassTimes pass = around(search, sight, *highest);
        const bool known = !found.passes.empty() && pass.rise < found.passes.back().set;
        if (pass.set > from && pass.rise < to && !known) found.passes.push_back(pass);
      }
    }
    before = std::exchange(here, next);
  }
  return found;
}

Result<std::vector<PassTimes>, std::string> parse_pass_times(std::string_view text) {
  std::vector<PassTimes> passes;
  std::istringstream in{std::string(text)};
  std::size_t number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    std::istringstream words(line.substr(0, line.find('#')));
    std::string rise_text;
    std::string set_text;
    std::string more;
    if (!(words >> rise_text)) continue;
    const bool two = (words >> set_text) && !(words >> more);
    const auto rise = from_iso8601(rise_text);
    const auto set = from_iso8601(set_text);
    if (!two || !rise || !set)
      return Err(
          fmt::format("line {}: expected RISE SET, as in 2026-11-27T08:00:00Z 2026-11-27T08:09:30Z", number));
    if (*set <= *rise) return Err(fmt::format("line {}: the pass ends before it begins", number));
    if (!passes.empty() && *rise < passes.back().set)
      return Err(fmt::format("line {}: the pass begins before the one above it ends", number));
    if (passes.size() == passes_max) return Err(fmt::format("more than {} passes", passes_max));
    passes.push_back({.rise = *rise, .set = *set});
  }
  return passes;
}

}  // namespace srfs::ground::pass
