// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/defect_map.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace srfs::image {
namespace {

constexpr float dark_least = 6;  ///< noises below the neighbours

}  // namespace

std::optional<float> middle_around(const Plane& pixels, int x, int y) {
  std::array<float, 8> around{};
  std::size_t n = 0;
  for (int j = y - 1; j <= y + 1; ++j) {
    for (int i = x - 1; i <= x + 1; ++i) {
      if ((i == x && j == y) || !pixels.contains(i, j) || !std::isfinite(pixels.at(i, j))) continue;
      around[n++] = pixels.at(i, j);
    }
  }
  if (n < 3) return std::nullopt;
  std::nth_element(around.begin(), around.begin() + static_cast<std::ptrdiff_t>(n / 2),
                   around.begin() + static_cast<std::ptrdiff_t>(n));
  return around[n / 2];
}

void DefectCount::add(const Frame& frame, const CleanFrame& clean) {
  ++frames_;
  for (int y = 0; y < height(); ++y) {
    for (int x = 0; x < width(); ++x) {
      const bool hot = (clean.flaws.at(x, y) & flaw_spike) != 0;
      const bool may_be_dark = clean.signal.at(x, y) < -dark_least;
      if (!hot && !may_be_dark) continue;
      const auto around = middle_around(frame.pixels, x, y);
      if (!around || !std::isfinite(frame.pixels.at(x, y))) continue;
      const float level = frame.pixels.at(x, y) - *around;
      if (hot)
        ++hot_.at(x, y);
      else if (level < -dark_least * clean.noise_adu.at(x, y))
        ++dark_.at(x, y);
      else
        continue;
      sum_.at(x, y) += level;
    }
  }
}

std::vector<Defect> DefectCount::defects(double share, std::size_t most) const {
  const int least = std::max(1, static_cast<int>(std::ceil(share * frames_)));
  std::vector<Defect> found;
  for (int y = 0; y < height(); ++y) {
    for (int x = 0; x < width(); ++x) {
      const int hot = hot_.at(x, y);
      const int dark = dark_.at(x, y);
      if (std::max(hot, dark) < least) continue;
      found.push_back({x, y, hot >= dark ? Defect::Kind::hot : Defect::Kind::dark,
                       double(sum_.at(x, y)) / (hot + dark), std::max(hot, dark)});
    }
  }
  std::sort(found.begin(), found.end(), [](const Defect& a, const Defect& b) {
    const double one = std::abs(a.level_adu);
    const double other = std::abs(b.level_adu);
    return one != other ? one > other : (a.y != b.y ? a.y < b.y : a.x < b.x);
  });
  if (found.size() > most) found.resize(most);
  return found;
}

}  // namespace srfs::image
