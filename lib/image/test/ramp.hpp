// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include "image/frame.hpp"

namespace srfs::image {

/// A ramp: value 7 x + 100 y.
inline Plane ramp(int width = 12, int height = 9) {
  Plane plane(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) plane.at(x, y) = static_cast<float>(7 * x + 100 * y);
  }
  return plane;
}

inline void expect_ramp(const Result<Frame, Refusal>& frame, float tolerance = 0) {
  ASSERT_TRUE(frame) << frame.error().reason;
  const Plane expected = ramp();
  ASSERT_EQ(frame->pixels.width(), expected.width());
  ASSERT_EQ(frame->pixels.height(), expected.height());
  for (int y = 0; y < expected.height(); ++y) {
    for (int x = 0; x < expected.width(); ++x)
      EXPECT_NEAR(frame->pixels.at(x, y), expected.at(x, y), tolerance);
  }
}

}  // namespace srfs::image
