// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/searched_sky.hpp"

#include <algorithm>
#include <array>

namespace srfs::image {
namespace {

/// Where the noise is so many times that of the calm quarter of the frame there are trees, buildings or the
/// Earth, and edges in all directions.
constexpr float unrest_most = 5;
/// A line may lie beside no sky on so much of its length.
constexpr double no_sky_most = 0.3;
constexpr int no_sky_reach_px = 24;
/// A detector's outermost rows and columns and what is amplified beside them: as wide as this share of a line
/// along them, within limits.
constexpr double edge_share = 0.2;
constexpr double edge_most_px = 8;

/// What a quarter of the frame's cells stay below.
float calm_noise(const Surface& noise) {
  std::vector<float> nodes(noise.nodes().cells().begin(), noise.nodes().cells().end());
  // Black corners have no noise at all, but exactly the floor's.
  const float floor = *std::min_element(nodes.begin(), nodes.end());
  std::vector<float> lit;
  std::copy_if(nodes.begin(), nodes.end(), std::back_inserter(lit), [&](float v) { return v > floor; });
  if (lit.size() > nodes.size() / 4) nodes = std::move(lit);
  const auto quarter = nodes.begin() + static_cast<std::ptrdiff_t>(nodes.size() / 4);
  std::nth_element(nodes.begin(), quarter, nodes.end());
  return *quarter;
}

}  // namespace

SearchedSky::SearchedSky(const CleanFrame& clean)
    : clean_(clean), calm_noise_adu_(calm_noise(clean.noise_adu)) {}

bool SearchedSky::is_in_unrest(const Line& l) const {
  const auto restless = [&](double x, double y) {
    return clean_.noise_adu.at(x, y) > unrest_most * calm_noise_adu_;
  };
  return restless(l.x1, l.y1) || restless(l.x2, l.y2) || restless((l.x1 + l.x2) / 2, (l.y1 + l.y2) / 2);
}

bool SearchedSky::is_beside_no_sky(const Line& l) const {
  if (clean_.no_sky == 0) return false;
  constexpr std::array<int, 3> around{-no_sky_reach_px, 0, no_sky_reach_px};
  const auto dark = [&](double x, double y) {
    return std::any_of(around.begin(), around.end(), [&](int dy) {
      return std::any_of(around.begin(), around.end(), [&](int dx) {
        const int i = static_cast<int>(x) + dx;
        const int j = static_cast<int>(y) + dy;
        return clean_.flaws.contains(i, j) && (clean_.flaws.at(i, j) & flaw_no_sky) != 0;
      });
    });
  };
  return places_along(l, dark) > no_sky_most * places_of_line;
}

bool SearchedSky::is_along_edge(const Line& l, double width_px) const {
  const double right = clean_.signal.width() - 1;
  const double bottom = clean_.signal.height() - 1;
  const double most = std::min({edge_most_px, right / 16, bottom / 16});
  const double margin = std::max(0.75 * width_px + 1, std::min(edge_share * l.length(), most));
  return std::max(l.x1, l.x2) < margin || std::min(l.x1, l.x2) > right - margin ||
         std::max(l.y1, l.y2) < margin || std::min(l.y1, l.y2) > bottom - margin;
}

}  // namespace srfs::image
