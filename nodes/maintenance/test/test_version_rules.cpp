// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/version_rules.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

constexpr MonotonicTime started{seconds(100)};

struct VersionRules : testing::Test {
  update::VersionTable table;
  update::VersionNumber trial = table.add(std::string(64, 'a'), 1, "uplinked", UtcTime());
  VersionRules() { EXPECT_TRUE(table.use(trial, seconds(300), "")); }
};

TEST_F(VersionRules, TheGoldenVersionIsAlwaysThereAndAnotherOnlyIfItIsInTheTable) {
  EXPECT_EQ(version_to_use(table, update::golden), update::golden);
  EXPECT_EQ(version_to_use(table, trial), trial);
  EXPECT_EQ(version_to_use(table, 77), std::nullopt);
}

TEST_F(VersionRules, WithoutANumberThePreviousOneIsMeantIfThereIsOne) {
  EXPECT_EQ(version_to_use(table, std::nullopt), update::golden);
  EXPECT_EQ(version_to_use({}, std::nullopt), std::nullopt);
}

TEST_F(VersionRules, AConfirmationCountsOnlyIfItWasAcceptedAfterTheVersionWasStarted) {
  const MonotonicTime before = started - seconds(1);
  EXPECT_EQ(judge_confirmation(table, trial, started, true, before), mission::failure::confirmed_too_early);
  EXPECT_EQ(judge_confirmation(table, trial, started, true, started), std::nullopt);
  EXPECT_EQ(judge_confirmation(table, trial, started, false, before), std::nullopt)
      << "the ring judges this node";
}

TEST_F(VersionRules, OnlyAVersionThatRunsIsConfirmed) {
  EXPECT_EQ(judge_confirmation(table, trial, std::nullopt, false, started),
            mission::failure::version_not_running);
  EXPECT_EQ(judge_confirmation(table, 77, started, false, started), mission::failure::no_version);
}

TEST_F(VersionRules, AConfirmationThatIsRepeatedIsNoFailure) {
  ASSERT_TRUE(table.commit(trial));
  EXPECT_EQ(judge_confirmation(table, trial, std::nullopt, true, MonotonicTime()), mission::failure::none);
}

TEST_F(VersionRules, AnAddedNodeLeavesOnceItHasNoVersionThatIsGood) {
  EXPECT_EQ(why_removed(table), std::nullopt);
  ASSERT_TRUE(table.fail(trial, "died in its probation"));
  EXPECT_EQ(why_removed(table), "rolled back: died in its probation");
  EXPECT_EQ(why_removed({}), "no version left");
}

TEST(LimitViolation, CountsUntilTheProbationHasEnded) {
  const auto trial = [](seconds lived, bool to_confirm) {
    return suite::VersionTrial{
        .version = 1, .probation = seconds(300), .lived = lived, .to_confirm = to_confirm};
  };
  EXPECT_FALSE(is_on_probation(std::nullopt));
  EXPECT_TRUE(is_on_probation(trial(seconds(299), false)));
  EXPECT_FALSE(is_on_probation(trial(seconds(300), false)));
  EXPECT_TRUE(is_on_probation(trial(seconds(300), true))) << "until it is confirmed";
}

}  // namespace
}  // namespace srfs
