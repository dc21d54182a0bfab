// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_acquisition/frame_check.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

const MonotonicTime begun(seconds(100));

hw::CameraFrame frame(std::uint32_t sequence, std::uint16_t first_pixel, int width = 4) {
  hw::CameraFrame f;
  f.pixels = image::Grid<std::uint16_t>(width, 2, std::uint16_t{7});
  f.pixels.at(0, 0) = first_pixel;
  f.sequence = sequence;
  f.begin = begun;
  return f;
}

TEST(FrameCheck, TakesFramesThatDiffer) {
  FrameCheck check;
  EXPECT_FALSE(check.judge(frame(1, 1), begun));
  EXPECT_FALSE(check.judge(frame(2, 2), begun));
}

TEST(FrameCheck, FindsAFrameThatCameTwice) {
  FrameCheck check;
  EXPECT_FALSE(check.judge(frame(1, 1), begun));
  EXPECT_EQ(check.judge(frame(1, 2), begun), "frame 1 received twice");
  EXPECT_EQ(check.judge(frame(2, 2), begun), "frame 2 has the pixels of frame 1");
  EXPECT_FALSE(check.judge(frame(3, 3), begun));
}

TEST(FrameCheck, LetsADarkFrameFollowADarkFrame) {
  FrameCheck check;
  EXPECT_FALSE(check.judge(frame(1, 7), begun));
  EXPECT_FALSE(check.judge(frame(2, 7), begun));
}

TEST(FrameCheck, LetsAReplayRepeatItself) {
  FrameCheck check;
  for (int i = 0; i < 2; ++i) {
    hw::CameraFrame replayed = frame(5, 1);
    replayed.may_repeat = true;
    EXPECT_FALSE(check.judge(replayed, begun));
  }
}

TEST(FrameCheck, RefusesFramesOfAnotherSizeFromBeforeAndWithoutPixels) {
  FrameCheck check;
  EXPECT_FALSE(check.judge(frame(1, 1), begun));
  EXPECT_EQ(check.judge(frame(2, 2, 6), begun), "a frame of 6 x 2 pixels after 4 x 2");
  hw::CameraFrame old = frame(3, 3);
  old.begin = begun - milliseconds(50);
  EXPECT_EQ(check.judge(old, begun), "a frame older than its exposure");
  EXPECT_TRUE(check.judge(hw::CameraFrame{}, begun));
  check.forget();
  EXPECT_FALSE(check.judge(frame(1, 1, 8), begun)) << "another camera";
}

}  // namespace
}  // namespace srfs
