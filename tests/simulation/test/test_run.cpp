// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "tests/build_kind.hpp"
#include "tests/simulation/run.hpp"

namespace srfs::simulation {
namespace {

constexpr std::uint64_t last_seed = testing_support::slow ? 1 : 8;

RunOutcome fly(std::uint64_t seed, nanoseconds duration, const FaultSet& faults) {
  return run({.seed = seed, .faults = faults, .duration = duration});
}

/// Long enough for a storm of faults and the calm behind it; a part of the storm where that takes minutes.
TEST(Simulation, TheInvariantsHoldUnderTheFaultsOfEverySeed) {
  constexpr seconds length{testing_support::slow ? 200 : 900};
  for (std::uint64_t seed = 1; seed <= last_seed; ++seed) {
    const RunOutcome outcome = fly(seed, length, swarm_of(seed));
    ASSERT_FALSE(outcome.violation) << "seed " << seed << ": " << outcome.violation->requirement << ": "
                                    << outcome.violation->text << "\n"
                                    << outcome.diagram;
    EXPECT_GT(outcome.slots, 7000U * static_cast<std::uint64_t>(length.count()) / 900) << "seed " << seed;
  }
}

/// Each found a defect of the product.
TEST(Simulation, WhatFailedOnceHolds) {
  if (testing_support::slow) GTEST_SKIP() << "minutes here; the release build flies it";
  struct Case {
    std::uint64_t seed;
    const char* faults;
    seconds duration;
  };
  // 108: the disk lacked that a by_id command was executed, the peripheral lost its ids, the node restarted.
  const std::vector<Case> cases{
      {108, "kill,kill_at_action,late_messages,failing_disk,babbling_peripheral,bus_errors,bus_off",
       seconds(2200)},
      // 18: while the disk failed a file was sent; the next process gave its number to another file, which
      // the ground took for the first one.
      {18,
       "stop,starve,late_messages,slow_disk,failing_disk,power_cut,silent_peripheral,garbled_peripheral,"
       "babbling_peripheral,bus_errors,line_noise,gps",
       seconds(500)}};
  for (const Case& c : cases) {
    const RunOutcome outcome = fly(c.seed, c.duration, *faults_from(c.faults));
    EXPECT_FALSE(outcome.violation) << "seed " << c.seed << ": " << outcome.violation->text;
  }
}

TEST(Simulation, ASeedGivesTheSameRunAgainAndAnotherOneAnother) {
  constexpr seconds length{testing_support::slow ? 20 : 300};
  const RunOutcome one = fly(8, length, swarm_of(8));
  const RunOutcome again = fly(8, length, swarm_of(8));
  const RunOutcome other = fly(9, length, swarm_of(8));
  EXPECT_EQ(one.hash, again.hash);
  EXPECT_EQ(one.steps, again.steps);
  EXPECT_NE(one.hash, other.hash);
}

TEST(Simulation, WithoutFaultsEveryTickHasItsSlotAndNoProcessIsStartedTwice) {
  if (testing_support::slow) GTEST_SKIP() << "minutes here; the release build flies it";
  const RunOutcome outcome = fly(16, seconds(600), {});
  ASSERT_FALSE(outcome.violation);
  // An installation starts its node anew, and once more where the new version is taken back.
  EXPECT_GE(outcome.starts, 9U + outcome.installed);
  EXPECT_LE(outcome.starts, 9U + 2 * outcome.packages);
  EXPECT_EQ(outcome.boots, 1U);
  EXPECT_GT(outcome.slots + 5 * (outcome.starts - 9), 5980U);
}

TEST(Simulation, StoresFilesScheduleAndPackagesTakePart) {
  if (testing_support::slow) GTEST_SKIP() << "a minute here; the release build flies it";
  const RunOutcome outcome = fly(8, seconds(800), *faults_from("kill,power_cut,line_noise"));
  ASSERT_FALSE(outcome.violation) << outcome.violation->requirement << ": " << outcome.violation->text;
  EXPECT_GT(outcome.stored, 200U);
  EXPECT_GT(outcome.retrieved, 3U);
  EXPECT_GT(outcome.released, 5U);
  EXPECT_GT(outcome.files, 5U);
  EXPECT_GT(outcome.installed, 1U);
}

TEST(Simulation, ThePlotChangesNothingOfTheRun) {
  std::string svg;
  const RunSettings settings{
      .seed = 8, .faults = swarm_of(8), .duration = seconds(testing_support::slow ? 30 : 120)};
  RunSettings plotted = settings;
  plotted.plot = &svg;
  EXPECT_EQ(run(settings).hash, run(plotted).hash);
  EXPECT_EQ(svg.find("<svg"), 0U);
  EXPECT_NE(svg.find("</svg>"), std::string::npos);
}

TEST(Simulation, FaultsAreInjectedAndProcessesAndComputerComeBack) {
  if (testing_support::slow) GTEST_SKIP() << "minutes here; the release build flies it";
  const RunOutcome outcome = fly(8, seconds(600), FaultSet().set());
  ASSERT_FALSE(outcome.violation);
  EXPECT_GT(outcome.faults, 100U);
  EXPECT_GT(outcome.starts, 40U);
  EXPECT_GT(outcome.boots, 1U);
}

}  // namespace
}  // namespace srfs::simulation
