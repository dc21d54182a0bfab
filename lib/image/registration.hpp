#pragma once

#include <optional>
#include <vector>

#include "image/detections.hpp"

namespace srfs::image {

/// From one frame's pixels to another's: shift, turn and scale, or, with the other four, the projection that
/// a camera which turns makes of a wide field.
struct FrameTransform {
  double shift_x = 0;
  double shift_y = 0;
  double a = 1;  ///< scale * cos(turn)
  double b = 0;  ///< scale * sin(turn)
  double stretch = 0;
  double shear = 0;
  double tilt_x = 0;  ///< per px
  double tilt_y = 0;

  struct Point {
    double x, y;
  };
  [[nodiscard]] bool is_projection() const {
    return stretch != 0 || shear != 0 || tilt_x != 0 || tilt_y != 0;
  }
  [[nodiscard]] Point operator()(double x, double y) const {
    const double w = 1 + tilt_x * x + tilt_y * y;
    return {(shift_x + (a + stretch) * x + (shear - b) * y) / w,
            (shift_y + (b + shear) * x + (a - stretch) * y) / w};
  }
  [[nodiscard]] Point inverse(double x, double y) const {
    const double xx = a + stretch - tilt_x * x;
    const double xy = shear - b - tilt_y * x;
    const double yx = b + shear - tilt_x * y;
    const double yy = a - stretch - tilt_y * y;
    const double n = xx * yy - xy * yx;
    const double u = x - shift_x;
    const double v = y - shift_y;
    return {(yy * u - xy * v) / n, (xx * v - yx * u) / n};
  }
};

struct Registration {
  FrameTransform to_reference;
  int stars = 0;      ///< that both frames have
  double rms_px = 0;  ///< their distances, per axis
};

/// How a frame lies over a reference frame, from the brightest stars of both. The frames may be shifted by
/// half their size and turned by a few degrees, their scales may differ by a few per cent. The transform is a
/// projection only where many stars tell it clearly: a wide field that was turned.
/// @return nothing where too few stars agree
[[nodiscard]] std::optional<Registration> register_stars(const std::vector<Star>& stars,
                                                         const std::vector<Star>& reference, int width,
                                                         int height);

}  // namespace srfs::image
