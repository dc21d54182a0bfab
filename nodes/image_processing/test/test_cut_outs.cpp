// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_processing/cut_outs.hpp"

#include <gmock/gmock.h>

namespace srfs {
namespace {

using testing::ElementsAre;

image::Streak line(double x1, double y1, double x2, double y2) {
  return {x1, y1, x2, y2, 20, 1000, 2};
}

image::TrackPoint point(int frame, double x, double y) {
  return {frame, x, y, 9, std::nullopt};
}

TEST(Around, IsTheStreakWithAMarginWithinTheFrame) {
  const auto place = around(line(100, 50, 150, 80), 640, 480, 2).value();
  EXPECT_EQ(place.x, 92);
  EXPECT_EQ(place.y, 42);
  EXPECT_EQ(place.width, 67);
  EXPECT_EQ(place.height, 47);
  EXPECT_EQ(around(line(2, 2, 638, 478), 640, 480, 2)->width, 640);
  EXPECT_FALSE(around(line(1e18, 50, 1e18, 60), 640, 480, 2));
}

TEST(CutOuts, ShowTrackletsPieceByPieceAndStreaksWithTheirSurroundings) {
  TaskFindings findings;
  findings.streaks = {{2, line(100, 50, 150, 50)}, {0, line(10, 10, 600, 400)}};
  findings.tracklets.push_back(
      {{point(0, 50, 60), point(1, 70, 60), point(3, 110, 60)}, 50, 60, 20, 0, 20, 0.1});
  CutOuts cuts(findings);
  EXPECT_THAT(cuts.frames(), ElementsAre(0, 1, 2, 3));

  image::Plane sky(640, 480, 300.0F);
  sky.at(70, 60) = 5000;
  for (const int frame : {0, 1, 2}) cuts.take(frame, sky, 2);  // frame 3 is missing

  const auto pictures = cuts.pictures();
  ASSERT_EQ(pictures.size(), 3U);
  EXPECT_EQ(pictures[0].name, "tracklet_0000.png");
  EXPECT_EQ(pictures[0].pixels.width(), 3 * CutOuts::piece_px);
  EXPECT_EQ(pictures[0].pixels.height(), CutOuts::piece_px);
  EXPECT_GT(pictures[0].pixels.at(CutOuts::piece_px + CutOuts::piece_px / 2, CutOuts::piece_px / 2), 200);
  EXPECT_EQ(pictures[1].name, "streak_0000.png");
  EXPECT_EQ(pictures[1].pixels.width(), 67);
  EXPECT_EQ(pictures[2].name, "streak_0001.png");
  EXPECT_EQ(pictures[2].pixels.width(), CutOuts::longest_px);
}

TEST(CutOuts, AreBoundedInNumberAndPieces) {
  TaskFindings findings;
  for (int i = 0; i < 100; ++i) {
    findings.streaks.push_back({0, line(10, 10, 60, 60)});
    std::vector<image::TrackPoint> points;
    for (int k = 0; k < 50; ++k) points.push_back(point(k, -1e9, 1e9));
    findings.tracklets.push_back({points, 0, 0, 1, 1, 10, 0.1});
  }
  CutOuts cuts(findings);
  EXPECT_EQ(cuts.frames().size(), CutOuts::pieces_most);
  EXPECT_EQ(cuts.frames().front(), 0);
  EXPECT_EQ(cuts.frames().back(), 49);
  cuts.take(0, image::Plane(100, 100, 1.0F), 2);
  EXPECT_EQ(cuts.pictures().size(), CutOuts::tracklets_most + CutOuts::streaks_most);
}

}  // namespace
}  // namespace srfs
