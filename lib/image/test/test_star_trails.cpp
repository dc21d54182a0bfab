// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/star_trails.hpp"

#include <cmath>
#include <utility>

#include <gtest/gtest.h>

#include "tests/sky/sky_frame.hpp"

namespace srfs::image {
namespace {

Streak streak(double x, double y, double length, double angle_rad) {
  return {x, y, x + length * std::cos(angle_rad), y + length * std::sin(angle_rad), 20, 1000, 2.5};
}

/// Trails spread over a frame, with position errors of half a pixel.
std::vector<Streak> trails(int n, double length, double angle_rad) {
  hw_sim::SkyRandom random(7);
  std::vector<Streak> all;
  for (int i = 0; i < n; ++i) {
    all.push_back(streak(random.uniform(0, 900), random.uniform(0, 700), length + random.uniform(-1, 1),
                         angle_rad + random.uniform(-1, 1) / length));
    if (i % 2 == 1) std::swap(all.back().x1, all.back().x2), std::swap(all.back().y1, all.back().y2);
  }
  return all;
}

TEST(StarTrails, AreStreaksAllAlikeWhereThereAreHardlyAnyStars) {
  std::vector<Streak> all = trails(30, 40, 0.6);
  all.push_back(streak(300, 300, 90, 1.9));

  const auto found = find_star_trails(all, 5);

  ASSERT_TRUE(found);
  EXPECT_NEAR(found->length_px, 40, 1.5);
  EXPECT_NEAR(found->angle_deg, 0.6 * 180 / 3.14159, 2);
  EXPECT_TRUE(found->is_trail.front());
  EXPECT_FALSE(found->is_trail.back()) << "it moved by itself";
}

TEST(StarTrails, AlongTheRowsHaveOneDirectionThoughTheirAnglesAreNearBothEnds) {
  EXPECT_TRUE(find_star_trails(trails(20, 50, 0.0), 0));
}

TEST(StarTrails, AreNotWhatCrossesAFieldOfStars) {
  EXPECT_FALSE(find_star_trails(trails(10, 40, 0.6), 300)) << "a formation before the stars";
  EXPECT_FALSE(find_star_trails(trails(7, 40, 0.6), 0)) << "too few to tell";
  EXPECT_FALSE(find_star_trails({}, 0));
}

TEST(StarTrails, AreNotStreaksOfEveryDirection) {
  std::vector<Streak> all;
  for (int i = 0; i < 30; ++i) all.push_back(streak(20.0 * i, 400, 20 + 3 * i, 0.1 * i));
  EXPECT_FALSE(find_star_trails(all, 0));
}

}  // namespace
}  // namespace srfs::image
