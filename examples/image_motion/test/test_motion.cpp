// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "motion.hpp"

#include <cmath>
#include <random>

#include <gtest/gtest.h>

namespace srfs {
namespace {

constexpr std::uint32_t width = 320;
constexpr std::uint32_t height = 240;

struct Star {
  double x, y, peak;
};

/// A sky of 300 ADU with noise of 10 ADU, which shows these stars.
class Sky {
 public:
  explicit Sky(unsigned seed) : random_(seed) {
    std::uniform_real_distribution<double> x(-60, width + 60);
    std::uniform_real_distribution<double> y(-60, height + 60);
    std::uniform_real_distribution<double> decades(1.8, 4);
    for (int i = 0; i < 150; ++i) stars_.push_back({x(random_), y(random_), std::pow(10, decades(random_))});
  }
  /// After the camera turned by (dx, dy); with an object at (x, y) where peak is above 0.
  Octets frame(double dx, double dy, Star object = {0, 0, 0}) {
    std::vector<double> pixels(static_cast<std::size_t>(width) * height, 300);
    for (const Star& star : stars_) add(pixels, {star.x + dx, star.y + dy, star.peak});
    add(pixels, object);
    std::normal_distribution<double> noise(0, 10);
    Octets octets;
    for (const double value : pixels) {
      const auto adu = static_cast<std::uint16_t>(std::clamp(value + noise(random_), 0.0, 65535.0));
      octets.push_back(static_cast<std::uint8_t>(adu & 0xFFU));
      octets.push_back(static_cast<std::uint8_t>(adu >> 8U));
    }
    return octets;
  }

 private:
  static void add(std::vector<double>& pixels, const Star& star) {
    const auto x0 = static_cast<int>(std::lround(star.x));
    const auto y0 = static_cast<int>(std::lround(star.y));
    for (int y = std::max(0, y0 - 6); y <= std::min<int>(height - 1, y0 + 6); ++y)
      for (int x = std::max(0, x0 - 6); x <= std::min<int>(width - 1, x0 + 6); ++x)
        pixels[static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x)] +=
            star.peak * std::exp(-(std::pow(x - star.x, 2) + std::pow(y - star.y, 2)) / (2 * 1.1 * 1.1));
  }

  std::mt19937 random_;
  std::vector<Star> stars_;
};

TEST(MotionFinder, FindsWhatMovesAgainstTheStarsWhileTheCameraTurns) {
  std::uint32_t found = 0;
  for (const unsigned seed : {1U, 2U, 3U, 4U}) {
    Sky sky(seed);
    MotionFinder finder;
    for (int i = 0; i < 6; ++i) {
      const Star object{60 + 9.0 * i, 50 + 6.0 * i, 400};
      const auto motion = finder.on_frame(sky.frame(1.3 * i, -0.7 * i, object), width, height);
      ASSERT_TRUE(motion);
      ASSERT_EQ(motion->compared, i > 0);
      if (i == 0) continue;
      EXPECT_NEAR(motion->shift_x_px, 1.3, 0.15);
      EXPECT_NEAR(motion->shift_y_px, -0.7, 0.15);
      EXPECT_LE(motion->movers, 1U) << "seed " << seed << ", frame " << i;
      if (motion->movers == 0) continue;
      ++found;
      EXPECT_NEAR(motion->x_px, object.x, 1);
      EXPECT_NEAR(motion->y_px, object.y, 1);
      EXPECT_GT(motion->snr, 8);
    }
  }
  EXPECT_GE(found, 18U) << "of 20; in front of a bright star it cannot be told from the star";
}

TEST(MotionFinder, NothingMovesInAnEmptySky) {
  for (const unsigned seed : {5U, 6U, 7U, 8U}) {
    Sky sky(seed);
    MotionFinder finder;
    std::uint32_t movers = 0;
    for (int i = 0; i < 6; ++i)
      movers += finder.on_frame(sky.frame(2.4 * i, 1.1 * i), width, height).value_or(Motion{}).movers;
    EXPECT_EQ(movers, 0U) << "seed " << seed;
  }
}

TEST(MotionFinder, ACameraThatTurnedAwayBeginsAnew) {
  Sky here(1);
  Sky there(2);
  MotionFinder finder;
  (void)finder.on_frame(here.frame(0, 0), width, height);

  const auto motion = finder.on_frame(there.frame(0, 0), width, height);

  ASSERT_TRUE(motion);
  EXPECT_FALSE(motion->compared);
  EXPECT_TRUE(finder.on_frame(there.frame(1, 0), width, height)->compared);
}

TEST(MotionFinder, AFrameThatIsNotWhatItsHeadSaysIsRefused) {
  Sky sky(1);
  const Octets frame = sky.frame(0, 0);
  MotionFinder finder;
  EXPECT_FALSE(finder.on_frame(OctetView(frame).first(frame.size() - 1), width, height));
  EXPECT_FALSE(finder.on_frame(frame, width + 1, height));
  EXPECT_FALSE(finder.on_frame({}, 0, 0));
  EXPECT_FALSE(finder.on_frame({}, 0x80000000U, 2));
  EXPECT_FALSE(finder.on_frame(OctetView(frame).first(2U * 31 * 240), 31, 240)) << "too narrow";
}

}  // namespace
}  // namespace srfs
