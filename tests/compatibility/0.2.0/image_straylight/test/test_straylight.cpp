// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "straylight.hpp"

#include <functional>

#include <gtest/gtest.h>

namespace srfs {
namespace {

Octets frame(std::size_t width, std::size_t height,
             const std::function<std::uint16_t(std::size_t x, std::size_t y)>& value) {
  Octets pixels;
  for (std::size_t y = 0; y < height; ++y) {
    for (std::size_t x = 0; x < width; ++x) {
      const std::uint16_t v = value(x, y);
      pixels.push_back(static_cast<std::uint8_t>(v & 0xFF));
      pixels.push_back(static_cast<std::uint8_t>(v >> 8));
    }
  }
  return pixels;
}

TEST(Straylight, StarsDoNotRaiseTheSky) {
  const Octets pixels = frame(64, 48, [](std::size_t x, std::size_t y) -> std::uint16_t {
    return x % 9 == 0 && y % 7 == 0 ? 60000 : 300;
  });

  const auto found = measure_straylight(pixels, 64, 48);

  ASSERT_TRUE(found);
  EXPECT_EQ(found->sky_adu, 300);
  EXPECT_EQ(found->gradient_adu, 0);
  EXPECT_EQ(found->saturated_fraction, 0);
}

TEST(Straylight, AGlowFromOneSideIsAGradient) {
  const auto found = measure_straylight(
      frame(160, 32, [](std::size_t x, std::size_t) { return static_cast<std::uint16_t>(100 + 10 * x); }),
      160, 32);

  ASSERT_TRUE(found);
  EXPECT_NEAR(found->sky_adu, 100 + 10 * 80, 10);
  EXPECT_NEAR(found->gradient_adu, 10 * 150, 20);  // from the middle of the first block to that of the last
}

TEST(Straylight, SaturatedPixelsAreCounted) {
  const auto found = measure_straylight(
      frame(16, 16,
            [](std::size_t, std::size_t y) { return static_cast<std::uint16_t>(y < 4 ? 65535 : 10); }),
      16, 16);

  ASSERT_TRUE(found);
  EXPECT_FLOAT_EQ(found->saturated_fraction, 0.25F);
}

TEST(Straylight, AFrameThatIsNotWhatItsHeadSaysIsRefused) {
  const Octets pixels(16 * 16 * 2);
  EXPECT_TRUE(measure_straylight(pixels, 16, 16));
  EXPECT_FALSE(measure_straylight(pixels, 16, 17));
  EXPECT_FALSE(measure_straylight(pixels, 8, 32)) << "too narrow for its blocks";
  EXPECT_FALSE(measure_straylight(pixels, std::size_t{1} << 32, std::size_t{1} << 32))
      << "the product overflows";
  EXPECT_FALSE(measure_straylight({}, 0, 0));
}

TEST(BrightSky, TellsEachChangeOnceWithHysteresis) {
  using Change = BrightSky::Change;
  BrightSky sky;
  EXPECT_EQ(sky.on_sky(900, 1000), Change::none);
  EXPECT_EQ(sky.on_sky(1001, 1000), Change::bright);
  EXPECT_EQ(sky.on_sky(1500, 1000), Change::none);
  EXPECT_EQ(sky.on_sky(950, 1000), Change::none);
  EXPECT_TRUE(sky.is_bright());
  EXPECT_EQ(sky.on_sky(899, 1000), Change::dark);
  EXPECT_EQ(sky.on_sky(899, 1000), Change::none);
}

}  // namespace
}  // namespace srfs
