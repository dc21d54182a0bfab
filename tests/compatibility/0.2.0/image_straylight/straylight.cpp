// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "straylight.hpp"

#include <algorithm>
#include <limits>
#include <vector>

namespace srfs {
namespace {

constexpr std::size_t blocks = 16;  // a side
constexpr std::size_t levels = 65536;
constexpr std::uint16_t full_scale = 65535;
constexpr float hysteresis = 0.9F;

/// Counts of the values seen, and how many.
struct Histogram {
  std::vector<std::uint32_t> counts = std::vector<std::uint32_t>(levels);
  std::size_t total = 0;

  void add(std::uint16_t value) {
    ++counts[value];
    ++total;
  }
  /// The lower one of an even number of pixels.
  [[nodiscard]] std::uint16_t median() const {
    std::size_t below = 0;
    for (std::size_t level = 0; level < levels; ++level) {
      below += counts[level];
      if (2 * below >= total) return static_cast<std::uint16_t>(level);
    }
    return 0;
  }
};

std::uint16_t pixel(OctetView pixels, std::size_t index) {
  return static_cast<std::uint16_t>(pixels[2 * index] | pixels[2 * index + 1] << 8);
}

/// A block's median, over every second pixel of every second row: enough for the sky.
std::uint16_t block_median(OctetView pixels, std::size_t width, std::size_t x0, std::size_t x1,
                           std::size_t y0, std::size_t y1, std::vector<std::uint16_t>& values) {
  values.clear();
  for (std::size_t y = y0; y < y1; y += 2)
    for (std::size_t x = x0; x < x1; x += 2) values.push_back(pixel(pixels, y * width + x));
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

std::optional<Straylight> measure_straylight(OctetView pixels, std::size_t width, std::size_t height) {
  constexpr std::size_t longest_side = 32768;
  if (width < blocks || height < blocks || width > longest_side || height > longest_side) return std::nullopt;
  if (pixels.size() != width * height * 2) return std::nullopt;

  Histogram all;
  for (std::size_t i = 0; i < width * height; ++i) all.add(pixel(pixels, i));

  std::uint16_t darkest = std::numeric_limits<std::uint16_t>::max();
  std::uint16_t brightest = 0;
  std::vector<std::uint16_t> values;
  for (std::size_t row = 0; row < blocks; ++row) {
    for (std::size_t column = 0; column < blocks; ++column) {
      const std::uint16_t median =
          block_median(pixels, width, column * width / blocks, (column + 1) * width / blocks,
                       row * height / blocks, (row + 1) * height / blocks, values);
      darkest = std::min(darkest, median);
      brightest = std::max(brightest, median);
    }
  }
  Straylight found;
  found.sky_adu = all.median();
  found.gradient_adu = static_cast<float>(brightest - darkest);
  found.saturated_fraction = static_cast<float>(all.counts[full_scale]) / static_cast<float>(all.total);
  return found;
}

BrightSky::Change BrightSky::on_sky(float sky_adu, float limit_adu) {
  if (!bright_ && sky_adu > limit_adu) {
    bright_ = true;
    return Change::bright;
  }
  if (bright_ && sky_adu < hysteresis * limit_adu) {
    bright_ = false;
    return Change::dark;
  }
  return Change::none;
}

}  // namespace srfs
