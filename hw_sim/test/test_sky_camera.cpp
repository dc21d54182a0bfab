// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/sky_camera.hpp"

#include <algorithm>
#include <cmath>

#include <gtest/gtest.h>

#include "image/star_catalogue.hpp"

namespace srfs::sim {
namespace {

SkyCameraSettings small() {
  SkyCameraSettings settings;
  settings.width = 480;
  settings.height = 360;
  settings.field_deg = 8;
  settings.hot_pixels = 0;
  return settings;
}

/// Orion's belt.
const FixedPointing orion{.ra_deg = 84.05, .dec_deg = -1.2, .roll_deg = 30, .drift_arcsec_s = 0};

/// Sum of the light above the frame's level in the pixels around (x, y).
double light(const image::Grid<std::uint16_t>& pixels, double x, double y, int radius) {
  std::vector<std::uint16_t> sorted(pixels.cells().begin(), pixels.cells().end());
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2),
                   sorted.end());
  const double level = sorted[sorted.size() / 2];
  double sum = 0;
  for (int j = -radius; j <= radius; ++j) {
    for (int i = -radius; i <= radius; ++i) {
      const int px = static_cast<int>(std::lround(x)) + i;
      const int py = static_cast<int>(std::lround(y)) + j;
      if (pixels.contains(px, py)) sum += pixels.at(px, py) - level;
    }
  }
  return sum;
}

TEST(SkyCamera, ShowsTheCataloguesStarsWhereTheTruthSays) {
  SkyCamera camera(small());
  const SkyPicture picture = camera.expose(pose_of(orion, 0), 0, 0.02, 0);
  EXPECT_NEAR(picture.truth.ra_deg, 84.05, 1e-9);
  EXPECT_NEAR(picture.truth.dec_deg, -1.2, 1e-9);
  EXPECT_NEAR(picture.truth.roll_deg, 30, 1e-9);
  ASSERT_GT(picture.truth.stars.size(), 20U);
  EXPECT_TRUE(std::is_sorted(picture.truth.stars.begin(), picture.truth.stars.end(),
                             [](const auto& a, const auto& b) { return a.flux_e > b.flux_e; }));
  int checked = 0;
  int as_bright = 0;  // a neighbour may add light to some stars
  for (const auto& star : picture.truth.stars) {
    // Use only stars that are neither saturated, faint nor at the edge.
    if (star.flux_e > 8000 || star.flux_e < 1500) continue;
    if (star.x < 20 || star.y < 20 || star.x > 459 || star.y > 339) continue;
    ++checked;
    const double adu = star.flux_e / 4;
    if (std::abs(light(picture.pixels, star.x, star.y, 5) - adu) < 0.15 * adu + 60) ++as_bright;
  }
  EXPECT_GT(checked, 4);
  EXPECT_GE(2 * as_bright, checked);
}

TEST(SkyCamera, IsSetUpLikeTheSky) {
  // With north up, east is left: a greater right ascension means a smaller x.
  SkyCamera camera(small());
  const SkyPicture picture = camera.expose(pose_of({.ra_deg = 84.05, .dec_deg = -1.2}, 0), 0, 0.02, 0);
  // Alnitak (85.19, -1.943) is the eastern and lower end of the belt, Mintaka (83.002, -0.299) the western.
  const double scale_deg = picture.truth.scale_arcsec_px / 3600;
  const auto near = [&](double ra, double dec) {
    const double x = 239.5 - (ra - 84.05) / scale_deg;
    const double y = 179.5 - (dec + 1.2) / scale_deg;
    return std::any_of(picture.truth.stars.begin(), picture.truth.stars.begin() + 3,
                       [&](const auto& star) { return std::hypot(star.x - x, star.y - y) < 3; });
  };
  EXPECT_TRUE(near(85.19, -1.943));
  EXPECT_TRUE(near(83.002, -0.299));
}

TEST(SkyCamera, DrawsStarsOutWhenItMoves) {
  FixedPointing drifting = orion;
  drifting.drift_arcsec_s = 3600;  // one degree: 60 px
  SkyCamera camera(small());
  const SkyPicture still = camera.expose(pose_of(orion, 0), 0, 0.5, 0);
  const SkyPicture moved = camera.expose(pose_of(drifting, 0), 1, 0.5, 0);
  const CameraPose later = pose_of(drifting, 10);
  EXPECT_NEAR(later.attitude.angularDistance(pose_of(orion, 0).attitude), 10 * 3.14159265 / 180, 1e-6);
  const auto peak = [](const SkyPicture& p) {
    return *std::max_element(p.pixels.cells().begin(), p.pixels.cells().end());
  };
  EXPECT_EQ(peak(still), 4095);
  const auto saturated = [](const SkyPicture& p) {
    return std::count(p.pixels.cells().begin(), p.pixels.cells().end(), 4095);
  };
  EXPECT_NE(saturated(still), saturated(moved));
  EXPECT_NEAR(moved.truth.stars.at(0).x - still.truth.stars.at(0).x, 0, 16) << "the middle of its trail";
}

TEST(SkyCamera, LetsAnObjectCrossTheMiddleOnRequest) {
  SkyCameraSettings settings = small();
  settings.debris = {.interval_s = 0, .rate_deg_s = 2, .magnitude = 2};
  SkyCamera camera(settings);
  EXPECT_TRUE(camera.expose(pose_of(orion, 0), 0, 0.5, 0).truth.streaks.empty());
  camera.pass_next();
  const SkyPicture picture = camera.expose(pose_of(orion, 0), 1, 0.5, 0);
  ASSERT_EQ(picture.truth.streaks.size(), 1U);
  const auto& streak = picture.truth.streaks[0];
  EXPECT_NEAR(std::hypot(streak.x2 - streak.x1, streak.y2 - streak.y1), 60, 3) << "two degrees a second";
  EXPECT_GT(light(picture.pixels, (streak.x1 + streak.x2) / 2, (streak.y1 + streak.y2) / 2, 4), 3000);
  // The streak continues in the next frame and finally leaves the field.
  const SkyPicture next = camera.expose(pose_of(orion, 0), 1.5, 0.5, 0);
  ASSERT_EQ(next.truth.streaks.size(), 1U);
  EXPECT_NEAR(next.truth.streaks[0].x1, streak.x2, 0.01);
  EXPECT_NEAR(next.truth.streaks[0].y1, streak.y2, 0.01);
  EXPECT_TRUE(camera.expose(pose_of(orion, 0), 30, 0.5, 0).truth.streaks.empty());
}

TEST(SkyCamera, SendsObjectsAtTheIntervalAndTheSameOnesEveryTime) {
  SkyCameraSettings settings = small();
  settings.debris = {.interval_s = 5, .rate_deg_s = 4, .magnitude = 3};
  const auto run = [&] {
    SkyCamera camera(settings);
    std::vector<std::size_t> streaks;
    std::uint64_t sum = 0;
    for (int i = 0; i < 40; ++i) {
      const SkyPicture picture = camera.expose(pose_of(orion, 0), i, 0.1, 0);
      streaks.push_back(picture.truth.streaks.size());
      for (const std::uint16_t v : picture.pixels.cells()) sum += v;
    }
    return std::pair(streaks, sum);
  };
  const auto first = run();
  EXPECT_GT(std::count_if(first.first.begin(), first.first.end(), [](std::size_t n) { return n > 0; }), 4);
  EXPECT_EQ(first, run());
}

TEST(SkyCamera, ACoveredLensLeavesWhatTheDetectorAdds) {
  SkyCameraSettings settings = small();
  settings.warm_share = 0.02;
  settings.warm_e_s = 20'000;
  settings.background_e_s = 2000;
  SkyCamera camera(settings);
  camera.set_covered(true);
  const SkyPicture dark = camera.expose(pose_of(orion, 0), 0, 0.1, 0);
  camera.set_covered(false);
  const SkyPicture sky = camera.expose(pose_of(orion, 0), 1, 0.1, 0);

  EXPECT_TRUE(dark.truth.stars.empty());
  EXPECT_FALSE(sky.truth.stars.empty());
  int warm = 0;
  double added = 0;
  for (std::size_t i = 0; i < dark.pixels.size(); ++i) {
    if (dark.pixels.cells()[i] < 64 + 300) continue;
    ++warm;
    added += sky.pixels.cells()[i] - static_cast<double>(dark.pixels.cells()[i]);
  }
  const double share = 0.02 * std::exp(-300 / 500.0);
  EXPECT_NEAR(warm, share * static_cast<double>(dark.pixels.size()), 250);
  EXPECT_NEAR(added / warm, 2000 * 0.1 / 4, 10) << "the sky's 200 e, on the same pixels";
}

TEST(SkyCamera, HasTheNoiseOfItsSensor) {
  SkyCameraSettings settings = small();
  settings.background_e_s = 2000;
  settings.prnu = 0;
  SkyCamera camera(settings);
  // The galactic pole: few stars.
  const SkyPicture picture = camera.expose(pose_of({.ra_deg = 192.9, .dec_deg = 27.1}, 0), 0, 0.5, 12);
  std::vector<std::uint16_t> sorted(picture.pixels.cells().begin(), picture.pixels.cells().end());
  std::sort(sorted.begin(), sorted.end());
  const auto at = [&](double share) {
    return sorted[static_cast<std::size_t>(share * static_cast<double>(sorted.size()))];
  };
  const double adu_per_e = 3.981 / 4;
  EXPECT_NEAR(at(0.5), 64 + 1000 * adu_per_e, 3);
  EXPECT_NEAR((at(0.84) - at(0.16)) / 2.0, std::sqrt(1000 + 36) * adu_per_e, 2);
}

}  // namespace
}  // namespace srfs::sim
