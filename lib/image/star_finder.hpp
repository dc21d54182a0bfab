#pragma once

#include "image/clean_frame.hpp"

namespace srfs::image {

struct StarOptions {
  /// Least significance; 0: as low as leaves about one false star in 70, between 4.2 and 5.
  double snr_least = 0;
  int stars_max = 10000;  ///< the brightest are kept
};

/// The stars of a frame, and the frame without them.
struct StarField {
  std::vector<Star> stars;    ///< brightest first
  Plane residual;             ///< signal minus the stars' light, in noise
  Grid<std::uint8_t> masked;  ///< 1: a star was here, brighter than what is left can be trusted
};

/// Matched filter, then a fit of the frame's own star shape to each peak with its neighbours taken away,
/// twice: what was hidden by a brighter star is found the second time. Peaks that are narrower than the
/// optics, much wider, or drawn out (streaks) are no stars.
[[nodiscard]] StarField find_stars(const CleanFrame& clean, const StarOptions& options);

}  // namespace srfs::image
