// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/saturated_core.hpp"

#include <cmath>

#include <gmock/gmock.h>

#include "image/clean_frame.hpp"

namespace srfs::image {
namespace {

using Flaws = Grid<std::uint8_t>;

void fill_disc(Flaws& flaws, double x0, double y0, double radius) {
  for (int y = 0; y < flaws.height(); ++y) {
    for (int x = 0; x < flaws.width(); ++x) {
      if (std::hypot(x - x0, y - y0) <= radius) flaws.at(x, y) |= flaw_saturated;
    }
  }
}

void fill_rectangle(Flaws& flaws, int x, int y, int width, int height) {
  for (int j = y; j < y + height; ++j)
    for (int i = x; i < x + width; ++i) flaws.at(i, j) |= flaw_saturated;
}

TEST(SaturatedCores, AreTheMiddlesOfDiscsWithTheirRadiusLargestFirst) {
  for (const double radius : {2.3, 4.0, 9.5, 30.0}) {
    Flaws flaws(120, 110);
    fill_disc(flaws, 60.2, 50.7, radius);
    fill_rectangle(flaws, 3, 3, 2, 1);

    const std::vector<SaturatedCore> found = find_saturated_cores(flaws);

    ASSERT_EQ(found.size(), 2U) << radius;
    EXPECT_NEAR(found[0].x, 60.2, 0.75) << radius;
    EXPECT_NEAR(found[0].y, 50.7, 0.75) << radius;
    EXPECT_NEAR(found[0].radius, radius, 0.15 * radius + 1.5) << radius;
  }
}

TEST(SaturatedCores, DoNotMoveWithAColumnThatRanOver) {
  Flaws flaws(100, 200);
  fill_disc(flaws, 50, 60, 5);
  fill_rectangle(flaws, 50, 40, 1, 150);

  const std::vector<SaturatedCore> found = find_saturated_cores(flaws);

  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].x, 50, 1);
  EXPECT_NEAR(found[0].y, 60, 1);
  EXPECT_LE(found[0].radius, 7);
}

TEST(SaturatedCores, AreNotWhatIsDrawnOutOrLargerThanAStar) {
  Flaws flaws(400, 400);
  fill_rectangle(flaws, 10, 10, 60, 4);
  for (int i = 0; i < 80; ++i) fill_rectangle(flaws, 100 + i, 50 + i, 5, 3);
  fill_rectangle(flaws, 200, 200, 190, 190);

  EXPECT_TRUE(find_saturated_cores(flaws).empty());
}

TEST(SaturatedCores, AreWholeThoughTheirPiecesMeetOnlyFurtherDown) {
  Flaws flaws(40, 40);
  fill_disc(flaws, 20, 22, 6);
  for (int y = 10; y < 19; ++y) flaws.at(20, y) = 0;  // a notch from above

  const std::vector<SaturatedCore> found = find_saturated_cores(flaws);

  ASSERT_EQ(found.size(), 1U);
  EXPECT_NEAR(found[0].x, 20, 2);
}

TEST(SaturatedCores, AreNoneWhereNothingIsSaturatedOrTheFrameHasNoPixels) {
  EXPECT_TRUE(find_saturated_cores(Flaws()).empty());
  Flaws other(20, 20, flaw_invalid | flaw_spike);
  EXPECT_TRUE(find_saturated_cores(other).empty());
  other.at(5, 5) |= flaw_saturated;  // one pixel is a defect
  EXPECT_TRUE(find_saturated_cores(other).empty());
}

TEST(SaturatedCores, OfFramesOfOneRowOrColumnAreFoundToo) {
  for (const auto& [width, height] : {std::pair{30, 1}, {1, 30}, {2, 2}}) {
    Flaws flaws(width, height);
    flaws.cells().back() |= flaw_saturated;
    flaws.cells()[flaws.size() - 2] |= flaw_saturated;
    EXPECT_EQ(find_saturated_cores(flaws).size(), 1U) << width;
  }
}

}  // namespace
}  // namespace srfs::image
