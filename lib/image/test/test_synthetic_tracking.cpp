// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/synthetic_tracking.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <gmock/gmock.h>

#include "image/method.hpp"
#include "lib/image/test/skies.hpp"
#include "tests/build_kind.hpp"

namespace srfs::image {
namespace {

using hw_sim::SkyRandom;
using hw_sim::SkyStar;

constexpr int frames_of_sky = 12;

struct Object {
  double x, y, vx, vy;  ///< in frame 0, px per frame
  double snr;
};

/// Twelve frames of a sky that drifts, as seen by one detector.
class DriftingSky {
 public:
  explicit DriftingSky(std::uint64_t seed) : random_(seed) {
    for (int i = 0; i < 60; ++i) {
      const double x = random_.uniform(-60, 380);
      const double y = random_.uniform(-60, 300);
      stars_.push_back({x, y, flux(4 / (1.003 - random_.uniform()))});
    }
  }

  std::vector<Object> objects;

  /// @param order  of the frames, as they are given
  [[nodiscard]] SequenceFindings found(const std::vector<std::string>& given,
                                       const std::vector<int>& order = {}) {
    const MethodEntry* entry = *find_method("tracklet");
    const auto method = entry->make(*Parameters::parse(entry->parameters, given));
    for (int k = 0; k < frames_of_sky; ++k) {
      const auto processed = method->process(frame(order.empty() ? k : order[static_cast<std::size_t>(k)]));
      EXPECT_TRUE(processed);
    }
    return method->finish();
  }

  [[nodiscard]] static double drift_x(int k) { return 2.3 * k; }
  [[nodiscard]] static double drift_y(int k) { return -1.1 * k; }

 private:
  [[nodiscard]] static hw_sim::SkyScene scene() {
    hw_sim::SkyScene s = small_scene();
    s.hot_pixels = 20;
    s.cosmic_rays = 3;
    s.pattern_seed = 77;
    return s;
  }
  [[nodiscard]] static double flux(double snr) { return hw_sim::flux_for_snr(scene(), 160, 120, snr); }

  [[nodiscard]] Frame frame(int k) {
    hw_sim::SkyScene of = scene();
    of.seed = static_cast<std::uint64_t>(random_.uniform() * 1e15);
    std::vector<SkyStar> seen;
    for (const SkyStar& s : stars_) seen.push_back({s.x - drift_x(k), s.y - drift_y(k), s.flux_e});
    for (const Object& o : objects)
      seen.push_back({o.x + k * o.vx - drift_x(k), o.y + k * o.vy - drift_y(k), flux(o.snr)});
    return frame_of(of, seen);
  }

  SkyRandom random_;
  std::vector<SkyStar> stars_;
};

bool has_object(const SequenceFindings& found, const Object& o) {
  return std::any_of(found.tracklets.begin(), found.tracklets.end(), [&](const Tracklet& t) {
    return std::hypot(t.x0 - o.x, t.y0 - o.y) < 3 && std::hypot(t.vx - o.vx, t.vy - o.vy) < 0.4;
  });
}

TEST(SyntheticTracking, FindsWhatIsTooFaintForOneFrame) {
  int found = 0;
  int found_without = 0;
  int others = 0;
  constexpr int skies = testing_support::slow ? 1 : 5;
  for (std::uint64_t seed = 1; seed <= skies; ++seed) {
    DriftingSky sky(seed);
    SkyRandom random(seed);
    for (int i = 0; i < 3; ++i) {
      const double angle = random.uniform(0, 2 * std::numbers::pi);
      const double speed = random.uniform(1.5, 6);
      const double vx = speed * std::cos(angle);
      const double vy = speed * std::sin(angle);
      sky.objects.push_back({160 + random.uniform(-60, 60) - 5 * vx, 120 + random.uniform(-40, 40) - 5 * vy,
                             vx, vy, random.uniform(2.8, 3.3)});
    }
    const SequenceFindings all = sky.found({"faint=1"});
    const SequenceFindings usual = sky.found({"faint=0"});
    int real = 0;
    for (const Object& o : sky.objects) real += has_object(all, o), found_without += has_object(usual, o);
    found += real;
    others += static_cast<int>(all.tracklets.size()) - real;
  }
  EXPECT_GE(found, skies * 12 / 5) << "of " << 3 * skies;
  EXPECT_LE(others, 1);
  EXPECT_LE(found_without, skies * 9 / 5) << "they are not faint";
}

/// Linking wants the object in every frame: what is found is found by the sum of light.
const std::vector<std::string> by_light_alone{"faint=1", "hits=12"};

TEST(SyntheticTracking, FindsNothingWhereNothingMovesNorWhereNothingMovesEvenly) {
  for (std::uint64_t seed = 11; seed <= (testing_support::slow ? 11 : 13); ++seed) {
    DriftingSky sky(seed);
    EXPECT_TRUE(sky.found(by_light_alone).tracklets.empty());
    sky.objects.push_back({60, 60, 14, 7, 3.6});
    EXPECT_TRUE(sky.found(by_light_alone, {3, 9, 0, 7, 11, 4, 1, 10, 5, 8, 2, 6}).tracklets.empty());
  }
}

TEST(SyntheticTracking, GivesTheLightOfEachFrame) {
  for (const std::uint64_t seed : {2, 5}) {  // in the first a flaw of the detector shines faintly
    DriftingSky sky(seed);
    sky.objects.push_back({100, 90, 5, 2.5, 4});
    const SequenceFindings all = sky.found(by_light_alone);
    ASSERT_EQ(all.tracklets.size(), 1U);
    const Tracklet& t = all.tracklets[0];
    EXPECT_GE(t.points.size(), 7U);
    EXPECT_GT(t.snr, 8.5);
    for (const TrackPoint& p : t.points) {
      EXPECT_NEAR(p.x, 100 + 5 * p.frame - DriftingSky::drift_x(p.frame), 2.5);
      EXPECT_NEAR(p.y, 90 + 2.5 * p.frame - DriftingSky::drift_y(p.frame), 2.5);
      EXPECT_GT(p.flux, 0);
    }
  }
}

TEST(SyntheticTracking, OfFewFramesOrNoneFindsNothing) {
  EXPECT_TRUE(find_faint({}, {}, {}, {}).empty());
  SequenceFindings found;
  found.registrations.resize(12);
  found.streaks.resize(12);
  EXPECT_TRUE(find_faint(std::vector<FaintLight>(12), std::vector<double>(12), found, {}).empty());
}

}  // namespace
}  // namespace srfs::image
