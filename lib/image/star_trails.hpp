// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "image/detections.hpp"

namespace srfs::image {

/// What the stars of a frame look like when the camera turned while it was exposed.
struct StarTrails {
  double length_px;
  double angle_deg;            ///< of their direction, from the row over the column, 0 to 180
  std::vector<bool> is_trail;  ///< of each streak
};

/// Streaks of one length and direction that are most of a frame's streaks, where there are few stars beside
/// them: the stars themselves. What differs from them moved by itself.
/// @param stars  points of light in the frame
[[nodiscard]] std::optional<StarTrails> find_star_trails(std::span<const Streak> streaks, std::size_t stars);

}  // namespace srfs::image
