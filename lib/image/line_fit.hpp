// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "image/frame.hpp"
#include "image/line_profile.hpp"
#include "image/psf.hpp"

namespace srfs::image {

/// A streak while it is being looked for: ends, height of its light along the middle line, width beside the
/// frame's stars.
struct Line {
  double x1, y1, x2, y2;
  double height = 1;
  double scale = 1;

  [[nodiscard]] double length() const;
};

/// Fits blurred lines to a plane whose noise is 1. Pixels with a mask other than 0 are ignored.
class LineFitter {
 public:
  /// Every fit reads both planes; they may change in between.
  LineFitter(const Plane& light, const Grid<std::uint8_t>& mask, const Psf& psf, LineNoise noise);

  /// From about where the line is to where it fits best, its ends included. @return its significance beside
  /// pixel noise 1
  /// @param least  what is clearly less significant is given up early, and so is what is
  /// @param shortest  px, clearly shorter
  [[nodiscard]] std::optional<double> settle(Line& line, double least, double shortest);
  /// About how significant the light is from which settle() would start, beside pixel noise 1.
  [[nodiscard]] double nearby_significance(const Line& line);
  /// The ends too, from near by.
  [[nodiscard]] std::optional<double> fit(Line& line) { return fit(line, 1, true, 12); }

  /// Ends that the noise leaves open are the mean of all places, each as likely as it explains the light.
  /// @param noise  of the matched filter, beside that of a pixel
  void weigh_ends(Line& line, double noise);

  /// Pixels within @p reach_px of the line and at most @p beyond_px behind its ends.
  const LinePixels& collect(const Line& line, double reach_px, double beyond_px);
  [[nodiscard]] LineShape shape_of(const Line& line) const;
  /// How far beside a line its light reaches.
  [[nodiscard]] double reach_px(const Line& line) const;
  /// Heights that fit best along lines beside this one, a few widths away, where enough of them is seen.
  [[nodiscard]] std::vector<double> heights_beside(const Line& line);
  [[nodiscard]] const LineNoise& noise() const { return noise_; }

 private:
  /// @param blur  the line is taken for so much wider, to be found from farther
  [[nodiscard]] std::optional<double> fit(Line& line, double blur, bool with_ends, int rounds);
  void find_ends(Line& line);
  struct Steps {
    std::vector<double> light;   ///< weighted by the line's profile
    std::vector<double> energy;  ///< of the weights
    double before = 0;           ///< px from the first step to the line
  };
  /// Valid until the next call.
  const Steps& steps_along(const Line& line);
  [[nodiscard]] static double gain_of(const Steps& steps, std::size_t step, double height);

  const Plane& light_;
  const Grid<std::uint8_t>& mask_;
  Psf::Shape shape_;
  double sigma_;  ///< of the light across a line, for round stars
  double blur_;   ///< so much wider a line is taken for, to be found from farther
  LineNoise noise_;
  LinePixels pixels_;
  Steps steps_;
  std::vector<float> along_;
  std::vector<float> profile_;
};

/// Calls use(y, first x, last x) for the rows of pixels within @p reach of a line, up to @p beyond behind its
/// ends.
template <class Use>
void for_rows_along(const Line& l, int width, int height, double reach, double beyond, Use&& use) {
  const double length = std::max(1e-3, l.length());
  const double ux = (l.x2 - l.x1) / length;
  const double uy = (l.y2 - l.y1) / length;
  // Of the rectangle around the line.
  const double dx = std::abs(ux) * beyond + std::abs(uy) * reach;
  const double dy = std::abs(uy) * beyond + std::abs(ux) * reach;
  const auto first_of = [](double v, int size) {  // rounded up
    v = std::clamp(v, 0.0, 1.0 * size);
    const int whole = static_cast<int>(v);
    return whole + (v > whole);
  };
  const auto last_of = [](double v, int size) {  // rounded down
    return static_cast<int>(std::clamp(v, -1.0, size - 1.0) + 1) - 1;
  };
  constexpr double never = 1e-6;  // along a row or across all of them
  const bool crosses = std::abs(uy) > never;
  const bool advances = std::abs(ux) > never;
  const double per_uy = crosses ? 1 / uy : 0;
  const double per_ux = advances ? 1 / ux : 0;
  const double half = reach * std::abs(per_uy);
  const double left = std::min(l.x1, l.x2) - dx;
  const double right = std::max(l.x1, l.x2) + dx;
  const int y1 = last_of(std::max(l.y1, l.y2) + dy, height);
  for (int y = first_of(std::min(l.y1, l.y2) - dy, height); y <= y1; ++y) {
    double from = left;
    double to = right;
    // Where |across| <= reach and -beyond <= along <= length + beyond in this row.
    const double ry = y - l.y1;
    if (crosses) {
      const double middle = l.x1 + ry * ux * per_uy;
      from = std::max(from, middle - half);
      to = std::min(to, middle + half);
    } else if (std::abs(ry) > reach) {
      continue;
    }
    if (advances) {
      const double a = l.x1 + (-beyond - ry * uy) * per_ux;
      const double b = l.x1 + (length + beyond - ry * uy) * per_ux;
      from = std::max(from, std::min(a, b));
      to = std::min(to, std::max(a, b));
    } else if (ry * uy < -beyond || ry * uy > length + beyond) {
      continue;
    }
    const int first = first_of(from, width);
    const int last = last_of(to, width);
    if (first <= last) use(y, first, last);
  }
}

/// Calls use(x, y, along, across) for those pixels.
template <class Use>
void for_pixels_along(const Line& l, int width, int height, double reach, double beyond, Use&& use) {
  const double length = std::max(1e-3, l.length());
  const double ux = (l.x2 - l.x1) / length;
  const double uy = (l.y2 - l.y1) / length;
  for_rows_along(l, width, height, reach, beyond, [&](int y, int first, int last) {
    const double ry = y - l.y1;
    for (int x = first; x <= last; ++x) {
      const double rx = x - l.x1;
      use(x, y, rx * ux + ry * uy, ry * ux - rx * uy);
    }
  });
}

}  // namespace srfs::image
