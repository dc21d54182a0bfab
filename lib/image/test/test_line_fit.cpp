// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/line_fit.hpp"

#include <random>
#include <set>

#include <gtest/gtest.h>

#include "tests/build_kind.hpp"
#include "tests/sky/sky_frame.hpp"

namespace srfs::image {
namespace {

/// White noise with sigma 1, and a line in it.
class LineInNoise : public testing::Test {
 protected:
  static constexpr double fwhm = 2.6;

  LineInNoise() : plane_(200, 160), mask_(200, 160) {
    hw_sim::SkyRandom random(17);
    for (float& v : plane_.cells()) v = static_cast<float>(random.normal());
  }

  void add(const Line& line) {
    const double sigma = fwhm / 2.3548;
    for_pixels_along(line, 200, 160, 6 * sigma, 6 * sigma, [&](int x, int y, double along, double across) {
      const auto below = [&](double v) { return 0.5 * (1 + std::erf(v / sigma / std::sqrt(2.0))); };
      plane_.at(x, y) += static_cast<float>(line.height * (below(along) - below(along - line.length())) *
                                            std::exp(-across * across / (2 * sigma * sigma)));
    });
  }

  [[nodiscard]] LineFitter fitter() const { return {plane_, mask_, Psf::round_gaussian(fwhm), {0, 0.05F}}; }

  Plane plane_;
  Grid<std::uint8_t> mask_;
};

double distance(double x1, double y1, double x2, double y2) {
  return std::hypot(x1 - x2, y1 - y2);
}

TEST_F(LineInNoise, SettlesOnTheWholeLineFromAPieceOfItAndBesideIt) {
  const Line truth{40.3, 50.2, 130.7, 95.4, 2.5};
  add(truth);
  Line line{70, 67, 90, 73.5};

  const auto significance = fitter().settle(line, 5, 0);

  ASSERT_TRUE(significance);
  EXPECT_LT(distance(line.x1, line.y1, truth.x1, truth.y1), 2);
  EXPECT_LT(distance(line.x2, line.y2, truth.x2, truth.y2), 2);
  EXPECT_NEAR(line.height, truth.height, 0.4);
  EXPECT_NEAR(line.scale, 1, 0.15);
  EXPECT_NEAR(*significance, 2.5 * std::sqrt(101 * 1.1 * 1.7725), 5);
}

TEST_F(LineInNoise, KeepsItsEndsWhereAMaskHidesTheMiddle) {
  const Line truth{40.3, 50.2, 130.7, 95.4, 2.5};
  add(truth);
  for (int y = 60; y < 85; ++y) {
    for (int x = 75; x < 95; ++x) mask_.at(x, y) = 1;
  }
  Line line{45, 52.5, 70, 65};

  ASSERT_TRUE(fitter().settle(line, 5, 0));

  EXPECT_LT(distance(line.x1, line.y1, truth.x1, truth.y1), 2);
  EXPECT_LT(distance(line.x2, line.y2, truth.x2, truth.y2), 2);
}

TEST_F(LineInNoise, DoesNotReachForAStarBeyondItsEnd) {
  const Line truth{40.3, 80, 100.7, 80, 1.2};
  add(truth);
  for (int y = 76; y <= 84; ++y) {
    for (int x = 116; x <= 124; ++x)
      plane_.at(x, y) +=
          static_cast<float>(30 * std::exp(-((x - 120) * (x - 120) + (y - 80) * (y - 80)) / 2.4));
  }
  Line line{60, 80, 80, 80};

  ASSERT_TRUE(fitter().settle(line, 5, 0));

  EXPECT_LT(line.x2, 108);
}

TEST_F(LineInNoise, LeavesEndsThatAreClearAsTheyAre) {
  const Line truth{40.3, 50.2, 130.7, 95.4, 2.5};
  add(truth);
  LineFitter fitter = this->fitter();
  Line line = truth;
  ASSERT_TRUE(fitter.settle(line, 5, 0));
  const Line before = line;

  fitter.weigh_ends(line, 1);

  EXPECT_LT(distance(line.x1, line.y1, before.x1, before.y1), 0.01);
  EXPECT_LT(distance(line.x2, line.y2, before.x2, before.y2), 0.01);
}

TEST_F(LineInNoise, PutsEndsThatAreLostInTheNoiseAmongAllPlacesTheyMayHave) {
  const Line truth{30.3, 50.2, 150.7, 95.4, 0.55};
  add(truth);
  Line line = truth;

  fitter().weigh_ends(line, 1);

  EXPECT_LT(distance(line.x1, line.y1, truth.x1, truth.y1), 8);
  EXPECT_LT(distance(line.x2, line.y2, truth.x2, truth.y2), 8);
  EXPECT_GT(distance(line.x1, line.y1, truth.x1, truth.y1), 0.01);
}

TEST_F(LineInNoise, ShowsWhatIsBesideIt) {
  add({40, 80, 140, 80, 3});
  EXPECT_EQ(fitter().heights_beside({40, 80, 140, 80, 3}).size(), 6U);
  for (const double height : fitter().heights_beside({40, 80, 140, 80, 3})) EXPECT_LT(std::abs(height), 0.4);
}

TEST(PixelsAlong, AreAllWithinTheRectangleAroundALineAndNoOthers) {
  for (const Line& line : {Line{10, 10, 30, 10}, Line{10, 10, 10, 30}, Line{10, 12, 31, 25},
                           Line{33, 8, 12, 29}, Line{-5, -4, 8, 7}}) {
    const double length = line.length();
    Grid<int> seen(40, 40);
    for_pixels_along(line, 40, 40, 3.5, 2.5, [&](int x, int y, double along, double across) {
      ++seen.at(x, y);
      EXPECT_LE(std::abs(across), 3.5 + 1e-9);
      EXPECT_GE(along, -2.5 - 1e-9);
      EXPECT_LE(along, length + 2.5 + 1e-9);
    });
    for (int y = 0; y < 40; ++y) {
      for (int x = 0; x < 40; ++x) {
        const double ux = (line.x2 - line.x1) / length;
        const double uy = (line.y2 - line.y1) / length;
        const double along = (x - line.x1) * ux + (y - line.y1) * uy;
        const double across = (y - line.y1) * ux - (x - line.x1) * uy;
        const bool inside =
            std::abs(across) < 3.5 - 1e-9 && along > -2.5 + 1e-9 && along < length + 2.5 - 1e-9;
        if (inside) {
          EXPECT_EQ(seen.at(x, y), 1) << x << ", " << y;
        }
      }
    }
  }
}

TEST_F(LineInNoise, GivesUpALineShorterThanAskedFor) {
  add({80, 80, 84, 80, 20});
  Line line{70, 80, 90, 80};
  EXPECT_FALSE(fitter().settle(line, 5, 15));
  line = {70, 80, 90, 80};
  EXPECT_TRUE(fitter().settle(line, 5, 0));
}

TEST_F(LineInNoise, SeesWhetherThereIsLightNearby) {
  add({40.3, 50.2, 130.7, 95.4, 2.5});
  LineFitter fitter = this->fitter();
  EXPECT_GT(fitter.nearby_significance({60, 61, 100, 80.5}), 8);
  EXPECT_LT(fitter.nearby_significance({60, 120, 100, 100}), 4);
}

TEST_F(LineInNoise, CollectsEveryPixelNearALineOnceButTheHiddenOnes) {
  std::mt19937 random(5);  // NOLINT(bugprone-random-generator-seed): a failure must repeat
  std::uniform_real_distribution<double> place(-30, 190);
  for (auto& hidden : mask_.cells()) hidden = random() % 20 == 0;
  for (auto& v : plane_.cells()) v = static_cast<float>(random() % 10000);
  LineFitter fitter = this->fitter();
  for (int k = 0; k < (testing_support::slow ? 20 : 60); ++k) {
    Line line{place(random), place(random), place(random), place(random)};
    if (k % 5 == 0) line.y2 = line.y1;
    if (k % 7 == 0) line.x2 = line.x1;
    const double length = line.length();
    if (length < 1) continue;
    const double reach = 1 + k % 9;
    const double beyond = k % 4 * 3.0;
    const LinePixels& pixels = fitter.collect(line, reach, beyond);
    std::set<std::pair<int, int>> seen;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const int x = static_cast<int>(pixels.x[i]);
      const int y = static_cast<int>(pixels.y[i]);
      ASSERT_TRUE(plane_.contains(x, y));
      EXPECT_EQ(mask_.at(x, y), 0);
      EXPECT_EQ(pixels.light[i], plane_.at(x, y));
      EXPECT_TRUE(seen.emplace(x, y).second) << x << ' ' << y << " twice";
    }
    const double ux = (line.x2 - line.x1) / length;
    const double uy = (line.y2 - line.y1) / length;
    for (int y = 0; y < plane_.height(); ++y) {
      for (int x = 0; x < plane_.width(); ++x) {
        const double along = (x - line.x1) * ux + (y - line.y1) * uy;
        const double across = (y - line.y1) * ux - (x - line.x1) * uy;
        const double inside = std::min({reach - std::abs(across), along + beyond, length + beyond - along});
        if (std::abs(inside) < 1e-6) continue;  // on the border: both results are right
        ASSERT_EQ(seen.contains({x, y}), inside > 0 && mask_.at(x, y) == 0) << k << ": " << x << ' ' << y;
      }
    }
  }
}

}  // namespace
}  // namespace srfs::image
