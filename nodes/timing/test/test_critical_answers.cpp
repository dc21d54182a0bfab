// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/critical_answers.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

constexpr std::uint8_t inactive = 2;
constexpr std::uint8_t active = 3;
constexpr MonotonicTime start{seconds(100)};

class CriticalAnswersTest : public ::testing::Test {
 protected:
  CriticalAnswers answers{{"can_switcher", "ttc"}, 5, seconds(7)};
};

TEST_F(CriticalAnswersTest, HoldWhileTheLastAnswerIsFresh) {
  EXPECT_FALSE(answers.holds(0, start)) << "nothing is believed before the first answer";
  answers.on_answer(0, answers.ask(0, start), active);
  EXPECT_TRUE(answers.holds(0, start + seconds(7)));
  EXPECT_FALSE(answers.holds(0, start + seconds(7) + nanoseconds(1)));
  EXPECT_FALSE(answers.holds(1, start)) << "each node answers for itself";
}

TEST_F(CriticalAnswersTest, AreNoOlderForATimeInWhichTheirNodeWaitedForACpu) {
  answers.on_answer(0, answers.ask(0, start), active);
  answers.on_cpu(0, 77, {}, start);
  const auto waited = [](int s) { return CpuTotals{seconds(s), nanoseconds(0), seconds(s)}; };
  answers.on_cpu(0, 77, waited(15), start + seconds(20));
  EXPECT_TRUE(answers.holds(0, start + seconds(20))) << "5 s of its own";
  EXPECT_FALSE(answers.holds(0, start + seconds(23)));
  answers.on_cpu(0, 77, waited(99), start + seconds(100));
  EXPECT_TRUE(answers.holds(0, start + seconds(37)));
  EXPECT_FALSE(answers.holds(0, start + seconds(38))) << "no excuse without end";
  answers.on_cpu(0, 78, waited(99), start + seconds(101));
  EXPECT_FALSE(answers.holds(0, start + seconds(20))) << "what another process waited is none";
}

TEST_F(CriticalAnswersTest, CountFromTheQuestionHoweverLongTheAnswerLayInAQueue) {
  const auto nonce = answers.ask(0, start);
  answers.on_answer(0, nonce, active);
  EXPECT_FALSE(answers.holds(0, start + seconds(8)));
}

TEST_F(CriticalAnswersTest, AreRefusedWithAnotherNonceAndASecondTime) {
  const auto stale = answers.ask(0, start);
  const auto fresh = answers.ask(0, start + seconds(1));
  answers.on_answer(0, stale, active);
  answers.on_answer(0, 0, active);
  EXPECT_FALSE(answers.holds(0, start + seconds(1)));
  answers.on_answer(1, fresh, active);
  EXPECT_FALSE(answers.holds(1, start + seconds(1))) << "the nonce of the question to another node";
  answers.on_answer(0, fresh, active);
  EXPECT_TRUE(answers.holds(0, start + seconds(1)));
  answers.on_answer(0, fresh, active);
  EXPECT_EQ(answers.counters().wrong_nonce, 4U);
  EXPECT_EQ(answers.counters().answered, 1U);
}

TEST_F(CriticalAnswersTest, AreRefusedFromAProcessOfTimingBeforeThisOne) {
  CriticalAnswers before({"can_switcher", "ttc"}, 4, seconds(7));
  const auto old = before.ask(0, start);
  (void)answers.ask(0, start);
  answers.on_answer(0, old, active);
  EXPECT_FALSE(answers.holds(0, start));
}

TEST_F(CriticalAnswersTest, AreRefusedFromEveryStateButActiveWhoeverWantedIt) {
  for (int state = 0; state <= UINT8_MAX; ++state) {
    if (state == active) continue;
    answers.on_answer(0, answers.ask(0, start), static_cast<std::uint8_t>(state));
    EXPECT_FALSE(answers.holds(0, start)) << state;
  }
  EXPECT_EQ(answers.counters().not_active, 255U);
  answers.on_answer(0, answers.ask(0, start), active);
  EXPECT_TRUE(answers.holds(0, start));
}

TEST_F(CriticalAnswersTest, OfANodeThatIsTakenOutOfActiveAgainAndAgainDoNotAddUp) {
  // Active for a moment each 20 s: the proofs hold for their lifetime and no longer.
  MonotonicTime now = start;
  for (int i = 0; i < 100; ++i, now += seconds(20)) {
    answers.on_answer(0, answers.ask(0, now), active);
    answers.on_answer(0, answers.ask(0, now + seconds(1)), inactive);
    EXPECT_TRUE(answers.holds(0, now + seconds(7)));
    EXPECT_FALSE(answers.holds(0, now + seconds(8)));
  }
}

TEST(WatchdogBudget, LeavesRoomForOneFullRecoveryOfTheRing) {
  const WatchdogBudget budget = watchdog_budget(milliseconds(100), 3, seconds(3));
  EXPECT_EQ(budget.recovery, milliseconds(4800));
  EXPECT_EQ(budget.evidence_lifetime, milliseconds(6800));
  EXPECT_EQ(budget.least_timeout, milliseconds(7800));

  const WatchdogBudget patient = watchdog_budget(milliseconds(500), 5, seconds(20));
  EXPECT_GT(patient.recovery, seconds(20));
  EXPECT_GT(patient.evidence_lifetime, patient.recovery);
  EXPECT_GT(patient.least_timeout, patient.evidence_lifetime);
}

}  // namespace
}  // namespace srfs
