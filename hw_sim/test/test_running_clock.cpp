// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/running_clock.hpp"

#include <gtest/gtest.h>

#include "hw_sim/starvation_timer.hpp"

namespace srfs::sim {
namespace {

constexpr MonotonicTime begin{seconds(1000)};

/// A thread that wakes up repeatedly.
class RunningClockTest : public ::testing::Test {
 protected:
  /// The thread works for @p work, sleeps until it is due or gets input, and wakes @p after the last wake-up.
  void wake(nanoseconds after, nanoseconds work, nanoseconds waited, std::optional<nanoseconds> due) {
    const MonotonicTime before = now;
    now += after;
    own.ran += work;
    own.waited += waited;
    ++own.stints;
    clock.advance(now, own, due ? std::optional(before + *due) : std::nullopt);
  }
  MonotonicTime now = begin;
  ThreadCpu own{.ran = seconds(3), .waited = seconds(7), .stints = 1};
  RunningClock clock{now, own};
};

TEST_F(RunningClockTest, IsTheMonotonicClockWhileTheThreadIsOnTime) {
  for (int i = 0; i < 100; ++i)
    wake(milliseconds(20) + microseconds(80), milliseconds(1), nanoseconds(0), milliseconds(20));
  EXPECT_EQ(clock.now().since_epoch(), now.since_epoch());
  EXPECT_EQ(clock.lost(), nanoseconds(0));
}

TEST_F(RunningClockTest, StopsWhileTheThreadWaitsForACpuThoughItWasNotDue) {
  wake(milliseconds(15), milliseconds(1), milliseconds(12), milliseconds(20));
  EXPECT_EQ(clock.lost(), milliseconds(12));
  EXPECT_EQ(clock.waited(), milliseconds(12));
  EXPECT_EQ(clock.now().since_epoch(), (begin + milliseconds(3)).since_epoch());
}

TEST_F(RunningClockTest, CountsAWaitThatMadeItLateOnce) {
  wake(milliseconds(120), milliseconds(1), milliseconds(100), milliseconds(20));
  EXPECT_EQ(clock.lost(), milliseconds(100));
}

TEST_F(RunningClockTest, StopsWhileTheThreadIsStoppedAsleepOrAtWork) {
  wake(seconds(15) + milliseconds(20), milliseconds(1), nanoseconds(0), milliseconds(20));
  EXPECT_EQ(clock.lost(), seconds(15));

  // The thread stops before it sets its timer, which becomes due in the meantime.
  wake(seconds(15) + milliseconds(30), milliseconds(30), nanoseconds(0), milliseconds(20));
  EXPECT_EQ(clock.lost(), seconds(30));
}

TEST_F(RunningClockTest, GoesOnWhileTheThreadSleepsWithNothingToDo) {
  wake(seconds(60), milliseconds(1), nanoseconds(0), std::nullopt);
  wake(seconds(60), milliseconds(1), nanoseconds(0), seconds(60));
  EXPECT_EQ(clock.lost(), nanoseconds(0));
}

TEST_F(RunningClockTest, GoesOnWhileTheThreadWorksBeyondTheTimeOfItsTimer) {
  for (int i = 0; i < 100; ++i) wake(milliseconds(30), milliseconds(30), nanoseconds(0), milliseconds(20));
  EXPECT_EQ(clock.lost(), nanoseconds(0));
}

TEST_F(RunningClockTest, NeverGoesBackThoughTheWaitWasReadLaterThanTheTime) {
  wake(milliseconds(1), nanoseconds(0), milliseconds(30), milliseconds(20));
  EXPECT_EQ(clock.now().since_epoch(), begin.since_epoch());
  EXPECT_EQ(clock.waited(), milliseconds(1));

  // The rest of the wait counts at the next reading, which is late by this rest.
  wake(milliseconds(49), nanoseconds(0), nanoseconds(0), milliseconds(20));
  EXPECT_EQ(clock.lost(), milliseconds(30));
  EXPECT_EQ(clock.waited(), milliseconds(30));
}

TEST_F(RunningClockTest, PassesOverAnAccountThatCannotBeReadOnce) {
  const ThreadCpu counted = own;
  own.waited = nanoseconds(0);
  wake(milliseconds(10), milliseconds(1), nanoseconds(0), milliseconds(20));
  EXPECT_EQ(clock.lost(), nanoseconds(0));

  own.waited = counted.waited;
  wake(milliseconds(10), milliseconds(1), milliseconds(4), milliseconds(20));
  EXPECT_EQ(clock.lost(), milliseconds(4));
}

TEST_F(RunningClockTest, NamesTheMonotonicTimeAtWhichItShowsATime) {
  const RunningTime deadline = clock.now() + milliseconds(100);
  EXPECT_EQ(clock.earliest(deadline), begin + milliseconds(100));
  wake(seconds(2), milliseconds(1), nanoseconds(0), milliseconds(50));
  EXPECT_EQ(clock.earliest(deadline), now + milliseconds(50));
}

TEST_F(RunningClockTest, LetsAWatchdogStarveOnlyWhileItCouldHaveSeenAFeed) {
  StarvationTimer watchdog(seconds(10));
  watchdog.feed(clock.now());

  wake(seconds(15), milliseconds(1), nanoseconds(0), milliseconds(20));
  EXPECT_FALSE(watchdog.bites(clock.now()));

  for (int i = 0; i < 500; ++i) wake(milliseconds(20), milliseconds(1), nanoseconds(0), milliseconds(20));
  EXPECT_TRUE(watchdog.bites(clock.now()));
}

}  // namespace
}  // namespace srfs::sim
