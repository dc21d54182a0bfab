// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/suite_commands.hpp"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "base/file.hpp"
#include "msgs/mission/dictionary.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

using SaveRequest = srfs_msgs::srv::SaveParameters_Request;
using SaveResponse = srfs_msgs::srv::SaveParameters_Response;
using SetResponse = rcl_interfaces::srv::SetParameters_Response;

struct SuiteCommandsTest : testing::Test {
  testing_support::TemporaryFolder folder;
  suite::Deployment deployment = load();

  [[nodiscard]] suite::Deployment load() const {
    EXPECT_TRUE(write_file_atomically(
        folder.path() / "d.yaml",
        "deployment: t\n"
        "link: { spacecraft_id: 0xAB, tc_channels: [{ vc: 1, security: none }] }\n"
        "nodes: [{ name: payload_eps, executable: payload_eps_node }, { name: ttc, executable: ttc_node },\n"
        "        { name: payload_impact, executable: payload_impact_node }]\n"));
    suite::Deployment loaded = suite::Deployment::load(folder.path() / "d.yaml");
    loaded.nodes.back().added = true;
    loaded.ring.confirmed = {"ttc"};
    return loaded;
  }
  template <class Command>
  [[nodiscard]] FailureCode check(const Command& command) const {
    return check_command(Command::function_id, command.encoded(), deployment);
  }
  template <class Command>
  [[nodiscard]] SuiteActions actions(const Command& command,
                                     MonotonicTime expiry = MonotonicTime(seconds(60))) const {
    StoredTelecommand telecommand;
    telecommand.function = Command::function_id;
    telecommand.expiry = expiry;
    telecommand.arguments = command.encoded();
    return actions_of(telecommand, deployment);
  }
};

StoredTelecommand stored(std::uint16_t function, Octets arguments) {
  StoredTelecommand telecommand;
  telecommand.function = function;
  telecommand.arguments = std::move(arguments);
  return telecommand;
}

template <class Action>
Action only(const SuiteActions& actions) {
  EXPECT_EQ(actions.size(), 1U);
  if (actions.size() != 1 || !std::holds_alternative<Action>(actions[0])) {
    ADD_FAILURE() << "another action";
    return {};
  }
  return std::get<Action>(actions[0]);
}

FailureCode answer_of(const SuiteActions& actions) {
  const auto* const answer = std::get_if<AnswerTelecommand>(&actions.back());
  EXPECT_NE(answer, nullptr);
  return answer == nullptr ? mission::failure::none : answer->code;
}

TEST_F(SuiteCommandsTest, EveryTelecommandOfTheDictionaryHasItsHandler) {
  const auto dictionary = mission::Dictionary::load(mission::Dictionary::default_folder());
  int functions = 0;
  for (const mission::Command& command : dictionary.commands()) {
    if (command.apid != mission::RingHold::apid || !command.is_function()) continue;
    EXPECT_NE(check_command(command.function_id, {}, deployment), mission::failure::unknown_function)
        << command.name;
    ++functions;
  }
  EXPECT_GT(functions, 20);
  EXPECT_EQ(check_command(999, {}, deployment), mission::failure::unknown_function);
}

TEST_F(SuiteCommandsTest, AreRefusedWithArgumentsThatCannotBe) {
  EXPECT_EQ(check_command(mission::RingHold::function_id, {}, deployment),
            mission::failure::bad_arguments_length);
  Octets no_level = mission::NodeSetLogLevel{.node = "ttc"}.encoded();
  no_level.back() = 9;
  EXPECT_EQ(check_command(mission::NodeSetLogLevel::function_id, no_level, deployment),
            mission::failure::bad_argument);
  Octets longer = mission::RingRelease{.node = "ttc"}.encoded();
  longer.push_back(0);
  EXPECT_EQ(check_command(mission::RingRelease::function_id, longer, deployment),
            mission::failure::bad_arguments_length);
  EXPECT_EQ(check(mission::RingRelease{.node = "nobody"}), mission::failure::unknown_node);
  EXPECT_EQ(check(mission::ParametersKeep{.node = "nobody"}), mission::failure::unknown_node);
  EXPECT_EQ(check(mission::RingRelease{.node = "payload_eps"}), mission::failure::none);
}

TEST_F(SuiteCommandsTest, NoNodeOfTheCommandPathIsTakenAway) {
  EXPECT_EQ(check(mission::RingHold{.node = "ttc"}), mission::failure::on_command_path);
  EXPECT_EQ(check(mission::RingReleaseInactive{.node = "ttc"}), mission::failure::on_command_path);
  EXPECT_EQ(check(mission::RingRestoreOrders{.node = "ttc"}), mission::failure::on_command_path);
  EXPECT_EQ(check(mission::RingRelease{.node = "ttc"}), mission::failure::none);
  EXPECT_EQ(check(mission::RingHold{.node = "payload_eps"}), mission::failure::none);
}

TEST_F(SuiteCommandsTest, OfAnotherVersionOfThisProgramAreAnsweredAndNotExecuted) {
  EXPECT_EQ(answer_of(actions_of(stored(999, {}), deployment)), mission::failure::unknown_function);
  EXPECT_NE(answer_of(actions_of(stored(mission::NodeUseVersion::function_id, {1}), deployment)),
            mission::failure::none);
}

TEST_F(SuiteCommandsTest, WhatLeavesNothingToDecideIsTheActionItself) {
  EXPECT_EQ(only<mission::RingHold>(actions(mission::RingHold{.node = "payload_eps"})).node, "payload_eps");
  EXPECT_EQ(only<mission::RingReportFaults>(actions(mission::RingReportFaults{.count = 7})).count, 7);
  EXPECT_FALSE(only<mission::PackageInstall>(actions(mission::PackageInstall{.file = "f", .activate = false}))
                   .activate);
}

TEST_F(SuiteCommandsTest, AVersionGetsTheProbationOfItsNodeUnlessOneIsCommanded) {
  const auto probation = [&](const std::string& node, std::uint32_t commanded_s) {
    return only<UseVersion>(
               actions(mission::NodeUseVersion{.node = node, .version = 2, .probation_s = commanded_s}))
        .probation;
  };
  EXPECT_EQ(probation("payload_eps", 20), seconds(20));
  EXPECT_EQ(probation("payload_eps", 0), update::VersionTable::default_probation);
  EXPECT_EQ(probation("ttc", 0), update::VersionTable::default_confirmed_probation);
  const auto previous = only<UseVersion>(actions(mission::NodePreviousVersion{.node = "ttc"}));
  EXPECT_EQ(previous.version, std::nullopt);
  EXPECT_EQ(previous.probation, update::VersionTable::default_confirmed_probation);
}

TEST_F(SuiteCommandsTest, AConfirmationKnowsWhenTtcAcceptedIt) {
  const auto confirm = only<ConfirmVersion>(
      actions(mission::NodeConfirmVersion{.node = "ttc", .version = 3}, MonotonicTime(seconds(60))));
  EXPECT_EQ(confirm.version, 3U);
  EXPECT_EQ(confirm.accepted, MonotonicTime(seconds(60)) - mission::NodeConfirmVersion::timeout);
}

TEST_F(SuiteCommandsTest, TheNewestReportOfADeathIsSentUnlessOneIsNamed) {
  const auto incarnation = [&](std::uint32_t number) {
    return only<SendCrashReport>(actions(mission::NodeSendReport{.node = "ttc", .incarnation = number}))
        .incarnation;
  };
  EXPECT_EQ(incarnation(UINT32_MAX), std::nullopt);
  EXPECT_EQ(incarnation(4), 4U);
}

TEST_F(SuiteCommandsTest, OnlyAnAddedNodeIsRemovedAndOneThatIsGoneAgain) {
  EXPECT_EQ(answer_of(actions(mission::NodeRemove{.node = "payload_eps"})), mission::failure::not_added);
  EXPECT_EQ(only<mission::NodeRemove>(actions(mission::NodeRemove{.node = "payload_impact"})).node,
            "payload_impact");
  EXPECT_EQ(only<mission::NodeRemove>(actions(mission::NodeRemove{.node = "gone"})).node, "gone");
}

TEST_F(SuiteCommandsTest, ScrubbingIsAskedForAndTheTelecommandHasEnded) {
  const auto run = actions(mission::ScrubRun{});
  ASSERT_EQ(run.size(), 2U);
  EXPECT_FALSE(std::get<RunScrubbing>(run[0]).retake);
  EXPECT_EQ(answer_of(run), mission::failure::none);
  EXPECT_TRUE(std::get<RunScrubbing>(actions(mission::ScrubRetake{})[0]).retake);
}

TEST_F(SuiteCommandsTest, LevelsOfTheLogHaveTheirNames) {
  EXPECT_EQ(
      only<SetLogLevel>(actions(mission::NodeSetLogLevel{.node = "ttc", .level = mission::LogSeverity::warn}))
          .level,
      "warn");
}

TEST_F(SuiteCommandsTest, ParametersAreAskedOfTheirNode) {
  const auto restore =
      only<SaveNodeParameters>(actions(mission::ParametersRestore{.node = "ttc", .generation = 5}));
  EXPECT_EQ(restore.node, "ttc");
  EXPECT_EQ(restore.request.operation, SaveRequest::RESTORE);
  EXPECT_EQ(restore.request.generation, 5U);
  EXPECT_EQ(restore.request.origin, "telecommand");
  EXPECT_EQ(
      only<SaveNodeParameters>(actions(mission::ParametersFactoryReset{.node = "ttc"})).request.operation,
      SaveRequest::RESET);
}

TEST(SuiteCommandsAnswers, OfParametersSaySilenceRefusalAndHistory) {
  SaveNodeParameters asked{.node = "ttc", .request = {}};
  asked.request.operation = SaveRequest::KEEP;
  EXPECT_EQ(answer_of(on_saved(asked, nullptr)), mission::failure::node_silent);

  SaveResponse refused;
  refused.reason = "no such set";
  const auto actions = on_saved(asked, &refused);
  ASSERT_EQ(actions.size(), 2U);
  EXPECT_EQ(std::get<ReportParametersRefused>(actions[0]).reason, "no such set");
  EXPECT_EQ(answer_of(actions), mission::failure::parameters_refused);

  SaveResponse done;
  done.success = true;
  EXPECT_EQ(answer_of(on_saved(asked, &done)), mission::failure::none);
  asked.request.operation = SaveRequest::REPORT;
  const auto history = only<SendLines>(on_saved(asked, &done));
  ASSERT_EQ(history.lines.size(), 1U) << "the deployment's values";
  EXPECT_EQ(history.lines[0].structure_id, mission::ParameterGenerationHousekeeping::structure_id);
}

TEST(SuiteCommandsAnswers, OfALogLevelSaySilenceAndWhyItWasNotSet) {
  EXPECT_EQ(answer_of(on_log_level_set(nullptr)), mission::failure::node_silent);
  SetResponse answer;
  EXPECT_EQ(std::get<LogFailure>(on_log_level_set(&answer)[0]).text, "log_level: no result");
  answer.results.emplace_back();
  answer.results[0].reason = "read-only";
  const auto actions = on_log_level_set(&answer);
  EXPECT_EQ(std::get<LogFailure>(actions[0]).text, "log_level: read-only");
  EXPECT_EQ(answer_of(actions), mission::failure::not_done);
  answer.results[0].successful = true;
  EXPECT_EQ(answer_of(on_log_level_set(&answer)), mission::failure::none);
}

TEST_F(SuiteCommandsTest, WhateverOctetsArriveTheyAreRefusedOrHaveActionsThatEndThem) {
  std::mt19937 random(5);
  int executed = 0;
  for (int i = 0; i < 20'000; ++i) {
    StoredTelecommand telecommand = stored(static_cast<std::uint16_t>(random() % 40), Octets(random() % 60));
    for (auto& octet : telecommand.arguments)
      octet = static_cast<std::uint8_t>(random() % 4 == 0 ? random() : 0);
    const auto actions = actions_of(telecommand, deployment);
    ASSERT_FALSE(actions.empty());
    const bool answered = std::holds_alternative<AnswerTelecommand>(actions.back());
    if (check_command(telecommand.function, telecommand.arguments, deployment) == mission::failure::none)
      ++executed;
    ASSERT_TRUE(answered || actions.size() == 1) << "its only action ends it";
  }
  EXPECT_GT(executed, 20);
}

}  // namespace
}  // namespace srfs
