// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "image/detections.hpp"

namespace srfs::image {

/// From one frame's pixels to another's: shift, turn and scale.
struct FrameTransform {
  double shift_x = 0;
  double shift_y = 0;
  double a = 1;  ///< scale * cos(turn)
  double b = 0;  ///< scale * sin(turn)

  struct Point {
    double x, y;
  };
  [[nodiscard]] Point operator()(double x, double y) const {
    return {shift_x + a * x - b * y, shift_y + b * x + a * y};
  }
  [[nodiscard]] Point inverse(double x, double y) const {
    const double n = a * a + b * b;
    const double u = x - shift_x;
    const double v = y - shift_y;
    return {(a * u + b * v) / n, (a * v - b * u) / n};
  }
};

struct Registration {
  FrameTransform to_reference;
  int stars = 0;      ///< that both frames have
  double rms_px = 0;  ///< their distances, per axis
};

/// How a frame lies over a reference frame, from the brightest stars of both. The frames may be shifted by
/// half their size and turned by a few degrees, their scales may differ by a few per cent.
/// @return nothing where too few stars agree
[[nodiscard]] std::optional<Registration> register_stars(const std::vector<Star>& stars,
                                                         const std::vector<Star>& reference, int width,
                                                         int height);

}  // namespace srfs::image
