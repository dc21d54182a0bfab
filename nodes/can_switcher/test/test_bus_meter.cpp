// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "nodes/can_switcher/bus_meter.hpp"

namespace srfs {
namespace {

constexpr MonotonicTime start{seconds(7)};
constexpr std::uint32_t bit_rate = 500'000;
constexpr std::uint32_t own = 0x18DA1101;

TEST(BusMeter, MeasuresTheShareOfTheBitTimeOfEachWindow) {
  BusMeter meter(start);
  for (int i = 0; i < 1000; ++i) meter.on_frame(own, true, 130);
  EXPECT_EQ(meter.end_window(start + seconds(1), bit_rate), BusMeter::Flood::no_change);
  EXPECT_DOUBLE_EQ(meter.last().load, 0.26);
  EXPECT_EQ(meter.last().frames, 1000U);
  meter.on_frame(own, true, 130);
  meter.end_window(start + seconds(3), bit_rate);
  EXPECT_DOUBLE_EQ(meter.last().load, 0.00013);
  EXPECT_DOUBLE_EQ(meter.peak(), 0.26);
}

TEST(BusMeter, TellsFramesToAndFromTheComputerFromForeignOnes) {
  BusMeter meter(start);
  meter.on_frame(0x18DA1101, true, 1);
  meter.on_frame(0x18DA0111, true, 1);
  meter.on_frame(0x18DA1211, true, 1);
  meter.on_frame(0x18DB1101, true, 1);
  meter.on_frame(0x101, false, 1);
  EXPECT_EQ(meter.counters().frames, 5U);
  EXPECT_EQ(meter.counters().foreign_frames, 3U);
}

TEST(BusMeter, SaysOnceThatAFloodBeganWhoItIsAndOnceThatItEnded) {
  BusMeter meter(start);
  MonotonicTime now = start;
  const auto window = [&](unsigned foreign, unsigned ours) {
    for (unsigned i = 0; i < foreign; ++i) {
      meter.on_frame(0x123, false, 100);
      if (i < ours) meter.on_frame(own, true, 100);
    }
    return meter.end_window(now += seconds(1), bit_rate);
  };
  EXPECT_EQ(window(4490, 0), BusMeter::Flood::no_change);
  EXPECT_EQ(window(4400, 200), BusMeter::Flood::began);
  EXPECT_EQ(meter.last().most_frequent, 0x123U);
  EXPECT_EQ(window(5000, 0), BusMeter::Flood::no_change);
  EXPECT_EQ(window(4000, 0), BusMeter::Flood::no_change) << "less, and not over";
  EXPECT_TRUE(meter.flooded());
  EXPECT_EQ(window(1000, 0), BusMeter::Flood::ended);
  EXPECT_EQ(meter.flood_lasted(), seconds(3));
  EXPECT_EQ(meter.counters().floods, 1U);
}

TEST(BusMeter, SurvivesAWindowWithoutTime) {
  BusMeter meter(start);
  meter.on_frame(own, true, 130);
  EXPECT_EQ(meter.end_window(start, bit_rate), BusMeter::Flood::no_change);
  EXPECT_EQ(meter.last().load, 0);
}

}  // namespace
}  // namespace srfs
