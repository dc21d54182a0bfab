// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/streak_finder.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <gmock/gmock.h>

#include "lib/image/test/skies.hpp"

namespace srfs::image {
namespace {

using hw_sim::SkyScene;
using hw_sim::SkyStar;
using hw_sim::SkyStreak;

std::vector<Streak> streaks_in(const Frame& frame) {
  FrameFindings findings;
  const CleanFrame clean = clean_frame(frame, findings);
  StarField field = find_stars(clean, {.close_ones = false});
  return find_streaks(clean, field, {});
}

SkyStreak with_snr(const SkyScene& scene, SkyStreak streak, double snr) {
  streak.flux_e = 1;
  streak.flux_e = snr / hw_sim::streak_snr(scene, streak);
  return streak;
}

double end_error(const Streak& found, const SkyStreak& truth) {
  const double same = std::max(std::hypot(found.x1 - truth.x1, found.y1 - truth.y1),
                               std::hypot(found.x2 - truth.x2, found.y2 - truth.y2));
  const double turned = std::max(std::hypot(found.x1 - truth.x2, found.y1 - truth.y2),
                                 std::hypot(found.x2 - truth.x1, found.y2 - truth.y1));
  return std::min(same, turned);
}

/// The stars without those whose light touches the streak.
std::vector<SkyStar> beside(std::vector<SkyStar> stars, const SkyStreak& l) {
  const double length = std::hypot(l.x2 - l.x1, l.y2 - l.y1);
  std::erase_if(stars, [&](const SkyStar& s) {
    const double t = std::clamp(
        ((s.x - l.x1) * (l.x2 - l.x1) + (s.y - l.y1) * (l.y2 - l.y1)) / (length * length), 0.0, 1.0);
    return std::hypot(s.x - l.x1 - t * (l.x2 - l.x1), s.y - l.y1 - t * (l.y2 - l.y1)) < 12;
  });
  return stars;
}

class StreaksInEveryDirection : public testing::TestWithParam<int> {};

TEST_P(StreaksInEveryDirection, AreFoundWithTheirEnds) {
  const double angle = GetParam() * 3.14159265 / 180;
  SkyScene scene = small_scene(2.2, 30 + static_cast<std::uint64_t>(GetParam()));
  scene.gradient = 0.3;
  const SkyStreak truth = with_snr(scene,
                                   {160.3 - 40 * std::cos(angle), 120.6 - 40 * std::sin(angle),
                                    160.3 + 40 * std::cos(angle), 120.6 + 40 * std::sin(angle), 0},
                                   30);

  const std::vector<Streak> found =
      streaks_in(frame_of(scene, beside(lattice(scene, 50, 57.9), truth), {truth}));

  ASSERT_EQ(found.size(), 1U);
  EXPECT_LT(end_error(found[0], truth), 3);
  EXPECT_NEAR(found[0].snr, 30, 8);
  EXPECT_NEAR(found[0].flux, truth.flux_e, 0.3 * truth.flux_e);
}

INSTANTIATE_TEST_SUITE_P(Degrees, StreaksInEveryDirection, testing::Values(0, 20, 45, 70, 90, 115, 135, 160));

TEST(StreakFinder, FindsNoneAmongStarsHotPixelsAndParticleTracks) {
  SkyScene scene = small_scene(2.5, 77);
  const std::vector<SkyStar> stars = lattice(scene, 60, 31.7);
  scene.hot_pixels = 100;
  scene.cosmic_rays = 8;

  EXPECT_TRUE(streaks_in(frame_of(scene, stars)).empty());
}

TEST(StreakFinder, FindsNoneOnACurvedBackground) {
  SkyScene scene = small_scene(2.5, 78);
  scene.background_e = 3000;
  scene.curvature = 0.9;
  scene.gradient = 0.5;

  EXPECT_TRUE(streaks_in(frame_of(scene, lattice(scene, 60, 45.7))).empty());
}

/// Trees, a building or the Earth: light and dark bars in all directions below a horizon.
TEST(StreakFinder, FindsNoneInATexturedForegroundButThatInTheSkyAboveIt) {
  SkyScene scene = small_scene(2.2, 80);
  const SkyStreak truth = with_snr(scene, {60, 40, 140, 70, 0}, 40);
  Frame frame = frame_of(scene, beside(lattice(scene, 50, 57.9), truth), {truth});
  hw_sim::SkyRandom random(5);
  for (int bar = 0; bar < 1500; ++bar) {
    const double x = random.uniform(0, 320);
    const double y = random.uniform(150, 240);
    const double angle = random.uniform(0, 3.14159);
    const auto light = static_cast<float>(random.uniform(-1000, 3600));
    const double length = random.uniform(10, 60);
    for (double t = 0; t < length; t += 0.5) {
      const int i = static_cast<int>(x + t * std::cos(angle));
      const int j = static_cast<int>(y + t * std::sin(angle));
      if (frame.pixels.contains(i, j) && j > 145) frame.pixels.at(i, j) += light;
    }
  }

  const std::vector<Streak> found = streaks_in(frame);

  ASSERT_EQ(found.size(), 1U);
  EXPECT_LT(end_error(found[0], truth), 4);
}

/// Like JPEG, rounds the cosine coefficients of blocks of 8 x 8 pixels.
void code_in_blocks(Plane& pixels, double step) {
  constexpr int side = 8;
  std::array<std::array<double, side>, side> cosine;
  for (std::size_t k = 0; k < side; ++k) {
    for (std::size_t i = 0; i < side; ++i)
      cosine[k][i] = (k == 0 ? std::sqrt(0.5) : 1) / 2 *
                     std::cos((2 * static_cast<double>(i) + 1) * static_cast<double>(k) * 3.14159265 / 16);
  }
  for (int y0 = 0; y0 + side <= pixels.height(); y0 += side) {
    for (int x0 = 0; x0 + side <= pixels.width(); x0 += side) {
      Grid<double> coded(side, side);
      for (int k = 0; k < side * side; ++k) {
        double sum = 0;
        for (int i = 0; i < side * side; ++i)
          sum += cosine[static_cast<std::size_t>(k / side)][static_cast<std::size_t>(i / side)] *
                 cosine[static_cast<std::size_t>(k % side)][static_cast<std::size_t>(i % side)] *
                 double(pixels.at(x0 + i % side, y0 + i / side));
        coded.at(k % side, k / side) = step * std::round(sum / step);
      }
      for (int i = 0; i < side * side; ++i) {
        double sum = 0;
        for (int k = 0; k < side * side; ++k)
          sum += cosine[static_cast<std::size_t>(k / side)][static_cast<std::size_t>(i / side)] *
                 cosine[static_cast<std::size_t>(k % side)][static_cast<std::size_t>(i % side)] *
                 coded.at(k % side, k / side);
        pixels.at(x0 + i % side, y0 + i / side) = static_cast<float>(std::round(sum));
      }
    }
  }
}

TEST(StreakFinder, TakesTheBlocksOfAStronglyCodedFrameForNoStreaks) {
  SkyScene scene = small_scene(3, 44);
  Frame frame = frame_of(scene, lattice(scene, 60, 57.9));
  const double noise = std::hypot(std::sqrt(scene.background_e), scene.read_noise_e) / scene.gain_e_per_adu;
  code_in_blocks(frame.pixels, 5 * noise);
  frame.step = 1;

  EXPECT_TRUE(streaks_in(frame).empty());
}

/// Rays come from struts in front of a mirror, from a lens, or from an overexposed column.
TEST(StreakFinder, TakesTheRaysOfABrightStarForNoStreaks) {
  for (const double turned : {0.0, 0.4}) {
    SkyScene scene = small_scene(2.2, 81);
    std::vector<SkyStar> stars = lattice(scene, 50, 57.9);
    stars.push_back({163.3, 118.6, hw_sim::flux_for_snr(scene, 163.3, 118.6, 3000)});
    Frame frame = frame_of(scene, stars);
    const auto ray = [](double along, double across) {
      return 600 * std::exp(-std::abs(along) / 12 - across * across / 2);
    };
    add_light(frame, 163.3, 118.6, turned, [&](double dx, double dy) { return ray(dx, dy) + ray(dy, dx); });
    EXPECT_TRUE(streaks_in(frame).empty()) << turned;
  }
}

TEST(StreakFinder, TakesTheRaysOfAGlaringStarForNoStreaksThoughTheyHardlyFallOff) {
  SkyScene scene = small_scene(2.2, 86);
  std::vector<SkyStar> stars = lattice(scene, 50, 57.9);
  stars.push_back({163.3, 118.6, hw_sim::flux_for_snr(scene, 163.3, 118.6, 3000)});
  Frame frame = frame_of(scene, stars);
  add_light(frame, 163.3, 118.6, std::atan2(0.6, 0.8), [](double along, double across) {
    return std::abs(along) < 90 ? 80 * std::exp(-std::abs(along) / 130 - across * across / 2) : 0;
  });
  EXPECT_TRUE(streaks_in(frame).empty());
}

/// The middle of the ray is hidden, or the ray fades as little as a streak.
TEST(StreakFinder, TakesTheRaysOfASaturatedStarForNoStreaks) {
  for (const double length : {9.0, 25.0, 60.0}) {
    for (const double fall : {0.3, 1e6}) {
      SkyScene scene = small_scene(2.2, 90);
      std::vector<SkyStar> stars = lattice(scene, 50, 57.9);
      stars.push_back({163.3, 118.6, 1e6});
      Frame frame = frame_of(scene, stars);
      add_light(frame, 163.3, 118.6, 0.7, [&](double along, double across) {
        return std::abs(along) < length
                   ? 120 * std::exp(-std::abs(along) / length / fall - across * across / 2)
                   : 0;
      });
      saturate(frame, 4095);
      EXPECT_TRUE(streaks_in(frame).empty()) << length << " " << fall;
    }
  }
}

TEST(StreakFinder, TakesRaysThatBeginBesideASaturatedStarForNoStreaks) {
  for (const double angle : {0.7, 2.1, 4.0}) {
    SkyScene scene = small_scene(2.2, 100);
    const SkyStreak ray{163.3, 118.6, 163.3 + 70 * std::cos(angle), 118.6 + 70 * std::sin(angle), 0};
    std::vector<SkyStar> stars = beside(lattice(scene, 50, 57.9), ray);
    stars.push_back({163.3, 118.6, 1e6});
    Frame frame = frame_of(scene, stars);
    add_light(frame, 163.3, 118.6, angle, [](double along, double across) {
      return along > 14 && along < 60 ? 400 * std::exp(-along / 20 - across * across / 2) : 0;
    });
    saturate(frame, 4095);
    for (const Streak& s : streaks_in(frame))
      ADD_FAILURE() << angle << ": " << s.x1 << ", " << s.y1 << " to " << s.x2 << ", " << s.y2 << " SNR "
                    << s.snr;
  }
}

TEST(StreakFinder, FindsStreaksThatAreJustSaturated) {
  for (const double angle : {0.2, 0.4, 0.8, 1.2, 2.0, 2.7}) {
    SkyScene scene = small_scene(2.2, 97);
    const SkyStreak truth{160.3 - 60 * std::cos(angle), 120.6 - 60 * std::sin(angle),
                          160.3 + 60 * std::cos(angle), 120.6 + 60 * std::sin(angle), 0};
    std::vector<SkyStar> stars = beside(lattice(scene, 50, 57.9), truth);
    stars.push_back({40.3, 200.2, 3e5});
    Frame frame = frame_of(scene, beside(stars, truth));
    const double sigma = std::hypot(2.2, 0.68) / 2.3548;
    add_light(frame, 160.3, 120.6, angle, [&](double along, double across) {
      return std::abs(along) < 60 ? 4400 * std::exp(-across * across / (2 * sigma * sigma)) : 0;
    });
    saturate(frame, 4095);

    const std::vector<Streak> found = streaks_in(frame);

    ASSERT_EQ(found.size(), 1U) << angle;
    EXPECT_LT(end_error(found[0], truth), 5) << angle;
  }
}

/// A rotating object may fade; only a saturated star throws light that far.
TEST(StreakFinder, FindsFadingStreaksThatPointToAStar) {
  SkyScene scene = small_scene(2.2, 98);
  const SkyStreak truth{60, 120, 160, 120, 0};
  std::vector<SkyStar> stars = beside(lattice(scene, 50, 57.9), truth);
  stars.push_back({220.3, 120.2, hw_sim::flux_for_snr(scene, 220.3, 120.2, 280)});
  Frame frame = frame_of(scene, stars);
  const double sigma = std::hypot(2.2, 0.68) / 2.3548;
  add_light(frame, 110, 120, 0, [&](double along, double across) {
    return std::abs(along) < 50 ? (28 + 0.2 * along) * std::exp(-across * across / (2 * sigma * sigma)) : 0;
  });

  EXPECT_EQ(streaks_in(frame).size(), 1U);
}

TEST(StreakFinder, FindsStreaksBesideSaturatedStars) {
  SkyScene scene = small_scene(2.2, 91);
  scene.moffat_beta = 2.5;
  const SkyStreak truth = with_snr(scene, {60.3, 70.2, 230.4, 170.8, 0}, 25);
  std::vector<SkyStar> stars = beside(lattice(scene, 50, 57.9), truth);
  for (const double along : {0.1, 0.35, 0.6, 0.9}) {
    const double x = truth.x1 + along * (truth.x2 - truth.x1) + 7;
    const double y = truth.y1 + along * (truth.y2 - truth.y1) - 12;
    stars.push_back({x, y, 1e6});
  }
  Frame frame = frame_of(scene, stars, {truth});
  saturate(frame, 4095);

  const std::vector<Streak> found = streaks_in(frame);

  ASSERT_EQ(found.size(), 1U);
  EXPECT_LT(end_error(found[0], truth), 6);
}

/// A fast object passes in a moment, while air and mount blur the stars.
TEST(StreakFinder, FindsStreaksThatAreSharperThanTheStars) {
  for (const double angle : {0.3, 0.8, 1.9}) {
    SkyScene scene = small_scene(3.2, 89);
    const SkyStreak truth{160.3 - 60 * std::cos(angle), 120.6 - 60 * std::sin(angle),
                          160.3 + 60 * std::cos(angle), 120.6 + 60 * std::sin(angle), 0};
    Frame frame = frame_of(scene, beside(lattice(scene, 60, 57.9), truth));
    const double sigma = 0.82 * std::hypot(3.2, 0.68) / 2.3548;
    add_light(frame, 160.3, 120.6, angle, [&](double along, double across) {
      return std::abs(along) < 60 ? 60 * std::exp(-across * across / (2 * sigma * sigma)) : 0;
    });
    const std::vector<Streak> found = streaks_in(frame);

    ASSERT_EQ(found.size(), 1U) << angle;
    EXPECT_LT(end_error(found[0], truth), 4) << angle;
  }
}

TEST(StreakFinder, TakesTheGlowOfOutermostRowsAndColumnsForNoStreaks) {
  SkyScene scene = small_scene(2.2, 87);
  Frame frame = frame_of(scene, lattice(scene, 50, 57.9));
  for (int y = 0; y < scene.height; ++y) {
    for (int x = 0; x < scene.width; ++x) {
      const bool at_a_corner = x < 60 || y > scene.height - 60;
      const double edge = std::min(x + 0.02 * y, scene.height - 1 - y + 0.01 * x);
      if (!at_a_corner || edge > 6) continue;
      frame.pixels.at(x, y) += static_cast<float>(40 * std::exp(-edge * edge / 2));
    }
  }
  EXPECT_TRUE(streaks_in(frame).empty());
}

TEST(StreakFinder, EndsWhatLeavesTheFrameAtItsEdge) {
  for (const double snr : {12.0, 60.0}) {
    SkyScene scene = small_scene(2.2, 88);
    SkyStreak truth = with_snr(scene, {200.3, 150.2, 400, 240, 0}, snr);
    const std::vector<Streak> found =
        streaks_in(frame_of(scene, beside(lattice(scene, 50, 57.9), truth), {truth}));

    ASSERT_EQ(found.size(), 1U) << snr;
    const Streak& s = found[0];
    EXPECT_GE(std::min({s.x1, s.x2, s.y1, s.y2}), -0.5);
    EXPECT_LE(std::max(s.x1, s.x2), scene.width - 0.5);
    EXPECT_GT(std::max(s.x1, s.x2), scene.width - 15);
    EXPECT_LE(std::max(s.y1, s.y2), scene.height - 0.5);
  }
}

TEST(StreakFinder, FindsNoneInAGalaxySeenFromTheSide) {
  for (const double sigma : {3.0, 5.0, 8.0}) {
    SkyScene scene = small_scene(2.2, 82);
    Frame frame = frame_of(scene, lattice(scene, 50, 57.9));
    add_light(frame, 160, 120, std::atan2(0.6, 0.8), [&](double along, double across) {
      return 400 * std::exp(-along * along / (2 * 35 * 35) - across * across / (2 * sigma * sigma));
    });
    EXPECT_TRUE(streaks_in(frame).empty()) << sigma;
  }
}

TEST(StreakFinder, TakesStarsInARowForNoStreak) {
  for (const double spacing : {3.5, 4.5, 6.0}) {
    SkyScene scene = small_scene(2.2, 83);
    std::vector<SkyStar> stars = lattice(scene, 50, 57.9);
    for (int k = 0; k < 6; ++k) {
      const double x = 140 + k * spacing * 0.94;
      const double y = 95 + k * spacing * 0.34;
      stars.push_back({x, y, hw_sim::flux_for_snr(scene, x, y, 60)});
    }
    EXPECT_TRUE(streaks_in(frame_of(scene, stars)).empty()) << spacing;
  }
}

TEST(StreakFinder, FindsStreaksOfAnyBrightnessBesideStars) {
  for (const double snr : {15.0, 100.0, 600.0, 2000.0}) {
    SkyScene scene = small_scene(2.2, 84);
    const SkyStreak truth = with_snr(scene, {60.3, 60.2, 219.7, 140.4, 0}, snr);

    const std::vector<Streak> found =
        streaks_in(frame_of(scene, beside(lattice(scene, 50, 57.9), truth), {truth}));

    ASSERT_EQ(found.size(), 1U) << snr;
    EXPECT_LT(end_error(found[0], truth), 8) << snr;
  }
}

TEST(StreakFinder, TakesColumnsOfASensorForNoStreaks) {
  SkyScene scene = small_scene(2.2, 91);
  scene.width = 1280, scene.height = 1024;
  scene.column_pattern_adu = 20;  // 1.3 times the noise
  const SkyStreak truth = with_snr(scene, {120, 90, 200, 130, 0}, 30);

  const std::vector<Streak> found =
      streaks_in(frame_of(scene, beside(lattice(scene, 50, 57.9), truth), {truth}));

  ASSERT_EQ(found.size(), 1U);
  EXPECT_LT(end_error(found[0], truth), 4);
}

/// A lens or a mask leaves the corners dark.
TEST(StreakFinder, FindsThemBesideBlackCorners) {
  SkyScene scene = small_scene(2.2, 85);
  const SkyStreak truth = with_snr(scene, {120, 90, 200, 130, 0}, 40);
  Frame frame = frame_of(scene, beside(lattice(scene, 50, 57.9), truth), {truth});
  for (int y = 0; y < scene.height; ++y) {
    for (int x = 0; x < scene.width; ++x) {
      if (std::hypot(x - 160, y - 120) > 115) frame.pixels.at(x, y) = 300;
    }
  }

  const std::vector<Streak> found = streaks_in(frame);

  ASSERT_EQ(found.size(), 1U);
  EXPECT_LT(end_error(found[0], truth), 3);
}

TEST(StreakFinder, MakesOneOfPiecesThatAStarSeparates) {
  SkyScene scene = small_scene(2.2, 79);
  const SkyStreak truth = with_snr(scene, {60, 60, 220, 140, 0}, 60);
  std::vector<SkyStar> stars = beside(lattice(scene, 50, 57.9), truth);
  stars.push_back({140, 100, hw_sim::flux_for_snr(scene, 140, 100, 400)});

  const std::vector<Streak> found = streaks_in(frame_of(scene, stars, {truth}));

  ASSERT_EQ(found.size(), 1U);
  EXPECT_LT(end_error(found[0], truth), 9);  // 5 % of its length
}

using hw_sim::LensTrail;

/// The only streak found in a frame of a finder camera with this trail and stars.
void expect_trail(const LensTrail& t, std::uint64_t seed, double length_share) {
  hw_sim::LensScene scene = finder_scene(2, seed);
  scene.width = 480, scene.height = 360;
  const std::vector<SkyStar> stars = lattice(scene, 8, 200);

  const std::vector<Streak> found = streaks_in(frame_of(scene, stars, {t}));

  ASSERT_EQ(found.size(), 1U) << t.fwhm_px << " px, gaps " << t.gaps;
  const double length = std::hypot(t.x2 - t.x1, t.y2 - t.y1);
  EXPECT_NEAR(found[0].length_px(), length, length_share * length) << t.fwhm_px << " px, gaps " << t.gaps;
  EXPECT_NEAR(found[0].width_px, std::hypot(t.fwhm_px, 0.7), 0.3 * t.fwhm_px + 0.3) << "gaps " << t.gaps;
}

TEST(StreakFinder, FindsTrailsWiderAndSharperThanStars) {
  for (const double fwhm : {0.8, 1.2, 3.0, 5.0, 8.0})
    expect_trail({90, 80, 330, 241, 16 * 10 * fwhm, fwhm}, 301, 0.1);
}

TEST(StreakFinder, FindsRaggedTrailsAndThoseWithGaps) {
  for (const double gaps : {0.0, 0.15, 0.35})
    expect_trail({90, 240, 400, 71, 16 * 12 * 3.0, 3, 0.4, 0.4, gaps, 25}, 302, 0.1);
}

TEST(StreakFinder, FindsTrailsFromEdgeToEdge) {
  expect_trail({0, 31, 479, 322, 20 * 10 * 4.0, 4}, 303, 0.05);
  expect_trail({0, 202, 479, 180, 20 * 10 * 2.4, 2.4}, 304, 0.05);
}

/// A bright star behind its end, a little beside its line, is no piece of it.
TEST(StreakFinder, EndsATrailWhereItEndsThoughAStarFollows) {
  const LensTrail t{180, 120, 276, 178, 16 * 4.5 * 4.8, 4.8, 0.15};
  const double length = std::hypot(t.x2 - t.x1, t.y2 - t.y1);
  int wrong = 0;
  for (const double after : {8.0, 11.0, 14.0, 17.0, 20.0, 24.0}) {
    for (const double snr : {300.0, 1500.0}) {
      hw_sim::LensScene scene = finder_scene(2.8, 308);
      scene.width = 480, scene.height = 360;
      std::vector<SkyStar> stars = lattice(scene, 8, 200);
      stars.push_back({t.x2 + after * (t.x2 - t.x1) / length - 2, t.y2 + after * (t.y2 - t.y1) / length + 2,
                       snr * hw_sim::flux_for_snr(scene, 1)});

      const std::vector<Streak> found = streaks_in(frame_of(scene, stars, {t}));

      wrong += found.size() != 1 || std::abs(found[0].length_px() - length) > 0.1 * length;
    }
  }
  EXPECT_LE(wrong, 1);
}

/// Its light is as wide as that of stars, but has not their wings: the brighter it is, the more that shows.
TEST(StreakFinder, FindsStreaksWithoutTheStarsWingsTheBrighterTheSurer) {
  for (const double height : {10.0, 40.0, 160.0}) {
    SkyScene scene = small_scene(2.6, 305);
    scene.moffat_beta = 2.5;
    const SkyStreak truth{70.3, 60.2, 239.7, 170.4, 0};
    Frame frame = frame_of(scene, beside(lattice(scene, 60, 57.9), truth));
    const double angle = std::atan2(truth.y2 - truth.y1, truth.x2 - truth.x1);
    const double half = std::hypot(truth.x2 - truth.x1, truth.y2 - truth.y1) / 2;
    add_light(frame, 155, 115.3, angle, [&](double along, double across) {
      return std::abs(along) < half ? 15.6 * height * std::exp(-across * across / (2 * 0.95 * 0.95)) : 0;
    });

    const std::vector<Streak> found = streaks_in(frame);

    ASSERT_EQ(found.size(), 1U) << height;
    EXPECT_LT(end_error(found[0], truth), 8) << height;
  }
}

TEST(StreakFinder, FindsAGlaringStreakAmongFewStars) {
  const hw_sim::LensScene scene = finder_scene(2, 306);
  const std::vector<SkyStar> stars{{60, 170, 3000}, {250, 40, 2500}};

  const std::vector<Streak> found =
      streaks_in(frame_of(scene, stars, {{40, 50, 270, 205, 16 * 80 * 2.0, 2}}));

  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].length_px(), 277, 14);
}

TEST(StreakFinder, FindsNothingWhereThereIsNothing) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 200}, {5, 3}, {150, 130}}) {
    Frame frame;
    frame.pixels = Plane(width, height, 12.0F);
    EXPECT_TRUE(streaks_in(frame).empty());
  }
}

}  // namespace
}  // namespace srfs::image
