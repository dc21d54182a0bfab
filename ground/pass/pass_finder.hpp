// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "ground/pass/sight.hpp"

namespace srfs::ground::pass {

/// A pass of the spacecraft over the station: while it is above the lowest elevation.
struct PassTimes {
  UtcTime rise;
  UtcTime set;
  struct Highest {
    UtcTime time;
    Sight sight;
  };
  std::optional<Highest> highest = {};  ///< nullopt: of a list of times
  double rise_azimuth_deg = 0;          ///< these two with the highest
  double set_azimuth_deg = 0;
  [[nodiscard]] nanoseconds duration() const { return set - rise; }
};

inline constexpr std::size_t passes_max = 1000;
inline constexpr std::chrono::hours longest_forecast{24 * 31};

/// @return nullopt: the orbit is not known at this time
using SightAt = std::function<std::optional<Sight>(UtcTime)>;

struct FoundPasses {
  std::vector<PassTimes> passes;          ///< in order
  std::optional<UtcTime> unknown_from{};  ///< from here on the orbit is not known
};
/// Passes of a spacecraft near the Earth that set after @p from and rise before @p to, at most passes_max.
/// Rise and set to 10 ms. Pure.
[[nodiscard]] FoundPasses find_passes(const SightAt& sight, double lowest_elevation_deg, UtcTime from,
                                      UtcTime to);

/// Reads "RISE SET" in UTC from each line, in order of time; '#' begins a comment. The error is ready to
/// print.
[[nodiscard]] Result<std::vector<PassTimes>, std::string> parse_pass_times(std::string_view text);

}  // namespace srfs::ground::pass
