// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "ros/goal_tracker.hpp"

namespace srfs::ros {
namespace {

MonotonicTime at(milliseconds t) {
  return MonotonicTime(t);
}

constexpr GoalDeadlines deadlines{.result = seconds(30)};

GoalTracker accepted_goal() {
  GoalTracker goal(deadlines);
  const auto step = goal.on_response(true, at(seconds(0)));
  EXPECT_TRUE(step.request_result);
  EXPECT_EQ(goal.state(), GoalState::accepted);
  return goal;
}

TEST(GoalTracker, EndsWithTheResultTheServerGives) {
  auto goal = accepted_goal();
  goal.on_status(GoalState::executing, at(seconds(1)));
  EXPECT_EQ(goal.state(), GoalState::executing);
  const auto step = goal.on_result(GoalState::succeeded);
  EXPECT_EQ(step.finished, GoalState::succeeded);
  EXPECT_TRUE(goal.is_over());
  EXPECT_FALSE(goal.next_deadline());
}

TEST(GoalTracker, ARejectedGoalIsOver) {
  GoalTracker goal(deadlines);
  EXPECT_EQ(goal.on_response(false, at(seconds(0))).failed, GoalError::rejected);
  EXPECT_TRUE(goal.is_over());
}

TEST(GoalTracker, AGoalThatCouldNotBeSentIsOverAndSaysWhy) {
  for (const auto why : {GoalError::no_server, GoalError::unanswered, GoalError::refused}) {
    GoalTracker goal(deadlines);
    EXPECT_EQ(goal.on_send_failed(why).failed, why);
    EXPECT_TRUE(goal.is_over());
  }
}

TEST(GoalTracker, NothingHappensToAGoalThatIsOver) {
  auto goal = accepted_goal();
  goal.on_result(GoalState::aborted);
  for (const auto& step :
       {goal.on_response(true, at(seconds(1))), goal.on_result(GoalState::succeeded),
        goal.on_status(GoalState::succeeded, at(seconds(1))), goal.on_server(false, at(seconds(1))),
        goal.on_cancel_wanted(), goal.on_time(at(seconds(100))), goal.on_send_failed(GoalError::refused)}) {
    EXPECT_FALSE(step.request_result || step.request_cancel || step.failed || step.finished);
  }
  EXPECT_EQ(goal.state(), GoalState::aborted);
}

TEST(GoalTracker, WithoutAResultByItsDeadlineItFailsAndCancels) {
  auto goal = accepted_goal();
  EXPECT_EQ(goal.next_deadline(), at(seconds(30)));
  EXPECT_FALSE(goal.on_time(at(milliseconds(29'999))).failed);
  const auto step = goal.on_time(at(seconds(30)));
  EXPECT_EQ(step.failed, GoalError::result_late);
  EXPECT_TRUE(step.request_cancel);
}

TEST(GoalTracker, CancelsALateGoalOnlyIfItMayAndHasNotYet) {
  GoalTracker patient({.result = seconds(30), .cancel_when_late = false});
  patient.on_response(true, at(seconds(0)));
  EXPECT_FALSE(patient.on_time(at(seconds(30))).request_cancel);

  auto canceled = accepted_goal();
  canceled.on_cancel_wanted();
  EXPECT_FALSE(canceled.on_time(at(seconds(30))).request_cancel);
}

TEST(GoalTracker, ACancelBeforeTheServersAnswerIsSentWithTheAcceptance) {
  GoalTracker goal(deadlines);
  EXPECT_FALSE(goal.on_cancel_wanted().request_cancel);
  EXPECT_TRUE(goal.on_response(true, at(seconds(0))).request_cancel);
  EXPECT_FALSE(goal.on_cancel_wanted().request_cancel) << "once is enough";
}

TEST(GoalTracker, AServerThatIsGoneEndsTheGoalAfterItsLastWordsHadTime) {
  auto goal = accepted_goal();
  goal.on_server(false, at(seconds(5)));
  goal.on_server(false, at(milliseconds(5100)));  // another endpoint of the server
  EXPECT_EQ(goal.next_deadline(), at(seconds(5)) + GoalTracker::farewell);
  EXPECT_FALSE(goal.on_time(at(milliseconds(5199))).failed);
  EXPECT_EQ(goal.on_time(at(milliseconds(5200))).failed, GoalError::server_lost);
}

TEST(GoalTracker, LastWordsCount) {
  auto goal = accepted_goal();
  goal.on_server(false, at(seconds(5)));
  EXPECT_EQ(goal.on_result(GoalState::aborted).finished, GoalState::aborted);
}

TEST(GoalTracker, AServerThatComesBackAtOnceWasNotLost) {
  auto goal = accepted_goal();
  goal.on_server(false, at(seconds(5)));
  goal.on_server(true, at(milliseconds(5100)));
  EXPECT_FALSE(goal.on_time(at(seconds(6))).failed);
}

TEST(GoalTracker, AServerThatDoesNotKnowTheGoalHasForgottenIt) {
  auto goal = accepted_goal();
  EXPECT_EQ(goal.on_result(GoalState::unknown).failed, GoalError::unknown_goal);
}

TEST(GoalTracker, AResultThatDoesNotComeAfterTheEndIsAskedForAgainAndGivenUp) {
  auto goal = accepted_goal();
  goal.on_status(GoalState::succeeded, at(seconds(2)));
  EXPECT_FALSE(goal.on_time(at(milliseconds(2999))).request_result);
  for (int s = 3; s <= 5; ++s) EXPECT_TRUE(goal.on_time(at(seconds(s))).request_result) << s;
  EXPECT_EQ(goal.on_time(at(seconds(6))).failed, GoalError::result_lost);
}

TEST(GoalTracker, AnEarlierStateThatArrivesLateIsNoNews) {
  auto goal = accepted_goal();
  goal.on_status(GoalState::canceling, at(seconds(1)));
  goal.on_status(GoalState::executing, at(seconds(2)));
  EXPECT_EQ(goal.state(), GoalState::canceling);
  goal.on_status(GoalState::succeeded, at(seconds(3)));
  goal.on_status(GoalState::aborted, at(seconds(4)));
  EXPECT_EQ(goal.state(), GoalState::succeeded);
}

TEST(GoalTracker, AnEndHeardOfBeforeTheAcceptanceCountsFromThere) {
  GoalTracker goal(deadlines);
  goal.on_status(GoalState::aborted, at(seconds(0)));
  goal.on_response(true, at(seconds(4)));
  EXPECT_EQ(goal.state(), GoalState::aborted);
  EXPECT_EQ(goal.next_deadline(), at(seconds(5)));
}

}  // namespace
}  // namespace srfs::ros
