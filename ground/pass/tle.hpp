// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::ground::pass {

/// Mean elements of an orbit as a two-line element set carries them (NORAD; Vallado, AIAA 2006-6753,
/// appendix B). They mean something for SGP4 alone.
struct TwoLineElements {
  std::string name;       ///< of the line above the two; may be empty
  std::string catalogue;  ///< number in the catalogue, five characters
  UtcTime epoch;
  double drag_per_earth_radius = 0;  ///< B*
  double inclination_rad = 0;
  double right_ascension_rad = 0;  ///< of the ascending node
  double eccentricity = 0;         ///< 0 to below 1
  double argument_of_perigee_rad = 0;
  double mean_anomaly_rad = 0;
  double mean_motion_rad_min = 0;  ///< above 0
};

/// Reads two lines, or three with a name above them; lines that begin with '#', and empty ones, do not count.
/// Columns, ranges and checksums are verified. The error is ready to print.
[[nodiscard]] Result<TwoLineElements, std::string> parse_tle(std::string_view text);

}  // namespace srfs::ground::pass
