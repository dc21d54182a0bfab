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

void high_pass(Plane& plane) {
  constexpr int box_radius = 16;
  const int w = plane.width();
  const int h = plane.height();
  const int ring = 2 * box_radius + 2;
  std::vector<float> column(static_cast<std::size_t>(w), 0.0F);
  std::vector<float> sums(static_cast<std::size_t>(w) + 1);
  Plane clipped(w, std::min(h, ring));  // the rows in the box, before they change
  int rows = 0;
  const auto add = [&](int y) {
    clip_row(plane.row(y), 3, clipped.row(y % ring), w);
    add_row(clipped.row(y % ring), column.data(), w);
    ++rows;
  };
  for (int y = 0; y < std::min(h, box_radius); ++y) add(y);
  for (int y = 0; y < h; ++y) {
    if (y + box_radius < h) add(y + box_radius);
    if (y - box_radius - 1 >= 0) {
      subtract(column.data(), clipped.row((y - box_radius - 1) % ring), w);
      --rows;
    }
    float sum = 0;
    for (int x = 0; x < w; ++x)
      sums[static_cast<std::size_t>(x) + 1] = sum += column[static_cast<std::size_t>(x)];
    float* to = plane.row(y);
    const auto mean = [&](int from, int end) {
      return (sums[static_cast<std::size_t>(end)] - sums[static_cast<std::size_t>(from)]) /
             static_cast<float>(rows * (end - from));
    };
    const int inside_from = std::min(w, box_radius);
    const int inside_end = std::max(inside_from, w - box_radius);
    for (int x = 0; x < inside_from; ++x)
      to[x] -= mean(std::max(0, x - box_radius), std::min(w, x + box_radius + 1));
    const float share = 1 / static_cast<float>(rows * (2 * box_radius + 1));
    for (int x = inside_from; x < inside_end; ++x)
      to[x] -= share * (sums[static_cast<std::size_t>(x + box_radius) + 1] -
                        sums[static_cast<std::size_t>(x - box_radius)]);
    for (int x = inside_end; x < w; ++x)
      to[x] -= mean(std::max(0, x - box_radius), std::min(w, x + box_radius + 1));
  }
}

}  // namespace srfs::image
