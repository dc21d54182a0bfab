// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/plate_solver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "tests/build_kind.hpp"
#include "tests/sky/sky_frame.hpp"

namespace srfs::image {
namespace {

using Eigen::Vector3d;
using hw_sim::SkyRandom;

constexpr double rad_per_deg = std::numbers::pi / 180;

const PlateSolver& solver() {
  static const PlateSolver solver(wide_scales());
  return solver;
}

FieldSolver& any_field() {
  static FieldSolver solver;
  return solver;
}

const std::vector<CatalogueStar>& all_stars() {
  static const std::vector<CatalogueStar> stars = bright_stars(faintest_of_catalogue);
  return stars;
}

/// A camera at an arbitrary pointing and the stars that it sees. A few catalogue stars are missing, a few
/// stars are not in the catalogue, and positions and fluxes are not exact.
struct View {
  double ra_deg, dec_deg, roll_deg, field_deg;
  bool mirrored = false;
  int width = 1920;
  int height = 1080;
  double faintest = 8;
  double distortion = 0;  ///< displacement at the corners over their distance from the middle
  double false_share = 1.0 / 8;

  [[nodiscard]] double focal_px() const { return width / 2.0 / std::tan(field_deg / 2 * rad_per_deg); }

  [[nodiscard]] std::vector<Star> stars(SkyRandom& random) const {
    const Vector3d middle = direction_of(ra_deg, dec_deg);
    const Vector3d east = Vector3d(-middle.y(), middle.x(), 0).normalized();
    const Vector3d north = middle.cross(east);
    const Vector3d down = -std::cos(roll_deg * rad_per_deg) * north - std::sin(roll_deg * rad_per_deg) * east;
    const Vector3d right = down.cross(middle);
    std::vector<Star> stars;
    const double corner_px = std::hypot(width, height) / 2;
    for (const CatalogueStar& s : all_stars()) {
      if (s.magnitude > faintest) break;
      const double ahead = s.direction.dot(middle);
      if (ahead < 0.75 || random.uniform() < 0.05) continue;
      const double side = (mirrored ? -1 : 1) * s.direction.dot(right) / ahead * focal_px();
      const double below = s.direction.dot(down) / ahead * focal_px();
      // Farther out the polynomial turns back.
      const double square = (side * side + below * below) / (corner_px * corner_px);
      if (square > 1.5) continue;
      const double x = (width - 1) / 2.0 + side * (1 + distortion * square) + 0.1 * random.normal();
      const double y = (height - 1) / 2.0 + below * (1 + distortion * square) + 0.1 * random.normal();
      if (x < 0 || y < 0 || x > width - 1 || y > height - 1) continue;
      stars.push_back({x, y, 1e5 * std::pow(10, -0.4 * s.magnitude) * random.uniform(0.93, 1.07), 20, 2});
    }
    const auto false_ones = static_cast<int>(static_cast<double>(stars.size()) * false_share);
    const std::vector<Star> others = anywhere(random, false_ones);
    stars.insert(stars.end(), others.begin(), others.end());
    return stars;
  }

  [[nodiscard]] std::vector<Star> anywhere(SkyRandom& random, int count) const {
    std::vector<Star> stars;
    for (int i = 0; i < count; ++i)
      stars.push_back(
          {random.uniform(0, width), random.uniform(0, height), 60 / (1 - random.uniform()), 20, 2});
    return stars;
  }
};

double arcsec_between(const Vector3d& a, const Vector3d& b) {
  return 2 * std::asin((a - b).norm() / 2) / rad_per_deg * 3600;
}

TEST(StarCatalogue, HasTheBrightStarsWhereTheyAre) {
  const auto stars = all_stars();
  EXPECT_GT(stars.size(), 520000U);
  EXPECT_LT(stars.back().magnitude, 10.55);
  EXPECT_EQ(bright_stars(2.0).back().magnitude, 1.95);
  EXPECT_TRUE(std::is_sorted(stars.begin(), stars.end(),
                             [](const auto& a, const auto& b) { return a.magnitude < b.magnitude; }));
  // Rigel, J2000.
  const Vector3d rigel = direction_of(78.6345, -8.2016);
  EXPECT_TRUE(std::any_of(stars.begin(), stars.begin() + 20, [&](const CatalogueStar& s) {
    return arcsec_between(s.direction, rigel) < 5 && std::abs(s.magnitude - 0.3) < 0.1;
  }));
}

TEST(SkyIndex, FindsTheSameAsLookingAtAll) {
  SkyRandom random(3);
  std::vector<Vector3d> directions;
  for (int i = 0; i < 3000; ++i) {
    const double dec = std::asin(random.uniform(-1, 1)) / rad_per_deg;
    directions.push_back(direction_of(random.uniform(0, 360), dec));
  }
  directions.push_back({0, 0, 1});
  const SkyIndex index(directions, 0.03);
  for (const Vector3d& middle : {direction_of(0, 0), direction_of(359.99, 40), direction_of(180, -30),
                                 direction_of(77, 89.5), direction_of(200, -90), direction_of(180.001, 85)}) {
    for (const double radius : {0.01, 0.1, 0.5}) {
      std::vector<int> seen(directions.size(), 0);
      index.near(middle, radius, [&](std::size_t i, double) { ++seen[i]; });
      for (std::size_t i = 0; i < directions.size(); ++i)
        EXPECT_EQ(seen[i], (directions[i] - middle).norm() <= 2 * std::sin(radius / 2) ? 1 : 0);
    }
  }
}

TEST(PlateSolver, SolvesFieldsOfEveryWidthAllOverTheSky) {
  SkyRandom random(2026);
  int solved = 0;
  int looked = 0;
  for (int k = 0; k < 60; ++k) {
    const View view{random.uniform(0, 360), std::asin(random.uniform(-1, 1)) / rad_per_deg,
                    random.uniform(0, 360), random.uniform(6, 15), k % 3 == 0};
    const std::vector<Star> stars = view.stars(random);
    if (stars.size() < 10) continue;
    ++looked;
    const auto found = solver().solve(stars, view.width, view.height, {});
    if (!found) continue;
    ++solved;
    const Attitude& a = found->attitude;
    EXPECT_LT(arcsec_between(direction_of(a.ra_deg, a.dec_deg), direction_of(view.ra_deg, view.dec_deg)), 15);
    EXPECT_LT(std::abs(std::remainder(a.roll_deg - view.roll_deg, 360)), 0.05);
    EXPECT_NEAR(a.scale_arcsec_px * view.focal_px(), 3600 / rad_per_deg, 300);
    EXPECT_NEAR(a.field_deg, view.field_deg, 0.01);
    EXPECT_EQ(a.mirrored, view.mirrored);
  }
  EXPECT_GT(looked, 50);
  EXPECT_GE(solved, looked * 95 / 100);
}

TEST(PlateSolver, SolvesAnyFieldOfViewBehindALensWithDistortion) {
  SkyRandom random(60);
  int solved = 0;
  int looked = 0;
  constexpr int frames = testing_support::slow ? 10 : 40;
  for (int k = 0; k < frames; ++k) {
    View view{random.uniform(0, 360), std::asin(random.uniform(-1, 1)) / rad_per_deg, random.uniform(0, 360),
              2 * std::pow(30, random.uniform()), k % 3 == 0};
    view.distortion = random.uniform(-0.05, 0.05);
    // About as many stars in every frame.
    view.faintest = std::min(10.5, random.uniform(10.5, 11.5) - 1.8 * std::log(view.field_deg / 2));
    const std::vector<Star> stars = view.stars(random);
    if (stars.size() < 13) continue;
    ++looked;
    const auto found = any_field().solve(stars, view.width, view.height, {});
    if (!found) continue;
    ++solved;
    const Attitude& a = found->attitude;
    EXPECT_LT(arcsec_between(direction_of(a.ra_deg, a.dec_deg), direction_of(view.ra_deg, view.dec_deg)),
              a.scale_arcsec_px / 2)
        << view.field_deg;
    EXPECT_LT(a.rms_px, 0.3) << view.field_deg;
    EXPECT_NEAR(a.lens.k1 + a.lens.k2, -view.distortion, 0.012) << view.field_deg;
  }
  EXPECT_GT(looked, frames * 3 / 4);
  EXPECT_GE(solved, looked * 97 / 100);
}

TEST(PlateSolver, GivesTheLensWithWhichEveryStarIsWhereTheCatalogueSays) {
  SkyRandom random(61);
  View view{83, 0, 45, 40};
  view.distortion = -0.05;
  view.faintest = 6;
  view.false_share = 0;
  const std::vector<Star> stars = view.stars(random);
  const auto found = solver().solve(stars, view.width, view.height, {});
  ASSERT_TRUE(found);
  EXPECT_GT(found->matches.size(), stars.size() * 85 / 100);  // not those close to a brighter one
  for (const double x : {-950.0, -300.0, 0.0, 700.0}) {
    const Eigen::Vector2d pixel(x, x / 2);
    EXPECT_LT((found->camera.pixel(found->camera.direction(pixel)) - pixel).norm(), 1e-3);
  }
}

TEST(PlateSolver, SolvesFieldsAtThePolesAndAcrossZeroHours) {
  SkyRandom random(7);
  for (const auto& [ra, dec] : {std::pair(10.0, 89.5), std::pair(200.0, -89.9), std::pair(0.001, 5.0)}) {
    const View view{ra, dec, 123, 12};
    const auto found = solver().solve(view.stars(random), view.width, view.height, {});
    ASSERT_TRUE(found) << ra << ", " << dec;
    const Attitude& a = found->attitude;
    EXPECT_LT(arcsec_between(direction_of(a.ra_deg, a.dec_deg), direction_of(ra, dec)), 15);
  }
}

TEST(PlateSolver, SaysNothingOfStarsThatAreNoSky) {
  SkyRandom random(99);
  const View view{};
  for (int k = 0; k < (testing_support::slow ? 5 : 20); ++k)
    EXPECT_FALSE(solver().solve(view.anywhere(random, 15 + 12 * k), view.width, view.height, {})) << k;
}

TEST(PlateSolver, SaysNothingOfManyPlacesInACoarseWideFrame) {
  // A place of a few pixels has a star of the catalogue nearly everywhere.
  SkyRandom random(19);
  const std::vector<int> widths = testing_support::slow ? std::vector{160} : std::vector{160, 200, 240, 320};
  for (const int width : widths) {
    View view{0, 0, 0, 60};
    view.width = width;
    view.height = width * 9 / 16;
    for (const int count : {100, 200, 300}) {
      EXPECT_FALSE(any_field().solve(view.anywhere(random, count), view.width, view.height, {}))
          << width << " px, " << count << " places";
    }
  }
}

TEST(PlateSolver, LeavesOutStarsThatHaveNoPlaceOrNoLight) {
  SkyRandom random(20);
  const View view{80, 20, 30, 15};
  std::vector<Star> stars = view.stars(random);
  const double nan = std::nan("");
  const double infinite = std::numeric_limits<double>::infinity();
  stars.insert(stars.begin(), {nan, 100, 1e9, 20, 2});
  stars.insert(stars.begin(), {100, -infinite, 1e9, 20, 2});
  stars.insert(stars.begin(), {300, 200, nan, 20, 2});
  stars.insert(stars.begin(), {300, 250, infinite, 20, nan});
  const auto found = any_field().solve(stars, view.width, view.height, {});
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->attitude.field_deg, 15, 0.1);
  int near = 0;
  const SkyIndex index({direction_of(0, 0)}, 0.1);
  index.near(Vector3d(nan, 0, 0), 1, [&](std::size_t, double) { ++near; });
  EXPECT_EQ(near, 0);
}

TEST(PlateSolver, SaysNothingOfAFieldOutsideItsBounds) {
  SkyRandom random(4);
  const View view{83, 0, 45, 10};
  const auto stars = view.stars(random);
  EXPECT_TRUE(solver().solve(stars, view.width, view.height, {}));
  EXPECT_FALSE(solver().solve(stars, view.width, view.height, {12, 20}));
}

TEST(PlateSolver, NamesTheBoundOfTheFieldThatMadeItRefuse) {
  SkyRandom random(4);
  const View view{83, 0, 45, 10};
  const auto stars = view.stars(random);
  const auto why = [&](const std::vector<Star>& seen, const PlateOptions& options) {
    return any_field().why_unsolved(seen, view.width, view.height, options);
  };
  EXPECT_THAT(why(stars, {12, 20}), testing::HasSubstr("below min_field=12"));
  EXPECT_THAT(why(stars, {12, 20}), testing::ContainsRegex("fit a field of (9\\.9|10\\.0)"));
  EXPECT_THAT(why(stars, {4, 8}), testing::HasSubstr("above max_field=8"));
  EXPECT_THAT(
      why(view.anywhere(random, 40), {4, 20}),
      testing::HasSubstr("40 stars, no attitude with a field of 4 to 20 degrees (min_field, max_field)"));
}

TEST(PlateSolver, SaysNothingOfTooFewStarsOrStarsInOnePlace) {
  EXPECT_FALSE(solver().solve({}, 1920, 1080, {}));
  const std::vector<Star> same(50, Star{100, 100, 10, 10, 2});
  EXPECT_FALSE(solver().solve(same, 1920, 1080, {}));
  std::vector<Star> row;
  for (int i = 0; i < 50; ++i) row.push_back({20.0 * i, 300, 10.0 + i, 10, 2});
  EXPECT_FALSE(solver().solve(row, 1920, 1080, {}));
  EXPECT_FALSE(solver().solve(same, 1, 1, {}));
}

}  // namespace
}  // namespace srfs::image
