// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "wire/can_data_frame.hpp"

namespace srfs::wire {
namespace {

TEST(Arbitration, LetsAStandardFramePassBeforeAnExtendedOneWithTheSameBase) {
  EXPECT_LT(arbitration_value(0x123, false), arbitration_value(0x123U << 18U, true));
  EXPECT_LT(arbitration_value(0x123, false), arbitration_value(0x123, false, true));
  EXPECT_LT(arbitration_value(0x122U << 18U, true), arbitration_value(0x123, false));
}

TEST(Arbitration, KnowsWhichFramesComeBeforeTheMarker) {
  EXPECT_TRUE(comes_before_marker(0x18DA1101, true));
  EXPECT_TRUE(comes_before_marker(0x736, false)) << "the marker's own base, but standard";
  EXPECT_FALSE(comes_before_marker(0x737, false));
  EXPECT_FALSE(comes_before_marker(transmit_marker_id, true));
  EXPECT_FALSE(comes_before_marker(0x1FFFFFFF, true));
}

}  // namespace
}  // namespace srfs::wire
