// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/picture.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "image/background.hpp"

namespace srfs::image {
namespace {

constexpr float sky_grey = 2;         ///< noises below the sky that are black
constexpr float softening = 3;        ///< noises from which the scale becomes logarithmic
constexpr float white_least = 20;     ///< noises above the sky that are white at least
constexpr double white_share = 5e-4;  ///< of the pixels that may be white

/// Means of the finite pixels under each pixel; NaN where there is none.
Plane shrunk(const Plane& pixels, int width, int height) {
  Plane small(width, height);
  for (int y = 0; y < height; ++y) {
    const int y0 = static_cast<int>(std::int64_t{y} * pixels.height() / height);
    const int y1 = std::max(y0 + 1, static_cast<int>(std::int64_t{y + 1} * pixels.height() / height));
    for (int x = 0; x < width; ++x) {
      const int x0 = static_cast<int>(std::int64_t{x} * pixels.width() / width);
      const int x1 = std::max(x0 + 1, static_cast<int>(std::int64_t{x + 1} * pixels.width() / width));
      double sum = 0;
      int n = 0;
      for (int j = y0; j < y1; ++j) {
        for (int i = x0; i < x1; ++i) {
          const float v = pixels.at(i, j);
          if (std::isfinite(v)) sum += double(v), ++n;
        }
      }
      small.at(x, y) = n > 0 ? static_cast<float>(sum / n) : std::numeric_limits<float>::quiet_NaN();
    }
  }
  return small;
}

}  // namespace

Grid<std::uint8_t> thumbnail(const Plane& pixels, int width) {
  width = std::clamp(width, 1, pixels.width());
  const int height =
      std::max(1, static_cast<int>(std::int64_t{pixels.height()} * width / std::max(1, pixels.width())));
  const Plane small = shrunk(pixels, width, height);
  Grid<std::uint8_t> picture(width, height);
  std::vector<float> values;
  for (const float v : small.cells()) {
    if (std::isfinite(v)) values.push_back(v);
  }
  if (values.empty()) return picture;
  const float sky = median_of(values);
  for (float& v : values) v = std::abs(v - sky);
  const float noise = std::max(1.4826F * median_of(values), 1e-6F * std::max(1.0F, std::abs(sky)));
  const auto whites = static_cast<std::ptrdiff_t>((1 - white_share) * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + whites, values.end());
  const float white = std::max(white_least, values[static_cast<std::size_t>(whites)] / noise);
  const float unit = 255 / std::asinh((white + sky_grey) / softening);
  for (std::size_t i = 0; i < small.size(); ++i) {
    const float v = std::isfinite(small.cells()[i]) ? (small.cells()[i] - sky) / noise : 0;
    const float grey = unit * std::asinh(std::max(0.0F, v + sky_grey) / softening);
    // Not a number where the values span more than a float can scale.
    picture.cells()[i] = static_cast<std::uint8_t>(grey > 0 ? std::min(grey, 255.0F) : 0.0F);
  }
  return picture;
}

std::optional<Rectangle> within(const Rectangle& wanted, int frame_width, int frame_height) {
  const std::int64_t x0 = std::max(0, wanted.x);
  const std::int64_t y0 = std::max(0, wanted.y);
  const std::int64_t x1 = std::min<std::int64_t>(frame_width, std::int64_t{wanted.x} + wanted.width);
  const std::int64_t y1 = std::min<std::int64_t>(frame_height, std::int64_t{wanted.y} + wanted.height);
  if (x0 >= x1 || y0 >= y1) return std::nullopt;
  return Rectangle{static_cast<int>(x0), static_cast<int>(y0), static_cast<int>(x1 - x0),
                   static_cast<int>(y1 - y0)};
}

Plane cut_out(const Plane& pixels, const Rectangle& rectangle) {
  Plane out(rectangle.width, rectangle.height);
  for (int y = 0; y < rectangle.height; ++y) {
    const float* row = pixels.row(rectangle.y + y) + rectangle.x;
    std::copy(row, row + rectangle.width, out.row(y));
  }
  return out;
}

}  // namespace srfs::image
