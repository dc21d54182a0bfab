// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/registration.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

#include "image/place_index.hpp"

namespace srfs::image {
namespace {

constexpr std::size_t votes_of = 80;     ///< brightest stars that vote for a shift
constexpr std::size_t fitted_of = 2000;  ///< brightest stars that are fitted
constexpr std::size_t agreeing_least = 4;

struct Pair {
  const Star* star;
  const Star* reference;
};

std::vector<Star> brightest(std::vector<Star> stars, std::size_t most) {
  std::sort(stars.begin(), stars.end(), [](const Star& a, const Star& b) { return a.flux > b.flux; });
  if (stars.size() > most) stars.resize(most);
  return stars;
}

/// The shift that most pairs of stars of similar brightness have in common, within @p bin_px; nothing where
/// that may be chance.
std::optional<FrameTransform> vote(const std::vector<Star>& stars, const std::vector<Star>& reference,
                                   int width, int height, double bin_px) {
  const int columns = static_cast<int>(width / bin_px) + 2;
  const int rows = static_cast<int>(height / bin_px) + 2;
  Grid<std::uint16_t> votes(columns, rows);
  double all = 0;
  for (const Star& s : stars) {
    for (const Star& r : reference) {
      if (r.flux > 2.5 * s.flux || s.flux > 2.5 * r.flux) continue;
      const double i = (r.x - s.x) / bin_px + columns / 2.0;
      const double j = (r.y - s.y) / bin_px + rows / 2.0;
      if (i < 0 || j < 0 || i >= columns || j >= rows) continue;
      ++votes.at(static_cast<int>(i), static_cast<int>(j));
      ++all;
    }
  }
  int most = 0;
  int best_i = 0;
  int best_j = 0;
  for (int j = 0; j + 1 < rows; ++j) {
    for (int i = 0; i + 1 < columns; ++i) {
      const int sum = votes.at(i, j) + votes.at(i + 1, j) + votes.at(i, j + 1) + votes.at(i + 1, j + 1);
      if (sum > most) most = sum, best_i = i, best_j = j;
    }
  }
  const double by_chance = 4 * all / (0.4 * columns * rows);  // most differences are near the middle
  if (most < static_cast<int>(agreeing_least) || most < by_chance + 5 * std::sqrt(by_chance))
    return std::nullopt;
  return FrameTransform{(best_i + 1 - columns / 2.0) * bin_px, (best_j + 1 - rows / 2.0) * bin_px, 1, 0};
}

/// Stars of one frame beside the nearest of the other, where that is the only one.
std::vector<Pair> pairs_within(const std::vector<Star>& stars, const std::vector<Star>& reference,
                               const PlaceIndex& index, const FrameTransform& transform, double reach) {
  std::vector<Pair> pairs;
  for (const Star& s : stars) {
    const auto [x, y] = transform(s.x, s.y);
    const Star* nearest = nullptr;
    int near = 0;
    index.near(x, y, reach, [&](std::size_t i, double) {
      nearest = &reference[i];
      ++near;
    });
    if (near == 1) pairs.push_back({&s, nearest});
  }
  return pairs;
}

/// Least squares, each pair weighted by its fainter star's SNR up to 100. @return the rms of what is left,
/// per axis
double fit(const std::vector<Pair>& pairs, FrameTransform& transform) {
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  const auto add = [&](const Eigen::Vector4d& g, double value, double weight) {
    normal.noalias() += weight * g * g.transpose();
    right += weight * value * g;
  };
  const auto weight_of = [](const Pair& p) {
    return std::pow(std::clamp(std::min(p.star->snr, p.reference->snr), 1.0, 100.0), 2);
  };
  // Around the middle of the stars, for the numbers' sake.
  double mx = 0;
  double my = 0;
  for (const Pair& p : pairs) mx += p.star->x, my += p.star->y;
  mx /= static_cast<double>(pairs.size()), my /= static_cast<double>(pairs.size());
  for (const Pair& p : pairs) {
    const double x = p.star->x - mx;
    const double y = p.star->y - my;
    add({1, 0, x, -y}, p.reference->x, weight_of(p));
    add({0, 1, y, x}, p.reference->y, weight_of(p));
  }
  const Eigen::Vector4d t = normal.ldlt().solve(right);
  if (!t.allFinite()) return 1e9;
  transform = {t[0] - t[2] * mx + t[3] * my, t[1] - t[3] * mx - t[2] * my, t[2], t[3]};
  double squares = 0;
  double weights = 0;
  for (const Pair& p : pairs) {
    const auto [x, y] = transform(p.star->x, p.star->y);
    squares += weight_of(p) * (std::pow(x - p.reference->x, 2) + std::pow(y - p.reference->y, 2)) / 2;
    weights += weight_of(p);
  }
  return std::sqrt(squares / weights);
}

}  // namespace

std::optional<Registration> register_stars(const std::vector<Star>& stars, const std::vector<Star>& reference,
                                           int width, int height) {
  const std::vector<Star> some = brightest(stars, votes_of);
  const std::vector<Star> some_of_reference = brightest(reference, votes_of);
  const std::vector<Star> many = brightest(stars, fitted_of);
  const std::vector<Star> many_of_reference = brightest(reference, fitted_of);
  const PlaceIndex few(some_of_reference);
  const PlaceIndex all(many_of_reference);
  for (const double bin : {3.0, 10.0, 30.0}) {
    auto transform = vote(some, some_of_reference, width, height, bin);
    if (!transform) continue;
    // The brightest first, then all of them, ever closer.
    bool lost = false;
    for (double reach = 1.5 * bin; reach > 3 && !lost; reach /= 2) {
      const auto pairs = pairs_within(some, some_of_reference, few, *transform, reach);
      lost = pairs.size() < agreeing_least || fit(pairs, *transform) > reach;
    }
    if (lost) continue;
    double reach = 3;
    std::optional<Registration> found;
    for (int round = 0; round < 4; ++round) {
      const auto pairs = pairs_within(many, many_of_reference, all, *transform, reach);
      if (pairs.size() < agreeing_least) {
        found.reset();
        break;
      }
      const double rms = fit(pairs, *transform);
      found = Registration{*transform, static_cast<int>(pairs.size()), rms};
      reach = std::clamp(4 * rms, 0.7, 3.0);
    }
    const double scale = found ? std::hypot(found->to_reference.a, found->to_reference.b) : 0;
    if (found && scale > 0.9 && scale < 1.1 &&
        3 * static_cast<std::size_t>(found->stars) >= std::min(some.size(), some_of_reference.size()))
      return found;
  }
  return std::nullopt;
}

}  // namespace srfs::image
