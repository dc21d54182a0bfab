// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/suite_files.hpp"

#include <gtest/gtest.h>

#include "base/file.hpp"
#include "suite/crash_report.hpp"
#include "suite/node_versions.hpp"
#include "suite/ring/fault_ledger.hpp"
#include "suite/ring/node_record.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

const std::string eps = "payload_eps";

struct SuiteFilesTest : testing::Test {
  testing_support::TemporaryFolder folder;
  SuiteFiles suite{suite::VarPaths::at(folder.path()), load(), "maintenance"};

  [[nodiscard]] suite::Deployment load() const {
    EXPECT_TRUE(
        write_file_atomically(folder.path() / "d.yaml",
                              "deployment: t\n"
                              "link: { spacecraft_id: 0xAB, tc_channels: [{ vc: 1, security: none }] }\n"
                              "nodes: [{ name: payload_eps, executable: payload_eps_node }]\n"));
    return suite::Deployment::load(folder.path() / "d.yaml");
  }
  SuiteFilesTest() { suite.var.make_run_folder(); }
  ~SuiteFilesTest() override { std::filesystem::remove_all(suite.var.memory()); }
  /// A candidate among the versions of payload_eps.
  [[nodiscard]] update::VersionNumber add_version() const {
    const auto program = folder.path() / "program";
    EXPECT_TRUE(write_file_atomically(program, "a program"));
    update::VersionNumber number = update::golden;
    const auto added =
        suite::change_versions(suite.var, eps, [&](update::VersionStore& store) -> Result<void, std::string> {
          const auto stored = store.add(program, "by a test", UtcTime(seconds(1)));
          if (!stored) return Err(stored.error());
          number = *stored;
          return {};
        });
    EXPECT_TRUE(added) << added.error();
    return number;
  }
  template <class Order>
  [[nodiscard]] FailureCode outcome(const Order& order) const {
    const auto actions = perform(order, suite);
    const auto* const answer = std::get_if<AnswerTelecommand>(&actions.back());
    EXPECT_NE(answer, nullptr);
    return answer == nullptr ? mission::failure::none : answer->code;
  }
};

TEST_F(SuiteFilesTest, ANodeIsHeldUntilItIsReleased) {
  EXPECT_EQ(outcome(mission::RingHold{.node = eps}), mission::failure::none);
  EXPECT_EQ(suite::held_because(suite.var, suite.deployment, eps, monotonic_now()), "held by telecommand");
  EXPECT_EQ(outcome(mission::RingHold{.node = eps}), mission::failure::none) << "again";
  EXPECT_EQ(outcome(mission::RingRelease{.node = eps}), mission::failure::none);
  EXPECT_EQ(suite::held_because(suite.var, suite.deployment, eps, monotonic_now()), std::nullopt);
}

TEST_F(SuiteFilesTest, ANodeThatIsDownIsReleasedInactive) {
  EXPECT_EQ(outcome(mission::RingHold{.node = eps}), mission::failure::none);
  EXPECT_EQ(outcome(mission::RingReleaseInactive{.node = eps}), mission::failure::none);
  EXPECT_EQ(suite::desired_state(suite.var, suite.deployment, eps, monotonic_now()).state,
            ros::State::inactive);
  EXPECT_EQ(suite::held_because(suite.var, suite.deployment, eps, monotonic_now()), std::nullopt);
}

TEST_F(SuiteFilesTest, TheNewestFaultsAreReportedTheOldestOfThemFirst) {
  const suite::FaultLedger ledger(suite.var);
  for (const char* subject : {"ttc", "timing", "payload_eps"}) {
    suite::FaultRecord record;
    record.subject = subject;
    ASSERT_TRUE(ledger.append(record));
  }
  const auto actions = perform(mission::RingReportFaults{.count = 2}, suite);
  ASSERT_EQ(actions.size(), 1U);
  const auto& lines = std::get<SendLines>(actions[0]).lines;
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(mission::RingFaultHousekeeping::decode(lines[0].data)->node, "timing");
  EXPECT_EQ(mission::RingFaultHousekeeping::decode(lines[1].data)->node, "payload_eps");
  EXPECT_EQ(std::get<SendLines>(perform(mission::RingReportFaults{.count = 9}, suite)[0]).lines.size(), 3U);
}

TEST_F(SuiteFilesTest, VersionsAreReportedTheGoldenOneFirst) {
  const auto number = add_version();
  const auto actions = perform(mission::NodeReportVersions{.node = eps}, suite);
  const auto& lines = std::get<SendLines>(actions.at(0)).lines;
  ASSERT_EQ(lines.size(), 2U);
  EXPECT_EQ(mission::NodeVersionHousekeeping::decode(lines[0].data)->version, update::golden);
  EXPECT_EQ(mission::NodeVersionHousekeeping::decode(lines[1].data)->version, number);
}

TEST_F(SuiteFilesTest, AVersionIsRemovedOnceAndThenItIsGone) {
  const auto number = add_version();
  EXPECT_EQ(outcome(mission::NodeRemoveVersion{.node = eps, .version = number}), mission::failure::none);
  EXPECT_EQ(outcome(mission::NodeRemoveVersion{.node = eps, .version = number}),
            mission::failure::no_version);
}

TEST_F(SuiteFilesTest, AVersionOfANodeThatDoesNotRunIsUsedFromItsNextStartOn) {
  const auto number = add_version();
  EXPECT_EQ(outcome(UseVersion{eps, number, seconds(60)}), mission::failure::none);
  EXPECT_EQ(suite::read_versions(suite.var, eps).table.active(), number);
  EXPECT_EQ(outcome(ConfirmVersion{eps, number, MonotonicTime(seconds(1))}),
            mission::failure::version_not_running);
  EXPECT_EQ(outcome(UseVersion{eps, std::nullopt, seconds(60)}), mission::failure::none) << "back to golden";
  EXPECT_EQ(suite::read_versions(suite.var, eps).table.active(), update::golden);
}

TEST_F(SuiteFilesTest, AVersionOrANodeThatIsNotThereIsNotUsed) {
  EXPECT_EQ(outcome(UseVersion{eps, 9, seconds(60)}), mission::failure::no_version);
  EXPECT_EQ(outcome(UseVersion{eps, std::nullopt, seconds(60)}), mission::failure::no_version);
  EXPECT_EQ(outcome(UseVersion{"gone", 1, seconds(60)}), mission::failure::unknown_node)
      << "it was removed after the telecommand was accepted";
}

TEST_F(SuiteFilesTest, ThisProcessEndsForAnotherVersionOfItself) {
  suite.own_node = eps;
  const auto actions = perform(UseVersion{eps, add_version(), seconds(60)}, suite);
  ASSERT_EQ(actions.size(), 2U);
  EXPECT_EQ(std::get<AnswerTelecommand>(actions[0]).code, mission::failure::none) << "its report first";
  EXPECT_TRUE(std::holds_alternative<EndOwnProcess>(actions[1]));
}

TEST_F(SuiteFilesTest, KilledBeforeItsAnswerWhatIsExecutedAgainEndsTheSameWay) {
  const auto number = add_version();
  const auto expect_same_end = [&](const auto& order, FailureCode end) {
    (void)perform(order, suite);  // its answer is lost with the process
    EXPECT_EQ(outcome(order), end);
  };
  expect_same_end(mission::RingHold{.node = eps}, mission::failure::none);
  expect_same_end(mission::RingRelease{.node = eps}, mission::failure::none);
  expect_same_end(mission::RingReleaseInactive{.node = eps}, mission::failure::none);
  expect_same_end(UseVersion{eps, number, seconds(60)}, mission::failure::none);
  expect_same_end(UseVersion{eps, update::golden, seconds(60)}, mission::failure::none);
}

TEST_F(SuiteFilesTest, AReportOfADeathThatIsNotThereIsNotSent) {
  EXPECT_EQ(outcome(SendCrashReport{eps, std::nullopt}), mission::failure::no_report);
}

TEST_F(SuiteFilesTest, ANodeThatWasNotAddedIsNotRemoved) {
  const auto actions = perform(mission::NodeRemove{.node = eps}, suite);
  ASSERT_EQ(actions.size(), 2U);
  EXPECT_FALSE(std::get<LogFailure>(actions[0]).text.empty());
  EXPECT_EQ(std::get<AnswerTelecommand>(actions[1]).code, mission::failure::not_done);
}

}  // namespace
}  // namespace srfs
