// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "image/frame.hpp"

namespace srfs::image {

/// The saturated patch in the middle of a bright star, without the trails of a column that ran over.
struct SaturatedCore {
  double x;    ///< px, its middle
  double y;    ///< px
  int radius;  ///< px, about; 1 to saturated_radius_max
};

inline constexpr int saturated_radius_max = 60;      ///< px; larger patches are no stars
inline constexpr std::size_t saturated_most = 5000;  ///< the largest are kept

/// Patches of touching pixels with flaw_saturated, at least two, largest first;
/// not those drawn out: streaks. Middle and shape are those of the pixels farthest from the patch's edge, so
/// that thin trails do not matter. Takes an octet a pixel while it runs, none when nothing is saturated. None
/// of a frame that is torn into a million patches.
[[nodiscard]] std::vector<SaturatedCore> find_saturated_cores(const Grid<std::uint8_t>& flaws);

}  // namespace srfs::image
