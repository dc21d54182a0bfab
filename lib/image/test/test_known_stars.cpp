// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/known_stars.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>

#include "image/method.hpp"
#include "lib/image/test/skies.hpp"
#include "tests/build_kind.hpp"

namespace srfs::image {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using hw_sim::SkyRandom;
using hw_sim::SkyStar;
using hw_sim::SkyStreak;

constexpr double radian_per_degree = std::numbers::pi / 180;
constexpr int view_width = 640;
constexpr int view_height = 480;
constexpr double seen_at_snr_6 = 9.3;  ///< magnitude at SNR 6

TEST(StarCatalogue, GivesTheStarsAroundADirectionWhereverItIs) {
  const std::vector<CatalogueStar> all = bright_stars(7);
  for (const Vector3d& middle :
       {direction_of(0.05, 20), direction_of(200, 89.9), direction_of(80, -88), direction_of(180, -40)}) {
    const auto found = stars_around(middle, 0.1, 7);
    const auto inside = std::count_if(all.begin(), all.end(), [&](const CatalogueStar& s) {
      return s.direction.dot(middle) >= std::cos(0.1);
    });
    EXPECT_EQ(static_cast<std::ptrdiff_t>(found.size()), inside);
    EXPECT_GT(inside, 5);
    EXPECT_TRUE(std::is_sorted(found.begin(), found.end(),
                               [](const auto& a, const auto& b) { return a.magnitude < b.magnitude; }));
  }
}

/// The densest part of the sky as a camera shows it, with what it is.
struct MilkyWay {
  hw_sim::SkyScene scene;
  CameraModel camera;
  std::vector<SkyStar> stars;
  std::vector<double> magnitudes;

  explicit MilkyWay(std::uint64_t seed) {
    SkyRandom random(seed);
    scene.width = view_width;
    scene.height = view_height;
    scene.seed = seed;
    scene.fwhm_px = random.uniform(1.6, 3);
    const Vector3d z = direction_of(random.uniform(70, 110), random.uniform(-10, 20));
    const Eigen::Matrix<double, 3, 2> axes = sky_axes(z);
    camera.to_sky << -axes.col(0), -axes.col(1), z;
    camera.focal_px = view_width / 2.0 / std::tan(8 * radian_per_degree);
    camera.corner_px = std::hypot(view_width, view_height) / 2;
    for (const CatalogueStar& s : stars_around(z, 0.2)) {
      const Vector2d p =
          camera.pixel(s.direction) + Vector2d((view_width - 1) / 2.0, (view_height - 1) / 2.0);
      if (p.x() < -5 || p.y() < -5 || p.x() > view_width + 5 || p.y() > view_height + 5) continue;
      const double snr = std::min(2000.0, 6 * std::pow(10, 0.4 * (seen_at_snr_6 - s.magnitude)));
      stars.push_back({p.x(), p.y(), hw_sim::flux_for_snr(scene, view_width / 2.0, view_height / 2.0, snr)});
      magnitudes.push_back(s.magnitude);
    }
  }

  /// As a solver that errs by nothing.
  [[nodiscard]] KnownStars known() const {
    PlateSolution solution{};
    solution.camera = camera;
    solution.fit.spread_px = 0.1;
    std::vector<Star> seen;
    for (std::size_t i = 0; i < stars.size(); ++i) {
      seen.push_back({stars[i].x, stars[i].y, stars[i].flux_e / scene.gain_e_per_adu, 10, scene.fwhm_px});
      solution.matches.push_back({i, static_cast<float>(magnitudes[i])});
    }
    return *KnownStars::of(solution, seen, view_width, view_height);
  }

  /// Light of the stars near a line, in ADU.
  [[nodiscard]] double light_on(const Streak& s) const {
    double light = 0;
    for (const SkyStar& star : stars) {
      if (distance_px(s, star.x, star.y) < 1.5) light += star.flux_e / scene.gain_e_per_adu;
    }
    return light;
  }
};

TEST(KnownStars, ExplainARowOfThemAndNoStreakThatPassesOverThem) {
  const MilkyWay sky(3);
  const KnownStars known = sky.known();
  FrameFindings findings;
  const CleanFrame empty = clean_frame(frame_of(sky.scene, sky.stars), findings);
  constexpr int enough = testing_support::slow ? 4 : 12;
  int rows = 0;
  int passes = 0;
  for (std::size_t i = 0; i < sky.stars.size() && rows < enough; ++i) {
    for (std::size_t k = i + 1; k < sky.stars.size() && rows < enough; ++k) {
      const SkyStar& a = sky.stars[i];
      const SkyStar& b = sky.stars[k];
      const double length = std::hypot(a.x - b.x, a.y - b.y);
      if (length < 15 || length > 40 || std::max(a.flux_e, b.flux_e) > 4 * std::min(a.flux_e, b.flux_e))
        continue;
      const auto inside = [](const SkyStar& s) {
        return s.x > 20 && s.y > 20 && s.x < view_width - 20 && s.y < view_height - 20;
      };
      if (!inside(a) || !inside(b)) continue;
      Streak row{a.x, a.y, b.x, b.y, 20, 0, empty.psf.fwhm_px()};
      row.flux = sky.light_on(row);
      EXPECT_TRUE(known.explain(row, empty)) << a.x << ' ' << a.y << ' ' << b.x << ' ' << b.y;
      ++rows;

      SkyStreak streak{a.x, a.y, b.x, b.y, 1};
      streak.flux_e = 15 / hw_sim::streak_snr(sky.scene, streak);
      FrameFindings more;
      const CleanFrame passed = clean_frame(frame_of(sky.scene, sky.stars, {streak}), more);
      Streak both = row;
      both.flux = std::min(1.5 * streak.flux_e, row.flux * sky.scene.gain_e_per_adu + streak.flux_e) /
                  sky.scene.gain_e_per_adu;
      passes += !known.explain(both, passed);
    }
  }
  EXPECT_EQ(rows, enough);
  EXPECT_GE(passes, rows - 1);
}

TEST(KnownStars, ExplainStarsThatAreInTheCatalogueAndNothingMuchBrighter) {
  const MilkyWay sky(4);
  const KnownStars known = sky.known();
  const SkyStar& s = sky.stars[sky.stars.size() / 2];
  const double flux = s.flux_e / sky.scene.gain_e_per_adu;
  EXPECT_TRUE(known.explain(Star{s.x + 0.3, s.y, flux, 10, 2}));
  EXPECT_FALSE(known.explain(Star{s.x, s.y, 10 * flux, 100, 2})) << "a bright object passes before a star";
  int by_chance = 0;
  SkyRandom random(1);
  for (int i = 0; i < 1000; ++i)
    by_chance +=
        known.explain(Star{random.uniform(0, view_width), random.uniform(0, view_height), flux, 10, 2});
  EXPECT_LT(by_chance, 120);
}

FrameFindings streaks_with(const Frame& frame, const std::vector<std::string>& given) {
  const MethodEntry* entry = *find_method("streak");
  return *entry->make(*Parameters::parse(entry->parameters, given))->process(frame);
}

bool has_streak(const std::vector<Streak>& found, const SkyStreak& t) {
  return std::any_of(found.begin(), found.end(), [&](const Streak& s) {
    return distance_px(s, (t.x1 + t.x2) / 2, (t.y1 + t.y2) / 2) < 3 &&
           s.length_px() > 0.5 * std::hypot(t.x2 - t.x1, t.y2 - t.y1);
  });
}

TEST(KnownStars, LoseNoStreakInTheDensestFields) {
  constexpr int skies = testing_support::slow ? 2 : 10;
  int found = 0;
  int solved = 0;
  for (std::uint64_t seed = 1; seed <= skies; ++seed) {
    const MilkyWay sky(seed);
    SkyRandom random(100 + seed);
    std::vector<SkyStreak> streaks;
    for (int i = 0; i < 5; ++i) {
      const double half = random.uniform(10, 60);
      const double angle = random.uniform(0, 2 * std::numbers::pi);
      const double x = random.uniform(80, view_width - 80);
      const double y = random.uniform(80, view_height - 80);
      SkyStreak s{x - half * std::cos(angle), y - half * std::sin(angle), x + half * std::cos(angle),
                  y + half * std::sin(angle), 1};
      s.flux_e = 8 * std::exp(random.uniform(0, 1.5)) / hw_sim::streak_snr(sky.scene, s);
      streaks.push_back(s);
    }
    const Frame frame = frame_of(sky.scene, sky.stars, streaks);
    const FrameFindings without = streaks_with(frame, {});
    const FrameFindings with = streaks_with(frame, {"sky=1"});
    solved += with.attitude.has_value();
    for (const SkyStreak& t : streaks) {
      found += has_streak(without.streaks, t);
      EXPECT_EQ(has_streak(without.streaks, t), has_streak(with.streaks, t))
          << "seed " << seed << ": " << t.x1 << ' ' << t.y1 << ' ' << t.x2 << ' ' << t.y2;
    }
  }
  EXPECT_GE(solved, skies * 8 / 10);
  EXPECT_GT(found, 2 * skies);
}

}  // namespace
}  // namespace srfs::image
