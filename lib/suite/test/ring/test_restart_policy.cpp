// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "suite/ring/restart_policy.hpp"

namespace srfs::suite {
namespace {

using Step = RestartDecision::Step;

constexpr MonotonicTime boot(seconds(100));

RingSettings settings() {
  RingSettings s;
  s.restarts = 3;
  s.window = seconds(60);
  s.first_wait = seconds(1);
  s.longest_wait = seconds(8);
  s.quarantine_deaths = 7;
  return s;
}

/// A node that lives for a given time after each start and is restarted as soon as the policy permits.
struct Loop {
  DeathHistory history;
  MonotonicTime now = boot;
  RestartDecision last;

  void start() { count_start(history, now); }
  /// @return the time for which the policy kept the node down
  nanoseconds die_and_start(nanoseconds life) {
    now += life;
    count_death(history, settings(), now);
    last = decide(history, settings());
    const nanoseconds wait = std::max(last.not_before - now, nanoseconds(0));
    now += wait;
    start();
    return wait;
  }
};

TEST(RestartPolicy, StartsAtOnceAsLongAsDeathsAreFew) {
  Loop loop;
  loop.start();
  EXPECT_EQ(loop.die_and_start(milliseconds(1)), seconds(0));
  EXPECT_EQ(loop.die_and_start(milliseconds(1)), seconds(0));
  EXPECT_EQ(loop.last.step, Step::start);
}

TEST(RestartPolicy, WaitsFromTheThirdDeathOnTwiceAsLongEachTimeUpToTheLongest) {
  Loop loop;
  loop.start();
  loop.die_and_start(nanoseconds(0));
  loop.die_and_start(nanoseconds(0));
  for (const int expected : {1, 2, 4, 8}) {
    EXPECT_EQ(loop.die_and_start(nanoseconds(0)), seconds(expected));
    EXPECT_EQ(loop.last.step, Step::back_off);
  }
}

TEST(RestartPolicy, CountsTheWaitFromTheStartBeforeSoThatALongLifeNeedsNone) {
  Loop loop;
  loop.start();
  for (int i = 0; i < 3; ++i) loop.die_and_start(seconds(5));
  EXPECT_EQ(loop.last.step, Step::back_off);
  EXPECT_EQ(loop.last.deaths, 3);
  EXPECT_EQ(loop.die_and_start(seconds(5)), seconds(0));  // permitted since 2 s after the last start
}

TEST(RestartPolicy, QuarantinesAndThenTriesSlowlyForEverHoweverLongTheWaitsAre) {
  Loop loop;
  loop.start();
  for (int i = 0; i < 6; ++i) loop.die_and_start(milliseconds(10));
  for (int i = 0; i < 50; ++i) {
    EXPECT_EQ(loop.die_and_start(milliseconds(10)), seconds(8) - milliseconds(10));
    EXPECT_EQ(loop.last.step, Step::quarantine) << i;
  }
}

TEST(RestartPolicy, ForgetsEverythingAboutANodeThatLivedForTheWindow) {
  Loop loop;
  loop.start();
  for (int i = 0; i < 10; ++i) loop.die_and_start(milliseconds(10));
  ASSERT_EQ(loop.last.step, Step::quarantine);
  loop.die_and_start(seconds(60));
  EXPECT_EQ(loop.last.step, Step::start);
  EXPECT_EQ(loop.last.deaths, 1);
}

TEST(RestartPolicy, CountsOneDeathOnceHoweverOftenItIsReported) {
  DeathHistory history;
  count_start(history, boot);
  for (int i = 0; i < 5; ++i) count_death(history, settings(), boot + seconds(1 + i));
  EXPECT_EQ(history.total, 1U);
  EXPECT_EQ(decide(history, settings()).deaths, 1);
}

TEST(RestartPolicy, TakesADeathWithoutAKnownStartAsTheFirst) {
  DeathHistory history;
  count_death(history, settings(), boot);
  EXPECT_EQ(decide(history, settings()).step, Step::start);
}

TEST(RestartPolicy, AsksForTheLastGoodVersionBeforeAnyWaitingWhenOneDiesInItsProbation) {
  Loop loop;
  loop.start();
  for (int i = 0; i < 10; ++i) loop.die_and_start(milliseconds(10));
  ASSERT_EQ(loop.last.step, Step::quarantine);
  const auto decision = decide(loop.history, settings(), VersionTrial{3, seconds(60), seconds(59)});
  EXPECT_EQ(decision.step, Step::last_good);
  EXPECT_EQ(decision.not_before, MonotonicTime());
}

TEST(RestartPolicy, NeverAsksForTheLastGoodVersionAfterTheProbation) {
  DeathHistory history;
  count_death(history, settings(), boot);
  EXPECT_EQ(decide(history, settings(), VersionTrial{3, seconds(60), seconds(60)}).step, Step::start);
  EXPECT_EQ(decide(history, settings(), VersionTrial{3, seconds(0), seconds(0)}).step, Step::start);
}

TEST(RestartPolicy, NeverKeepsAVersionThatTheOperatorHasToConfirmHoweverLongItLived) {
  DeathHistory history;
  count_death(history, settings(), boot);
  EXPECT_EQ(decide(history, settings(), VersionTrial{3, seconds(60), seconds(600), true}).step,
            Step::last_good);
}

TEST(RestartPolicy, HoldsItsBoundsInRandomLives) {
  // A window never contains more than quarantine_deaths starts, except for nodes that live long. No wait
  // exceeds the longest wait. The history does not grow.
  std::uint32_t random = 12345;
  Loop loop;
  loop.start();
  for (int i = 0; i < 20000; ++i) {
    random = random * 1664525U + 1013904223U;
    const auto wait = loop.die_and_start(milliseconds((random >> 8) % 30000));
    EXPECT_LE(wait, settings().longest_wait);
    EXPECT_TRUE(std::is_sorted(loop.history.deaths.begin(), loop.history.deaths.end()));
    EXPECT_LE(loop.history.lived - loop.history.deaths.front(), settings().window);
    EXPECT_EQ(decode_history(encode(loop.history)), loop.history);
  }
}

TEST(DeathHistoryText, IsReadBackOrNotAtAll) {
  Loop loop;
  loop.start();
  for (int i = 0; i < 4; ++i) loop.die_and_start(milliseconds(10));
  const std::string text = encode(loop.history);
  EXPECT_EQ(decode_history(text), loop.history);
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string damaged = text;
    damaged[i] = static_cast<char>(damaged[i] ^ 1);
    EXPECT_FALSE(decode_history(damaged)) << i;
    EXPECT_FALSE(decode_history(text.substr(0, i))) << i;
  }
}

}  // namespace
}  // namespace srfs::suite
