// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "nodes/payload/babble_monitor.hpp"

namespace srfs {
namespace {

using Verdict = BabbleMonitor::Verdict;

struct Monitor : ::testing::Test {
  BabbleMonitor monitor;
  BabbleMonitor::Settings settings;
  MonotonicTime now{seconds(100)};

  /// Sends frames at this distance until a verdict, at most @p limit frames.
  Verdict flood(nanoseconds distance, int limit = 100'000) {
    for (int i = 0; i < limit; ++i) {
      now += distance;
      if (const Verdict v = monitor.on_unsolicited_frame(now); v != Verdict::tolerable) return v;
    }
    return Verdict::tolerable;
  }
  void power_cycle() {
    now += milliseconds(200);
    monitor.on_switched_on(now);
  }
};
using BabbleMonitorTest = Monitor;

TEST_F(BabbleMonitorTest, ToleratesALateAnswerInEverySlot) {
  for (int slot = 0; slot < 10'000; ++slot) {
    now += milliseconds(300);
    for (int i = 0; i < 6; ++i) ASSERT_EQ(monitor.on_unsolicited_frame(now), Verdict::tolerable) << slot;
  }
}

TEST_F(BabbleMonitorTest, KnowsAFullBusWithinTwentyMilliseconds) {
  const MonotonicTime begin = now;
  EXPECT_EQ(flood(microseconds(270)), Verdict::power_cycle);
  EXPECT_LT(now - begin, milliseconds(20));
}

TEST_F(BabbleMonitorTest, KnowsASlowButEndlessStreamToo) {
  EXPECT_EQ(flood(milliseconds(10)), Verdict::power_cycle);
  EXPECT_EQ(flood(settings.forgiven_every), Verdict::tolerable) << "as slow as it is forgiven";
}

TEST_F(BabbleMonitorTest, KeepsOffWhenThreePowerCyclesInARowDidNotHelp) {
  for (unsigned cycle = 0; cycle < settings.power_cycles; ++cycle) {
    EXPECT_EQ(flood(microseconds(300)), Verdict::power_cycle);
    EXPECT_EQ(monitor.in_a_row(), cycle);
    power_cycle();
  }
  EXPECT_EQ(flood(microseconds(300)), Verdict::keep_off);
}

TEST_F(BabbleMonitorTest, BeginsAnewAfterAPeripheralBehavedForAWhileOrWasForgiven) {
  (void)flood(microseconds(300));
  power_cycle();
  (void)flood(microseconds(300));
  EXPECT_EQ(monitor.in_a_row(), 1U);
  power_cycle();
  now += settings.at_once;
  EXPECT_EQ(flood(microseconds(300)), Verdict::power_cycle);
  EXPECT_EQ(monitor.in_a_row(), 0U);

  power_cycle();
  (void)flood(microseconds(300));
  EXPECT_EQ(monitor.in_a_row(), 1U);
  monitor.forgive();
  power_cycle();
  (void)flood(microseconds(300));
  EXPECT_EQ(monitor.in_a_row(), 0U);
}

TEST_F(BabbleMonitorTest, BlamesTheFirstFloodOnNoPowerCycle) {
  power_cycle();  // power cycle at the node's start
  EXPECT_EQ(flood(microseconds(300)), Verdict::power_cycle);
  EXPECT_EQ(monitor.in_a_row(), 0U);
}

TEST_F(BabbleMonitorTest, WithoutPowerCyclesAllowedKeepsOffAtOnce) {
  monitor.change_settings({.power_cycles = 0});
  EXPECT_EQ(flood(microseconds(300)), Verdict::keep_off);
}

TEST_F(BabbleMonitorTest, SurvivesATimeThatStandsStill) {
  EXPECT_EQ(flood(nanoseconds(0), 64), Verdict::tolerable);
  EXPECT_EQ(flood(nanoseconds(0), 1), Verdict::power_cycle);
}

}  // namespace
}  // namespace srfs
