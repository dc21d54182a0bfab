// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <vector>

#include "image/detections.hpp"
#include "image/product/png.hpp"

namespace srfs::image {

/// What is drawn over a frame, in its pixels.
struct Overlay {
  std::vector<Star> stars;                                 ///< green circles
  std::vector<Streak> streaks;                             ///< red boxes around them
  std::vector<std::vector<std::array<double, 2>>> tracks;  ///< yellow: a circle a point, a line through them
};

/// The stretched frame (picture.hpp) with the overlay.
/// @param width  px of the picture, at most the frame's
[[nodiscard]] Colours draw(const Plane& pixels, const Overlay& overlay, int width);

}  // namespace srfs::image
