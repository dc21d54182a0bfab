// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/tracklet_linker.hpp"

#include <cmath>

#include <gmock/gmock.h>

#include "tests/sky/sky_frame.hpp"

namespace srfs::image {
namespace {

constexpr int width = 800;
constexpr int height = 600;

Star star(double x, double y, double snr = 20) {
  return {x, y, 100 * snr, snr, 2.5};
}

std::vector<Star> random_stars(int n, std::uint64_t seed) {
  hw_sim::SkyRandom random(seed);
  std::vector<Star> stars;
  for (int i = 0; i < n; ++i) {  // separate statements: C++ does not fix the evaluation order of arguments
    const double snr = 8 / (1.01 - random.uniform());
    const double y = random.uniform(0, height);
    const double x = random.uniform(0, width);
    stars.push_back(star(x, y, snr));
  }
  return stars;
}

std::vector<Star> seen(const std::vector<Star>& stars, const FrameTransform& transform, double error_px,
                       std::uint64_t seed) {
  hw_sim::SkyRandom random(seed);
  std::vector<Star> out;
  for (Star s : stars) {
    const auto [x, y] = transform.inverse(s.x, s.y);
    s.x = x + error_px * random.normal();
    s.y = y + error_px * random.normal();
    if (s.x > 0 && s.y > 0 && s.x < width && s.y < height) out.push_back(s);
  }
  return out;
}

FrameTransform turned(double shift_x, double shift_y, double degrees, double scale = 1) {
  const double angle = degrees * 3.14159265358979 / 180;
  return {shift_x, shift_y, scale * std::cos(angle), scale * std::sin(angle)};
}

class Registered : public testing::TestWithParam<FrameTransform> {};

TEST_P(Registered, FramesLieOnEachOtherWithinATenthOfAPixel) {
  const std::vector<Star> sky = random_stars(200, 3);
  std::vector<Star> frame = seen(sky, GetParam(), 0.1, 4);
  for (const Star& s : random_stars(60, 5)) frame.push_back(s);  // noise

  const auto found = register_stars(frame, sky, width, height);

  ASSERT_TRUE(found);
  for (const auto& [x, y] : {std::pair{0.0, 0.0}, {800.0, 0.0}, {400.0, 600.0}}) {
    const auto expected = GetParam()(x, y);
    const auto actual = found->to_reference(x, y);
    EXPECT_NEAR(actual.x, expected.x, 0.1);
    EXPECT_NEAR(actual.y, expected.y, 0.1);
  }
  EXPECT_NEAR(found->rms_px, 0.1, 0.05);
}

INSTANTIATE_TEST_SUITE_P(Transform, Registered,
                         testing::Values(FrameTransform{}, turned(3.3, -7.8, 0), turned(-250, 120, 0),
                                         turned(40, -30, 0.3), turned(30, 5, 2), turned(-5, 8, 0.1, 1.02)));

TEST(Registration, IsRefusedWhereNoStarsAreTheSame) {
  EXPECT_FALSE(register_stars(random_stars(150, 1), random_stars(150, 2), width, height));
  EXPECT_FALSE(register_stars({}, random_stars(150, 2), width, height));
  EXPECT_FALSE(register_stars({star(10, 10)}, {star(10, 10)}, width, height));
}

TEST(FrameTransform, HasAnInverse) {
  const FrameTransform t = turned(12, -7, 31, 1.3);
  const auto there = t(55, 66);
  const auto back = t.inverse(there.x, there.y);
  EXPECT_NEAR(back.x, 55, 1e-9);
  EXPECT_NEAR(back.y, 66, 1e-9);
}

/// Eight frames of the same stars while the sky drifts over the detector.
class Sequence : public testing::Test {
 protected:
  Sequence() {
    const std::vector<Star> sky = random_stars(150, 11);
    for (int k = 0; k < 8; ++k) {
      pointings_.push_back(turned(4.0 * k, -2.5 * k, 0.01 * k));
      FrameDetections frame;
      frame.stars = seen(sky, pointings_.back(), 0.1, 100 + static_cast<std::uint64_t>(k));
      frame.width = width;
      frame.height = height;
      frame.fwhm_px = 2.5;
      frames_.push_back(frame);
      add_noise(k, 40);
    }
  }

  void add_noise(int k, int n) {
    hw_sim::SkyRandom random(500 + static_cast<std::uint64_t>(k));
    for (int i = 0; i < n; ++i)
      at(k).stars.push_back(
          star(random.uniform(0, width), random.uniform(0, height), random.uniform(3.5, 4.5)));
  }

  FrameDetections& at(int k) { return frames_[static_cast<std::size_t>(k)]; }

  /// Place in frame @p k of an object that is at (x, y) in frame 0.
  [[nodiscard]] FrameTransform::Point place(int k, double x, double y, double vx, double vy) const {
    return pointings_[static_cast<std::size_t>(k)].inverse(x + k * vx, y + k * vy);
  }

  void add_mover(double x, double y, double vx, double vy, double snr, const std::vector<int>& in) {
    for (const int k : in) {
      const auto p = place(k, x, y, vx, vy);
      at(k).stars.push_back(star(p.x + 0.2, p.y - 0.2, snr));
    }
  }

  [[nodiscard]] SequenceFindings found() const { return link_tracklets(frames_, {}); }

  std::vector<FrameTransform> pointings_;
  std::vector<FrameDetections> frames_;
};

TEST_F(Sequence, OfStarsAloneHasNoTracklet) {
  EXPECT_TRUE(found().tracklets.empty());
}

TEST_F(Sequence, ShowsAFaintObjectThatMovesEvenlyThroughFiveFrames) {
  add_mover(200, 300, 6.5, -3.1, 4.6, {0, 2, 3, 5, 7});

  const SequenceFindings all = found();

  ASSERT_EQ(all.tracklets.size(), 1U);
  const Tracklet& t = all.tracklets[0];
  EXPECT_EQ(t.points.size(), 5U);
  EXPECT_NEAR(t.vx, 6.5, 0.2);
  EXPECT_NEAR(t.vy, -3.1, 0.2);
  EXPECT_NEAR(t.x0, 200, 1);
  EXPECT_NEAR(t.y0, 300, 1);
  EXPECT_NEAR(t.snr, 4.6 * std::sqrt(5), 0.01);
  EXPECT_FALSE(all.timed);
}

TEST_F(Sequence, DoesNotLinkFourPointsNorAnObjectThatTurns) {
  add_mover(200, 300, 6.5, -3.1, 6, {0, 2, 3, 5});
  for (int k = 0; k < 8; ++k) {
    const auto p = place(k, 500, 300 + 3 * (k - 3.5) * (k - 3.5), 7, 0);
    at(k).stars.push_back(star(p.x, p.y, 6));
  }
  EXPECT_TRUE(found().tracklets.empty());
}

TEST_F(Sequence, TakesAHotPixelForWhatStandsStillOnTheDetector) {
  for (int k = 0; k < 8; ++k) at(k).stars.push_back(star(333.2, 222.1, 9));
  EXPECT_TRUE(found().tracklets.empty());
}

TEST_F(Sequence, TakesForAStarWhatTheCatalogueHasThoughItMovesAmongTheFrames) {
  add_mover(200, 300, 6.5, -3.1, 8, {0, 1, 2, 3, 4, 5, 6, 7});
  ASSERT_EQ(found().tracklets.size(), 1U);
  for (int k = 0; k < 8; ++k) {
    at(k).is_known_star.assign(at(k).stars.size(), false);
    at(k).is_known_star.back() = true;
  }

  const SequenceFindings all = found();

  EXPECT_TRUE(all.tracklets.empty());
  EXPECT_THAT(all.notes, testing::ElementsAre(testing::HasSubstr("8 detections")));
}

TEST_F(Sequence, TakesAStreakThatOtherFramesShowAsStarsForStars) {
  const auto one = place(3, 400, 300, 0, 0);
  at(3).streaks.push_back({one.x, one.y, one.x + 12, one.y + 2, 15, 3000, 2.5});
  for (const int k : {0, 1, 2, 4, 5, 6, 7}) {
    const auto a = place(k, 402, 300.3, 0, 0);
    const auto b = place(k, 410, 301.7, 0, 0);
    at(k).stars.push_back(star(a.x, a.y, 12));
    at(k).stars.push_back(star(b.x, b.y, 12));
  }
  const auto real = place(5, 600, 100, 0, 0);
  at(5).streaks.push_back({real.x, real.y, real.x + 12, real.y + 2, 15, 3000, 2.5});

  const SequenceFindings all = found();

  EXPECT_TRUE(all.streaks[3].empty());
  EXPECT_EQ(all.streaks[5].size(), 1U);
}

TEST_F(Sequence, LinksStreaksThatLieAlongTheirMotion) {
  for (int k = 0; k < 8; ++k) {
    const auto a = place(k, 195, 300, 24, 10);
    const auto b = place(k, 207, 305, 24, 10);
    at(k).streaks.push_back({a.x, a.y, b.x, b.y, 15, 3000, 2.5});
    const auto c = place(k, 600, 195, -20, 0);  // across its motion
    const auto d = place(k, 600, 205, -20, 0);
    at(k).streaks.push_back({c.x, c.y, d.x, d.y, 15, 3000, 2.5});
  }

  const SequenceFindings all = found();

  ASSERT_EQ(all.tracklets.size(), 1U);
  EXPECT_NEAR(all.tracklets[0].vx, 24, 0.2);
  EXPECT_TRUE(all.tracklets[0].points[0].streak.has_value());
}

TEST_F(Sequence, HasAShortStreakOnceThoughItIsSeenAsTwoStarsInSomeFrames) {
  for (int k = 0; k < 8; ++k) {
    const auto a = place(k, 192, 300, 24, 10);
    const auto b = place(k, 208, 306.7, 24, 10);
    at(k).stars.push_back(star(b.x, b.y, 11));
    if (k % 2 == 0) {
      at(k).streaks.push_back({a.x, a.y, b.x, b.y, 15, 3000, 2.5});
    } else {
      at(k).stars.push_back(star(a.x, a.y, 10));
    }
  }

  EXPECT_EQ(found().tracklets.size(), 1U);
}

TEST_F(Sequence, HasTwoObjectsThatFlyBesideOneAnother) {
  add_mover(200, 300, 6.5, -3.1, 8, {0, 1, 2, 3, 4, 5, 6, 7});
  add_mover(206, 313, 6.5, -3.1, 7, {0, 1, 2, 3, 4, 5, 6, 7});

  EXPECT_EQ(found().tracklets.size(), 2U);
}

TEST_F(Sequence, GivesVelocitiesPerSecondWhereAllFramesHaveTheirTime) {
  add_mover(200, 300, 6.5, -3.1, 8, {0, 1, 2, 3, 4, 5, 6, 7});
  for (int k = 0; k < 8; ++k) at(k).time_s = 1e9 + 0.5 * k;

  const SequenceFindings all = found();

  ASSERT_EQ(all.tracklets.size(), 1U);
  EXPECT_TRUE(all.timed);
  EXPECT_NEAR(all.tracklets[0].vx, 13, 0.3);
}

TEST_F(Sequence, LeavesOutAFrameOfAnotherSkyAndSaysSo) {
  at(4).stars = random_stars(150, 99);
  add_mover(200, 300, 6.5, -3.1, 8, {0, 1, 2, 3, 5, 6, 7});

  const SequenceFindings all = found();

  EXPECT_FALSE(all.registrations[4].registered);
  EXPECT_THAT(all.notes, testing::ElementsAre(testing::HasSubstr("frame 4")));
  EXPECT_EQ(all.tracklets.size(), 1U);
}

TEST(LinkTracklets, OfNoFramesOneOrEmptyOnesFindsNothing) {
  EXPECT_TRUE(link_tracklets({}, {}).tracklets.empty());
  EXPECT_TRUE(link_tracklets(std::vector<FrameDetections>(1), {}).tracklets.empty());
  EXPECT_TRUE(link_tracklets(std::vector<FrameDetections>(9), {}).tracklets.empty());
}

}  // namespace
}  // namespace srfs::image
