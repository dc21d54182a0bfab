#include "image/registration.hpp"

#include <cmath>
#include <numbers>

#include <gmock/gmock.h>
#include <Eigen/Geometry>

#include "hw_sim/sky_frame.hpp"

namespace srfs::image {
namespace {

constexpr int width = 1920;
constexpr int height = 1080;
constexpr double degree = std::numbers::pi / 180;

/// A camera that turned: how wide its field is, about which angles.
struct Turn {
  double field_deg;
  double up_deg;      ///< about its horizontal axis
  double aside_deg;   ///< about its vertical axis
  double around_deg;  ///< about its line of sight
  friend void PrintTo(const Turn& t, std::ostream* out) {
    *out << t.field_deg << " degrees turned by " << t.up_deg << ", " << t.aside_deg << ", " << t.around_deg;
  }
};

/// Where a star of the frame after the turn was before.
FrameTransform::Point before(const Turn& turn, double x, double y) {
  const double focal_px = width / 2.0 / std::tan(turn.field_deg / 2 * degree);
  const Eigen::Vector3d there((x - width / 2.0) / focal_px, (y - height / 2.0) / focal_px, 1);
  const Eigen::Vector3d here = Eigen::AngleAxisd(turn.up_deg * degree, Eigen::Vector3d::UnitX()) *
                               Eigen::AngleAxisd(turn.aside_deg * degree, Eigen::Vector3d::UnitY()) *
                               Eigen::AngleAxisd(turn.around_deg * degree, Eigen::Vector3d::UnitZ()) * there;
  return {width / 2.0 + focal_px * here.x() / here.z(), height / 2.0 + focal_px * here.y() / here.z()};
}

bool is_inside(const FrameTransform::Point& p) {
  return p.x > 0 && p.y > 0 && p.x < width && p.y < height;
}

struct TwoFrames {
  std::vector<Star> frame;
  std::vector<Star> reference;
  std::vector<FrameTransform::Point> places;  ///< in the frame, of the stars that both have
};

/// Few bright and many faint stars, some of each frame's own, places off by @p error_px at SNR 10 and less by
/// brightness.
TwoFrames look(const Turn& turn, int stars, double error_px, std::uint64_t seed) {
  hw_sim::SkyRandom random(seed);
  TwoFrames two;
  const auto see = [&](const FrameTransform::Point& p, double snr) {
    const double error = std::hypot(error_px * std::min(1.0, 10 / snr), 0.03);
    const double flux = 100 * snr * (1 + 0.1 * random.normal());
    return Star{p.x + error * random.normal(), p.y + error * random.normal(), flux, snr, 2.5};
  };
  const auto anywhere = [&] {
    return FrameTransform::Point{random.uniform(0, width), random.uniform(0, height)};
  };
  for (int i = 0; i < stars; ++i) {
    const FrameTransform::Point place = anywhere();
    const FrameTransform::Point was = before(turn, place.x, place.y);
    const double snr = 8 / (1.01 - random.uniform());
    if (random.uniform() < 0.9) two.frame.push_back(see(place, snr));
    if (!is_inside(was)) continue;
    if (random.uniform() < 0.9) two.reference.push_back(see(was, snr));
    two.places.push_back(place);
  }
  for (int i = 0; i < stars / 5; ++i) {
    two.frame.push_back(see(anywhere(), 10));
    two.reference.push_back(see(anywhere(), 10));
  }
  return two;
}

/// Of the places, per axis.
double error_px(const FrameTransform& found, const Turn& turn,
                const std::vector<FrameTransform::Point>& places) {
  double squares = 0;
  for (const auto& p : places) {
    const auto is = found(p.x, p.y);
    const auto was = before(turn, p.x, p.y);
    squares += std::pow(is.x - was.x, 2) + std::pow(is.y - was.y, 2);
  }
  return std::sqrt(squares / (2 * static_cast<double>(places.size())));
}

class WideFieldThatTurns : public testing::TestWithParam<Turn> {};

TEST_P(WideFieldThatTurns, IsRegisteredWithinAFewHundredthsOfAPixelEverywhere) {
  for (const int stars : {200, 600, 3000}) {
    for (std::uint64_t seed = 1; seed <= 3; ++seed) {
      SCOPED_TRACE(testing::Message() << stars << " stars, seed " << seed);
      const TwoFrames two = look(GetParam(), stars, 0.15, seed);
      const auto found = register_stars(two.frame, two.reference, width, height);
      ASSERT_TRUE(found);
      EXPECT_LT(error_px(found->to_reference, GetParam(), two.places), stars < 600 ? 0.1 : 0.06);
      EXPECT_LT(found->rms_px, 0.2);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Turns, WideFieldThatTurns,
                         testing::Values(Turn{16, 0.3, 0.2, 0.1}, Turn{16, 2, -1, 1}, Turn{16, 0, 4, 0},
                                         Turn{30, 3, 3, 0.5}, Turn{30, -1, 6, 1.5}, Turn{50, 4, -6, 1},
                                         Turn{50, 0, 10, 0}, Turn{60, 8, 2, -0.5}));

TEST(NarrowFieldThatTurns, KeepsShiftTurnAndScale) {
  const Turn turn{2, 0.1, -0.3, 1};
  for (const int stars : {30, 300, 3000}) {
    const TwoFrames two = look(turn, stars, 0.15, 7);
    const auto found = register_stars(two.frame, two.reference, width, height);
    ASSERT_TRUE(found) << stars;
    EXPECT_FALSE(found->to_reference.is_projection()) << stars;
    EXPECT_LT(error_px(found->to_reference, turn, two.places), 0.1) << stars;
  }
}

TEST(ProjectionOfAFrame, IsNotMadeOfAFewStarsOrOfTheirErrors) {
  int projections = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    const Turn turn{4, 0.2, 0.4, 0.5};
    const TwoFrames two = look(turn, 40, 0.3, seed);
    const auto found = register_stars(two.frame, two.reference, width, height);
    ASSERT_TRUE(found) << seed;
    projections += found->to_reference.is_projection() ? 1 : 0;
    EXPECT_LT(error_px(found->to_reference, turn, two.places), 0.25) << seed;
  }
  EXPECT_EQ(projections, 0);

  const Turn wide{30, 0, 3, 0};
  const TwoFrames few = look(wide, 20, 0.15, 3);
  const auto found = register_stars(few.frame, few.reference, width, height);
  EXPECT_FALSE(found && found->to_reference.is_projection());
}

TEST(ProjectionOfAFrame, IsNotFoundBetweenDifferentSkies) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const TwoFrames one = look({30, 0, 3, 0}, 1500, 0.15, seed);
    const TwoFrames other = look({30, 0, 3, 0}, 1500, 0.15, seed + 100);
    EXPECT_FALSE(register_stars(one.frame, other.reference, width, height)) << seed;
  }
}

TEST(ProjectionOfAFrame, HasAnInverse) {
  const FrameTransform t{120, -45, 0.99, 0.05, 0.002, -0.003, 2e-5, -3e-5};
  for (const auto& [x, y] : {std::pair{0.0, 0.0}, {1920.0, 0.0}, {300.0, 1080.0}}) {
    const auto there = t(x, y);
    const auto back = t.inverse(there.x, there.y);
    EXPECT_NEAR(back.x, x, 1e-7);
    EXPECT_NEAR(back.y, y, 1e-7);
  }
}

}  // namespace
}  // namespace srfs::image
