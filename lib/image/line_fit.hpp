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

/// Fits blurred lines to a plane whose noise is 1. Pixels with a mask other than 0 are not looked at.
class LineFitter {
 public:
  /// Both planes are looked at whenever a fit is made; they may change in between.
  LineFitter(const Plane& light, const Grid<std::uint8_t>& mask, const Psf& psf, LineNoise noise);

  /// From about where the line is to where it fits best, its ends included. @return its significance beside
  /// pixel noise 1
  /// @param least  what is clearly less significant is given up early
  [[nodiscard]] std::optional<double> settle(Line& line, double least);
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
  [[nodiscard]] Steps steps_along(const Line& line) const;
  [[nodiscard]] static double gain_of(const Steps& steps, std::size_t step, double height);

  const Plane& light_;
  const Grid<std::uint8_t>& mask_;
  Psf::Shape shape_;
  double sigma_;  ///< of the light across a line, for round stars
  LineNoise noise_;
  LinePixels pixels_;
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
  const auto first_of = [](double v, int size) {
    return static_cast<int>(std::ceil(std::clamp(v, 0.0, 1.0 * size)));
  };
  const auto last_of = [](double v, int size) {
    return static_cast<int>(std::floor(std::clamp(v, -1.0, size - 1.0)));
  };
  const int y1 = last_of(std::max(l.y1, l.y2) + dy, height);
  for (int y = first_of(std::min(l.y1, l.y2) - dy, height); y <= y1; ++y) {
    double from = std::min(l.x1, l.x2) - dx;
    double to = std::max(l.x1, l.x2) + dx;
    // Where |across| <= reach and -beyond <= along <= length + beyond in this row.
    const double ry = y - l.y1;
    if (std::abs(uy) > 1e-6) {
      const double middle = l.x1 + ry * ux / uy;
      from = std::max(from, middle - reach / std::abs(uy));
      to = std::min(to, middle + reach / std::abs(uy));
    } else if (std::abs(ry) > reach) {
      continue;
    }
    if (std::abs(ux) > 1e-6) {
      const double a = l.x1 + (-beyond - ry * uy) / ux;
      const double b = l.x1 + (length + beyond - ry * uy) / ux;
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
