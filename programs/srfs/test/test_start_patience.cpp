// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "programs/srfs/start_patience.hpp"

namespace srfs::tool {
namespace {

using ros::State;

constexpr seconds deadline{15};

class StartPatienceTest : public testing::Test {
 protected:
  /// The awaited nodes stay in @p state for @p time. Meanwhile the `cpu` of each grows by @p share of that
  /// time and `waited` by @p waiting of it.
  void pass(nanoseconds time, State state, double share = 0, pid_t pid = 7, double waiting = 0) {
    constexpr milliseconds step{100};
    const auto of_step = [&](double part) {
      return nanoseconds(static_cast<std::int64_t>(part * static_cast<double>(nanoseconds(step).count())));
    };
    for (nanoseconds passed{0}; passed < time; passed += step) {
      now_ += step;
      cpu_ += of_step(share);
      waited_ += of_step(waiting);
      patience_.on_readings({{"ttc", pid, state, cpu_, waited_}}, now_);
    }
  }
  MonotonicTime now_{seconds(100)};
  nanoseconds cpu_{0};
  nanoseconds waited_{0};
  StartPatience patience_{deadline, now_};
};

TEST_F(StartPatienceTest, WaitsLongerThanTheDeadlineForANodeThatGetsLittleCpuTime) {
  pass(3 * deadline, State::unknown, 0.01);
  pass(3 * deadline, State::configuring, 0.01);
  EXPECT_FALSE(patience_.is_over());
}

TEST_F(StartPatienceTest, EndsAfterTheDeadlineWithoutProgress) {
  pass(deadline, State::unknown);
  EXPECT_FALSE(patience_.is_over()) << "its appearance was progress";
  pass(milliseconds(100), State::unknown);
  EXPECT_TRUE(patience_.is_over());
}

TEST_F(StartPatienceTest, EachFurtherStateIsProgress) {
  for (const State state : {State::unconfigured, State::inactive, State::active}) {
    pass(deadline - seconds(1), state);
    EXPECT_FALSE(patience_.is_over());
  }
}

TEST_F(StartPatienceTest, ANodeThatFailsToConfigureAndTriesAgainMakesNoProgress) {
  pass(seconds(1), State::configuring, 0.5);
  for (int attempt = 0; attempt < 10 && !patience_.is_over(); ++attempt) {
    pass(seconds(2), State::unconfigured, 0.1);  // the node answers and waits for its next attempt
    pass(milliseconds(200), State::configuring);
  }
  EXPECT_TRUE(patience_.is_over());
  EXPECT_LT(now_ - MonotonicTime(seconds(100)), 2 * deadline);
}

TEST_F(StartPatienceTest, ANodeThatWorksAndDoesNotAnswerMakesNoProgress) {
  pass(deadline + seconds(1), State::active, 0.2);
  EXPECT_TRUE(patience_.is_over());
}

TEST_F(StartPatienceTest, TimeThatAnActiveNodeWaitsForACpuIsNotHeldAgainstIt) {
  pass(3 * deadline, State::active, 1, 7, 0.9);
  EXPECT_FALSE(patience_.is_over());
  pass(deadline, State::active, 0.1);
  EXPECT_TRUE(patience_.is_over()) << "it has CPUs now, and does not answer";
}

TEST(PatienceWithGone, IsThatOfTheRestarterWhichSpacesStartsUnderPressure) {
  EXPECT_EQ(patience_with_gone(false, 0.9, deadline), nanoseconds(0)) << "nobody starts it again";
  EXPECT_EQ(patience_with_gone(true, 0.1, deadline), seconds(4));
  EXPECT_EQ(patience_with_gone(true, std::nullopt, deadline), seconds(4));
  EXPECT_EQ(patience_with_gone(true, 0.9, deadline), deadline);
  EXPECT_EQ(patience_with_gone(true, 0.9, seconds(1)), seconds(4));
}

TEST_F(StartPatienceTest, ANodeThatDoesNotRunMakesNoProgress) {
  pass(deadline, State::unknown, 0, 0);
  EXPECT_TRUE(patience_.is_over());
}

TEST_F(StartPatienceTest, AProcessThatReplacesAnotherBeginsAnewTwice) {
  pass(seconds(1), State::configuring, 0.1, 7);
  for (const pid_t pid : {8, 9}) {
    pass(deadline - seconds(1), State::unknown, 0, pid);
    EXPECT_FALSE(patience_.is_over());
    pass(seconds(1), State::configuring, 0.1, pid);
  }
  pass(deadline, State::unknown, 0.1, 10);
  EXPECT_TRUE(patience_.is_over()) << "it dies and dies";
}

TEST_F(StartPatienceTest, OneNodeWithProgressIsEnough) {
  for (int i = 1; i <= 100; ++i) {
    patience_.on_readings(
        {{"ttc", 7, State::unconfigured, {}, {}}, {"timing", 8, State::unknown, milliseconds(i), {}}},
        now_ + i * seconds(1));
  }
  EXPECT_FALSE(patience_.is_over());
}

TEST_F(StartPatienceTest, EndsAfterTenDeadlinesInAnyCase) {
  pass(10 * deadline - seconds(1), State::configuring, 1);
  EXPECT_FALSE(patience_.is_over());
  pass(seconds(1), State::configuring, 1);
  EXPECT_TRUE(patience_.is_over());
}

TEST_F(StartPatienceTest, TimeInWhichNothingWasReadIsThisProgramsOwnWait) {
  pass(seconds(1), State::unconfigured);
  now_ += 3 * deadline;
  pass(seconds(1), State::unconfigured);
  EXPECT_FALSE(patience_.is_over());
  EXPECT_LT(patience_.idle(), seconds(4));
}

}  // namespace
}  // namespace srfs::tool
