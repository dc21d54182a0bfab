// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/photograph/drawing.hpp"

#include <limits>

#include <gtest/gtest.h>

namespace srfs::image {
namespace {

bool is_coloured(const Colours& picture, int x, int y) {
  return picture[0].at(x, y) != picture[1].at(x, y) || picture[1].at(x, y) != picture[2].at(x, y);
}

TEST(Drawing, MarksWhatWasFoundAndLeavesTheStreakItselfVisible) {
  const Plane sky(200, 100, 300.0F);
  Overlay overlay;
  overlay.stars.push_back({30, 30, 1000, 50, 2});
  overlay.streaks.push_back({60, 50, 120, 50, 30, 5000, 2});
  overlay.tracks.push_back({{150, 20}, {180, 80}});

  const Colours picture = draw(sky, overlay, 200);

  EXPECT_TRUE(is_coloured(picture, 35, 30));
  EXPECT_TRUE(is_coloured(picture, 90, 44));
  EXPECT_FALSE(is_coloured(picture, 90, 50));
  EXPECT_TRUE(is_coloured(picture, 165, 50));
  EXPECT_FALSE(is_coloured(picture, 10, 90));
}

TEST(Drawing, OfASmallerPictureStaysInPlaceAndNothingIsDrawnOutside) {
  const Plane sky(400, 200, 300.0F);
  Overlay overlay;
  overlay.streaks.push_back({120, 100, 240, 100, 30, 5000, 2});
  overlay.streaks.push_back({-1e12, 0, 1e12, std::numeric_limits<double>::infinity(), 30, 5000, 2});
  overlay.stars.push_back({-3, 205, 1000, 50, 2});

  const Colours picture = draw(sky, overlay, 200);

  EXPECT_EQ(picture[0].width(), 200);
  EXPECT_TRUE(is_coloured(picture, 90, 44));
  EXPECT_FALSE(is_coloured(picture, 90, 50));
}

}  // namespace
}  // namespace srfs::image
