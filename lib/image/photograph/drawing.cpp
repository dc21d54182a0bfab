// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/photograph/drawing.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "image/picture.hpp"

namespace srfs::image {
namespace {

using Colour = std::array<std::uint8_t, 3>;
constexpr Colour green{80, 220, 80};
constexpr Colour red{255, 80, 60};
constexpr Colour yellow{255, 220, 40};
constexpr double longest_line = 1e5;  // px; nothing of a picture is as far away

class Pen {
 public:
  Pen(Colours& picture, double scale) : picture_(picture), scale_(scale) {}

  void dot(double x, double y, const Colour& colour) {
    if (!(std::abs(x) < longest_line && std::abs(y) < longest_line)) return;
    const int i = static_cast<int>(std::lround(x));
    const int j = static_cast<int>(std::lround(y));
    if (!picture_[0].contains(i, j)) return;
    for (std::size_t c = 0; c < 3; ++c) picture_.at(c).at(i, j) = colour.at(c);
  }
  /// Ends in pixels of the frame.
  void line(std::array<double, 2> a, std::array<double, 2> b, const Colour& colour) {
    for (auto* end : {&a, &b}) *end = {place((*end)[0]), place((*end)[1])};
    const double length = std::hypot(b[0] - a[0], b[1] - a[1]);
    if (!(length < longest_line)) return;
    const int steps = std::max(1, static_cast<int>(std::ceil(length)));
    for (int k = 0; k <= steps; ++k) {
      const double t = static_cast<double>(k) / steps;
      dot(a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), colour);
    }
  }
  /// @param radius  px of the picture
  void circle(double x, double y, double radius, const Colour& colour) {
    const int steps = static_cast<int>(std::ceil(8 * radius));
    for (int k = 0; k < steps; ++k) {
      const double angle = 2 * std::numbers::pi * k / steps;
      dot(place(x) + radius * std::cos(angle), place(y) + radius * std::sin(angle), colour);
    }
  }
  /// Around a streak, which stays visible.
  void box(const Streak& s, double margin, const Colour& colour) {
    const double length = std::max(1e-6, s.length_px());
    const double ux = margin * (s.x2 - s.x1) / length;
    const double uy = margin * (s.y2 - s.y1) / length;
    const std::array<std::array<double, 2>, 4> corners{{{s.x1 - ux - uy, s.y1 - uy + ux},
                                                        {s.x2 + ux - uy, s.y2 + uy + ux},
                                                        {s.x2 + ux + uy, s.y2 + uy - ux},
                                                        {s.x1 - ux + uy, s.y1 - uy - ux}}};
    for (std::size_t k = 0; k < 4; ++k) line(corners.at(k), corners.at((k + 1) % 4), colour);
  }

 private:
  [[nodiscard]] double place(double pixel) const { return (pixel + 0.5) * scale_ - 0.5; }

  Colours& picture_;
  double scale_;
};

}  // namespace

Colours draw(const Plane& pixels, const Overlay& overlay, int width) {
  const Grid<std::uint8_t> grey = thumbnail(pixels, width);
  Colours picture{grey, grey, grey};
  const double scale = static_cast<double>(grey.width()) / pixels.width();
  Pen pen(picture, scale);
  for (const Star& s : overlay.stars) pen.circle(s.x, s.y, 5, green);
  for (const Streak& s : overlay.streaks) pen.box(s, 6 / scale, red);
  for (const auto& track : overlay.tracks) {
    for (const auto& p : track) pen.circle(p[0], p[1], 7, yellow);
    if (track.size() > 1) pen.line(track.front(), track.back(), yellow);
  }
  return picture;
}

}  // namespace srfs::image
