// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/timekeeper.hpp"

#include <optional>
#include <random>

#include <gtest/gtest.h>

#include "nodes/timing/mission_clock.hpp"

namespace srfs {
namespace {

constexpr MonotonicTime keeper_start{seconds(50)};
constexpr UtcTime stored_time{seconds(1'780'000'000)};
constexpr std::int64_t receiver_second = 1'795'248'000;

template <class Action>
std::optional<Action> the(const TimeActions& actions) {
  for (const TimeAction& action : actions) {
    if (const auto* const found = std::get_if<Action>(&action)) return *found;
  }
  return std::nullopt;
}

class TimekeeperTest : public testing::Test {
 protected:
  [[nodiscard]] MonotonicTime edge(std::int64_t pulse) const {
    return keeper_start + milliseconds(300) + shift_ + seconds(pulse);
  }
  /// One second: a pulse, its name, and the check of the state.
  TimeActions second(nanoseconds off = nanoseconds(0)) {
    TimeActions all = keeper_.on_pulse(edge(n_), edge(n_));
    add(all, keeper_.review_state(edge(n_)));
    add(all, keeper_.on_time_of_day({.fix_valid = true, .utc = UtcTime(seconds(receiver_second + n_) + off)},
                                    edge(n_) + milliseconds(100)));
    add(all, keeper_.on_time_passing(edge(n_) + milliseconds(500)));
    ++n_;
    return all;
  }
  TimeActions run(int count, nanoseconds off = nanoseconds(0)) {
    TimeActions all;
    for (int i = 0; i < count; ++i) add(all, second(off));
    return all;
  }
  static void add(TimeActions& all, const TimeActions& more) {
    all.insert(all.end(), more.begin(), more.end());
  }
  template <class Action>
  static int count(const TimeActions& actions) {
    int found = 0;
    for (const TimeAction& action : actions) found += std::holds_alternative<Action>(action) ? 1 : 0;
    return found;
  }

  MissionClock clock_{stored_time, keeper_start};
  Timekeeper keeper_{
      {}, ClockStart{.utc = stored_time, .valid = false, .error = {}, .drift_ppm = {}}, keeper_start, clock_};
  std::int64_t n_ = 0;
  nanoseconds shift_{0};
};

TEST_F(TimekeeperTest, ReportsOnceThatTheTimeIsSetAndThatItIsLocked) {
  const TimeActions actions = run(20);
  EXPECT_EQ(count<ReportTimeSet>(actions), 1);
  EXPECT_EQ(count<ReportLocked>(actions), 1);
  EXPECT_EQ(actions.size(), 2U);
  EXPECT_LT(the<ReportLocked>(actions)->offset, microseconds(1));
}

TEST_F(TimekeeperTest, ReportsTheHoldoverWithTheSilenceOfThePulse) {
  (void)run(20);
  const MonotonicTime later = edge(n_ - 1) + seconds(3);
  const TimeActions actions = keeper_.on_time_passing(later);
  ASSERT_EQ(actions.size(), 1U);
  EXPECT_EQ(the<ReportHoldover>(actions)->silent, seconds(3));
  EXPECT_TRUE(keeper_.on_time_passing(later + seconds(1)).empty()) << "once";
}

TEST_F(TimekeeperTest, ReportsOneRefusedJumpAMinuteWhileTheReceiverInsists) {
  (void)run(20);
  const TimeActions actions = run(130, seconds(3600));
  const int refused = count<ReportJumpRefused>(actions);
  EXPECT_GE(refused, 2);
  EXPECT_LE(refused, 3);
  EXPECT_EQ(the<ReportJumpRefused>(actions)->difference, seconds(3600));
  EXPECT_EQ(count<ReportTimeSet>(actions), 0);
}

TEST_F(TimekeeperTest, ReportsAPulseThatMovedForGood) {
  (void)run(20);
  shift_ = milliseconds(5);
  const TimeActions actions = run(70);
  ASSERT_EQ(count<ReportPulseMoved>(actions), 1);
  EXPECT_NEAR(std::abs(the<ReportPulseMoved>(actions)->moved_us), 5000, 1);
}

TEST_F(TimekeeperTest, APulseOfTheFutureIsNone) {
  EXPECT_TRUE(keeper_.on_pulse(edge(0), edge(0) - nanoseconds(1)).empty());
  EXPECT_EQ(keeper_.time().pulse_clock().counters().pulses, 0U);
}

TEST_F(TimekeeperTest, AnOrderIsReportedAsSetOrWithWhyItIsNot) {
  const MonotonicTime now = keeper_start + seconds(1);
  const UtcTime utc{seconds(receiver_second)};
  const auto set = keeper_.set_time({.utc = utc, .at = now}, now);
  EXPECT_TRUE(set.is_set());
  EXPECT_EQ(the<ReportTimeSet>(set.actions)->utc, utc);

  const auto jump = keeper_.set_time({.utc = utc + seconds(3600), .at = now}, now);
  EXPECT_FALSE(jump.is_set());
  EXPECT_EQ(the<ReportTimeRejected>(jump.actions)->why, SetTimeVerdict::jump_refused);
  const auto nonsense = keeper_.set_time({.utc = UtcTime(), .at = now, .allow_jump = true}, now);
  EXPECT_EQ(the<ReportTimeRejected>(nonsense.actions)->why, SetTimeVerdict::implausible);
  EXPECT_EQ(nonsense.actions.size(), 1U);
}

TEST_F(TimekeeperTest, WhateverTheReceiverDoesLockAndHoldoverAreReportedInTurn) {
  std::mt19937 random(17);
  bool locked = false;
  int changes = 0;
  for (int i = 0; i < 3000; ++i) {
    TimeActions actions;
    if (random() % 300 == 0) {
      const auto silence = static_cast<std::int64_t>(random() % 10);
      actions = keeper_.on_time_passing(edge(n_ + silence) - milliseconds(1));
      n_ += silence;
    } else {
      actions = second(random() % 200 == 0 ? seconds(random() % 100) : nanoseconds(0));
    }
    for (const TimeAction& action : actions) {
      if (std::holds_alternative<ReportLocked>(action)) {
        ASSERT_FALSE(locked);
        locked = true;
        ++changes;
      }
      if (std::holds_alternative<ReportHoldover>(action)) {
        ASSERT_TRUE(locked);
        locked = false;
      }
    }
    ASSERT_EQ(locked, keeper_.time().pulse_clock().state() == mission::SyncState::locked);
  }
  EXPECT_GT(changes, 3);
}

}  // namespace
}  // namespace srfs
