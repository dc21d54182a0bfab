// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "image/clean_frame.hpp"

namespace srfs::image {

struct TrailOptions {
  double snr_least = 7;
  double length_least_px = 10;
};

/// Trails of whatever width: wider or sharper than stars, ragged, with gaps, from edge to edge. Needs no
/// shape of stars: lines on coarse cells of clipped light give where to look; there the line, its width and
/// its ends come from the light itself. A trail is lit on most of its length, and the lines beside it are
/// not: so neither rows of stars, nor ridges of something wide, nor noise in bands count. Most significant
/// first.
/// @param stars  of the frame: light that falls off from one of them is its ray
/// @param spare  memory as large as the frame, of no meaning
[[nodiscard]] std::vector<Streak> find_trails(const CleanFrame& clean, std::span<const Star> stars,
                                              const TrailOptions& options, Plane spare);

}  // namespace srfs::image
