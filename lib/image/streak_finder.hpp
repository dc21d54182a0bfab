// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "image/star_finder.hpp"

namespace srfs::image {

struct StreakOptions {
  double snr_least = 7;  ///< of the whole streak
  double length_least_px = 10;
  /// How much better, in chi squared, a line has to explain what stars that touch could be. Less where other
  /// frames show what stands still.
  double caution = 8;
};

/// Streaks of moving objects on the frame without its stars: search along all lines, then a fit of ends,
/// brightness and width. What is sharper than the optics (particles), wider (background, clouds) or lit on
/// one part only (stars in a row) is none. Pieces of one line become one streak. Most significant first.
[[nodiscard]] std::vector<Streak> find_streaks(const CleanFrame& clean, StarField& field,
                                               const StreakOptions& options);

}  // namespace srfs::image
