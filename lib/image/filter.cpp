// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/filter.hpp"

#include <algorithm>
#include <cmath>

#include "image/rows.hpp"

namespace srfs::image {

void gaussian_filter(const Plane& in, float sigma_px, Plane& out, const Grid<std::uint8_t>* hidden) {
  const int radius = std::clamp(static_cast<int>(std::ceil(2.7F * sigma_px)), 1, filter_radius_max);
  std::vector<float> taps(static_cast<std::size_t>(radius) + 1);
  float squares = 0;
  for (int i = 0; i <= radius; ++i) {
    const float u = static_cast<float>(i) / sigma_px;
    const float v = std::exp(-0.5F * u * u);
    taps[static_cast<std::size_t>(i)] = v;
    squares += (i == 0 ? 1.0F : 2.0F) * v * v;
  }
  for (float& t : taps) t /= std::sqrt(squares);
  const int width = in.width();
  const int height = in.height();
  if (out.width() != width || out.height() != height) out = Plane::unset(width, height);
  const std::vector<float> dark(static_cast<std::size_t>(width), 0.0F);
  std::vector<float> line(static_cast<std::size_t>(width + 2 * radius), 0.0F);  // with zeros on both sides
  std::vector<const float*> rows(static_cast<std::size_t>(2 * radius + 1));
  const int ring = 2 * radius + 1;
  Plane shown(hidden != nullptr ? width : 0,
              hidden != nullptr ? ring : 0);  // the rows around the one at work
  const auto row_of = [&](int y) -> const float* {
    if (y < 0 || y >= height) return dark.data();
    return hidden != nullptr ? shown.row(y % ring) : in.row(y);
  };
  const auto show = [&](int y) {
    if (hidden != nullptr && y < height) hide_pixels(in.row(y), hidden->row(y), shown.row(y % ring), width);
  };
  for (int y = 0; y < radius; ++y) show(y);
  for (int y = 0; y < height; ++y) {
    show(y + radius);
    for (int i = -radius; i <= radius; ++i) rows[static_cast<std::size_t>(i + radius)] = row_of(y + i);
    filter_column(rows.data(), taps.data(), radius, line.data() + radius, width);
    filter_row(line.data() + radius, taps.data(), radius, out.row(y), width);
  }
}

}  // namespace srfs::image
