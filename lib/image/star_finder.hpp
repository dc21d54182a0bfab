// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include "image/clean_frame.hpp"

namespace srfs::image {

struct StarOptions {
  /// Least significance; 0: as low as leaves about one false star in 70, between 4.2 and 5.
  double snr_least = 0;
  int stars_max = 10000;  ///< the brightest are kept
  /// Also stars so close that only a fit of both separates them, and bright ones of a shape of their own; and
  /// fewer of those that single pixels and coding explain. Not where streaks are searched: a short one is as
  /// well explained by stars in a row, and its pieces are no stars of a shape of their own.
  bool close_ones = true;
};

/// The stars of a frame, and the frame without them.
struct StarField {
  std::vector<Star> stars;  ///< brightest first
  /// Of each star: its light may be a piece of a streak's, or of a blend (wide, or touched by another).
  std::vector<bool> doubtful;
  double shot = 0;  ///< variance that a pixel's light adds to the noise of 1, per light
  /// Share of the light of the brightest that their shape leaves, beyond the noise; 0: too few to tell.
  double shape_error = 0;
  Plane residual;             ///< signal minus the stars' light, in noise
  Plane spare;                ///< as large, of no meaning: memory that need not be asked for again
  Grid<std::uint8_t> masked;  ///< 1: what looked like a star here was none (a particle, a defect)
};

/// Matched filter, then a fit of the frame's own star shape to each peak with its neighbours taken away,
/// twice: what was hidden by a brighter star is found the second time. Peaks that are narrower than the
/// optics, much wider, or drawn out (streaks) are no stars.
[[nodiscard]] StarField find_stars(const CleanFrame& clean, const StarOptions& options);

/// Adds the light of a star of this height, as far as it is a tenth of the noise.
void add_star(const Psf& psf, float height, double x, double y, Plane& plane);

/// Calls use(first x, last x + 1, y) for the rows of pixels where a star's model may be wrong by half the
/// noise.
template <class Use>
void for_star_core(const Psf& psf, double height, double x, double y, int plane_width, int plane_height,
                   Use&& use) {
  const double reach = std::min(
      150.0, std::max(0.6 * psf.fwhm_px(), psf.radius_at(std::clamp(0.5 / (0.15 * height), 1e-5, 0.9))));
  const int y0 = std::max(0, static_cast<int>(std::ceil(y - reach)));
  const int y1 = std::min(plane_height - 1, static_cast<int>(std::floor(y + reach)));
  for (int row = y0; row <= y1; ++row) {
    const double half = std::sqrt(std::max(0.0, reach * reach - (row - y) * (row - y)));
    const int from = std::max(0, static_cast<int>(std::ceil(x - half)));
    const int end = std::min(plane_width - 1, static_cast<int>(std::floor(x + half))) + 1;
    if (from < end) use(from, end, row);
  }
}

}  // namespace srfs::image
