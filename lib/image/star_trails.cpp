// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/star_trails.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace srfs::image {
namespace {

/// Fewer may be objects that fly together.
constexpr std::size_t trails_least = 8;
/// Of all streaks: faint trails are found in pieces, and some cross.
constexpr double share_least = 0.5;
/// Streaks beside each star that was found.
constexpr double beside_stars_least = 0.5;
/// Of a trail's end by the noise and by the turn of the field, px, and of its length.
constexpr double end_error_px = 3;
constexpr double length_error = 0.2;

struct Shape {
  double length;
  double angle;  ///< 0 to pi
};

Shape shape_of(const Streak& s) {
  const double angle = std::atan2(s.y2 - s.y1, s.x2 - s.x1);
  return {s.length_px(), angle < 0 ? angle + std::numbers::pi : angle};
}

bool alike(const Shape& a, const Shape& b) {
  const double longer = std::max(a.length, b.length);
  const double turn = std::abs(a.angle - b.angle);
  return std::abs(a.length - b.length) < end_error_px + length_error * longer &&
         std::min(turn, std::numbers::pi - turn) * longer < end_error_px;
}

}  // namespace

std::optional<StarTrails> find_star_trails(std::span<const Streak> streaks, std::size_t stars) {
  const auto n = static_cast<double>(streaks.size());
  if (streaks.size() < trails_least || n < beside_stars_least * static_cast<double>(stars))
    return std::nullopt;
  std::vector<Shape> shapes;
  for (const Streak& s : streaks) shapes.push_back(shape_of(s));
  const auto like = [&](const Shape& one) {
    return std::count_if(shapes.begin(), shapes.end(), [&](const Shape& other) { return alike(one, other); });
  };
  const auto common = std::max_element(shapes.begin(), shapes.end(),
                                       [&](const Shape& a, const Shape& b) { return like(a) < like(b); });
  const auto trails = static_cast<double>(like(*common));
  if (trails < static_cast<double>(trails_least) || trails < share_least * n) return std::nullopt;
  StarTrails found{common->length, common->angle * 180 / std::numbers::pi, {}};
  for (const Shape& s : shapes) found.is_trail.push_back(alike(*common, s));
  return found;
}

}  // namespace srfs::image
