// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <action_msgs/srv/cancel_goal.hpp>

#include "ros/action_goals.hpp"

namespace srfs::ros {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using CancelCode = action_msgs::srv::CancelGoal_Response;

TEST(GoalTable, HasTheTransitionsOfRclActionAndNoOther) {
  // rcl_action/src/rcl_action/goal_state_machine.c: _goal_state_transition_map
  using S = GoalState;
  using E = GoalEvent;
  const std::map<std::pair<S, E>, S> wanted{
      {{S::accepted, E::execute}, S::executing},      {{S::accepted, E::cancel_goal}, S::canceling},
      {{S::executing, E::cancel_goal}, S::canceling}, {{S::executing, E::succeed}, S::succeeded},
      {{S::executing, E::abort}, S::aborted},         {{S::canceling, E::succeed}, S::succeeded},
      {{S::canceling, E::abort}, S::aborted},         {{S::canceling, E::canceled}, S::canceled}};
  EXPECT_EQ(goal_table().size(), wanted.size());
  for (int state = -1; state < 16; ++state) {
    for (int event = 0; event < 16; ++event) {
      const auto from = static_cast<S>(state);
      const auto what = static_cast<E>(event);
      const auto found = wanted.find({from, what});
      const auto expected = found != wanted.end() ? std::optional(found->second) : std::nullopt;
      EXPECT_EQ(next_state(from, what), expected) << state << " " << event;
    }
  }
}

TEST(GoalTable, StatesHaveTheNumbersOfGoalStatus) {
  EXPECT_EQ(label(static_cast<GoalState>(1)), "accepted");
  EXPECT_EQ(label(static_cast<GoalState>(2)), "executing");
  EXPECT_EQ(label(static_cast<GoalState>(3)), "canceling");
  EXPECT_EQ(label(static_cast<GoalState>(4)), "succeeded");
  EXPECT_EQ(label(static_cast<GoalState>(5)), "canceled");
  EXPECT_EQ(label(static_cast<GoalState>(6)), "aborted");
  for (const int number : {-128, -1, 0, 7, 127})
    EXPECT_EQ(goal_state(static_cast<std::int8_t>(number)), GoalState::unknown) << number;
}

TEST(GoalTable, EveryStateIsActiveOrTerminalAndTerminalOnesHaveNoWayOut) {
  for (int number = 1; number <= 6; ++number) {
    const auto state = goal_state(static_cast<std::int8_t>(number));
    EXPECT_NE(is_active(state), is_terminal(state)) << number;
    for (const GoalRow& row : goal_table()) EXPECT_FALSE(is_terminal(row.from));
  }
  EXPECT_TRUE(is_cancelable(GoalState::accepted));
  EXPECT_TRUE(is_cancelable(GoalState::executing));
  EXPECT_FALSE(is_cancelable(GoalState::canceling));
  EXPECT_FALSE(is_active(GoalState::unknown));
}

GoalId id(std::uint8_t n) {
  GoalId made{};
  made[15] = n;
  return made;
}
GoalClient client(std::uint8_t n) {
  GoalClient made{};
  made[0] = n;
  return made;
}
UtcTime stamp(int s) {
  return UtcTime(seconds(s));
}
MonotonicTime at(int s) {
  return MonotonicTime(seconds(s));
}

class ActionGoalsTest : public testing::Test {
 protected:
  void start(std::uint8_t n, int stamp_s = 100) {
    ASSERT_EQ(goals_.admit(id(n)), ActionGoals::Admission::open);
    goals_.accept(id(n), client(n), stamp(stamp_s));
    ASSERT_TRUE(goals_.apply(id(n), GoalEvent::execute, at(0)));
  }
  void succeed(std::uint8_t n, int when_s) {
    ASSERT_TRUE(goals_.apply(id(n), GoalEvent::succeed, at(when_s), std::make_shared<int>(n)));
  }
  static std::vector<std::uint8_t> names(const std::vector<ActionGoals::Goal>& goals) {
    std::vector<std::uint8_t> out;
    for (const auto& goal : goals) out.push_back(goal.id[15]);
    return out;
  }
  ActionGoals goals_{GoalLimits{.active = 3, .results = 2, .result_timeout = seconds(10)}};
};

TEST_F(ActionGoalsTest, RejectsAndCountsGoalsBeyondItsBound) {
  for (std::uint8_t n = 1; n <= 3; ++n) start(n);
  EXPECT_EQ(goals_.admit(id(4)), ActionGoals::Admission::full);
  EXPECT_EQ(goals_.counters().rejected_full, 1U);

  succeed(2, 1);
  EXPECT_EQ(goals_.admit(id(4)), ActionGoals::Admission::open);
}

TEST_F(ActionGoalsTest, RejectsAnIdThatIsInUseOrWhoseResultIsKept) {
  start(1);
  EXPECT_EQ(goals_.admit(id(1)), ActionGoals::Admission::duplicate);
  succeed(1, 1);
  EXPECT_EQ(goals_.admit(id(1)), ActionGoals::Admission::duplicate);
  EXPECT_EQ(goals_.counters().rejected_duplicate, 2U);
}

TEST_F(ActionGoalsTest, RefusesAndCountsEventsTheStateDoesNotAllow) {
  start(1);
  EXPECT_FALSE(goals_.apply(id(1), GoalEvent::canceled, at(0)));
  EXPECT_FALSE(goals_.apply(id(9), GoalEvent::succeed, at(0))) << "no such goal";
  EXPECT_EQ(goals_.state(id(1)), GoalState::executing);
  EXPECT_EQ(goals_.counters().refused_events, 2U);
}

TEST_F(ActionGoalsTest, KeepsAResultForItsStatedTimeAndThenForgetsTheGoal) {
  start(1);
  EXPECT_FALSE(goals_.next_expiry());
  succeed(1, 5);
  EXPECT_EQ(goals_.next_expiry(), at(15));
  EXPECT_EQ(goals_.expire(at(14)), 0U);
  EXPECT_EQ(*std::static_pointer_cast<const int>(goals_.result(id(1))), 1);

  EXPECT_EQ(goals_.expire(at(15)), 1U);
  EXPECT_EQ(goals_.state(id(1)), GoalState::unknown);
  EXPECT_EQ(goals_.result(id(1)), nullptr);
  EXPECT_EQ(goals_.counters().expired, 1U);
}

TEST_F(ActionGoalsTest, TheResultThatEndedFirstMakesRoomAndIsCounted) {
  for (std::uint8_t n = 1; n <= 3; ++n) start(n);
  succeed(2, 1);
  succeed(3, 2);
  succeed(1, 2);
  EXPECT_EQ(goals_.state(id(2)), GoalState::unknown);
  EXPECT_THAT(names(goals_.goals()), ElementsAre(1, 3)) << "in order of acceptance";
  EXPECT_EQ(goals_.counters().evicted, 1U);
}

TEST_F(ActionGoalsTest, WaitersAreHandedOutOnceWhenTheGoalEnds) {
  start(1);
  EXPECT_TRUE(goals_.await_result(id(1), 71));
  EXPECT_TRUE(goals_.await_result(id(1), 72));
  EXPECT_TRUE(goals_.await_result(id(1), 73));
  goals_.forget_waiter(72);
  EXPECT_FALSE(goals_.await_result(id(9), 74)) << "no such goal";

  succeed(1, 1);
  EXPECT_FALSE(goals_.await_result(id(1), 75)) << "its result is there";
  EXPECT_THAT(goals_.take_waiters(id(1)), ElementsAre(71, 73));
  EXPECT_THAT(goals_.take_waiters(id(1)), IsEmpty());
}

TEST_F(ActionGoalsTest, WaitersOfAnEndingGoalAreNeverEvictedWithIt) {
  for (std::uint8_t n = 1; n <= 3; ++n) start(n);
  goals_.await_result(id(1), 71);
  succeed(2, 1);
  succeed(3, 1);
  succeed(1, 1);  // at the same instant, but first in the goals
  EXPECT_THAT(goals_.take_waiters(id(1)), ElementsAre(71));
}

class CancelScopeTest : public ActionGoalsTest {
 protected:
  void SetUp() override {
    start(1, 100);
    start(2, 200);
    start(3, 300);
  }
};

TEST_F(CancelScopeTest, NoIdAndNoStampMeanAll) {
  const auto scope = goals_.cancel_scope({}, UtcTime());
  EXPECT_EQ(scope.return_code, CancelCode::ERROR_NONE);
  EXPECT_THAT(names(scope.goals), ElementsAre(1, 2, 3));
}

TEST_F(CancelScopeTest, AStampMeansAllAcceptedAtOrBefore) {
  EXPECT_THAT(names(goals_.cancel_scope({}, stamp(200)).goals), ElementsAre(1, 2));
  const auto none = goals_.cancel_scope({}, stamp(50));
  EXPECT_EQ(none.return_code, CancelCode::ERROR_NONE) << "nothing to do is no error";
  EXPECT_THAT(none.goals, IsEmpty());
}

TEST_F(CancelScopeTest, AStampAndAnIdMeanTheUnion) {
  EXPECT_THAT(names(goals_.cancel_scope(id(3), stamp(100)).goals), ElementsAre(1, 3));
  EXPECT_EQ(goals_.cancel_scope(id(9), stamp(100)).return_code, CancelCode::ERROR_NONE);
}

TEST_F(CancelScopeTest, AnIdMeansThatGoalAndSaysWhyNot) {
  EXPECT_THAT(names(goals_.cancel_scope(id(2), UtcTime()).goals), ElementsAre(2));
  EXPECT_EQ(goals_.cancel_scope(id(9), UtcTime()).return_code, CancelCode::ERROR_UNKNOWN_GOAL_ID);

  succeed(2, 1);
  EXPECT_EQ(goals_.cancel_scope(id(2), UtcTime()).return_code, CancelCode::ERROR_GOAL_TERMINATED);
  goals_.apply(id(3), GoalEvent::cancel_goal, at(1));
  EXPECT_EQ(goals_.cancel_scope(id(3), UtcTime()).return_code, CancelCode::ERROR_GOAL_TERMINATED)
      << "rcl_action's answer for a goal that is being canceled";
}

TEST_F(CancelScopeTest, GoalsThatCannotBeCanceledAreLeftOut) {
  succeed(1, 1);
  goals_.apply(id(2), GoalEvent::cancel_goal, at(1));
  EXPECT_THAT(names(goals_.cancel_scope({}, UtcTime()).goals), ElementsAre(3));
}

TEST_F(ActionGoalsTest, AGoalIsOrphanedOnceWhenAClientThatWasThereIsGone) {
  start(1);
  start(2);
  const auto nobody = [](const GoalClient&) { return false; };
  const auto everybody = [](const GoalClient&) { return true; };
  EXPECT_THAT(goals_.orphans(nobody), IsEmpty()) << "not seen yet: discovery may be under way";
  EXPECT_THAT(goals_.orphans(everybody), IsEmpty());
  EXPECT_THAT(goals_.orphans([](const GoalClient& c) { return c == client(2); }), ElementsAre(id(1)));
  EXPECT_THAT(goals_.orphans(nobody), ElementsAre(id(2)));
  EXPECT_THAT(goals_.orphans(nobody), IsEmpty());
}

TEST_F(ActionGoalsTest, AnEndedGoalIsNobodysOrphan) {
  start(1);
  (void)goals_.orphans([](const GoalClient&) { return true; });
  succeed(1, 1);
  EXPECT_THAT(goals_.orphans([](const GoalClient&) { return false; }), IsEmpty());
}

}  // namespace
}  // namespace srfs::ros
