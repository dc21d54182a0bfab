// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/suite_commands.hpp"

#include <algorithm>
#include <array>
#include <type_traits>

#include <fmt/format.h>

#include "nodes/maintenance/generation_line.hpp"
#include "suite/commanding/command_set.hpp"
#include "suite/node_versions.hpp"

namespace srfs {
namespace {

using SaveRequest = srfs_msgs::srv::SaveParameters_Request;

constexpr std::uint32_t newest_report = UINT32_MAX;
constexpr const char* save_origin = "telecommand";

template <class Command>
FailureCode check(OctetView arguments, const suite::Deployment& deployment) {
  const auto command = Command::decode(arguments);
  if (!command) return failure_code(command.error());
  if constexpr (requires { command->node; }) {
    if (deployment.find(command->node) == nullptr) return mission::failure::unknown_node;
  }
  // Down or Inactive by telecommand, such a node could not be brought back by telecommand.
  constexpr bool takes_away = std::is_same_v<Command, mission::RingHold> ||
                              std::is_same_v<Command, mission::RingReleaseInactive> ||
                              std::is_same_v<Command, mission::RingRestoreOrders>;
  if constexpr (takes_away) {
    if (deployment.on_command_path(command->node)) return mission::failure::on_command_path;
  }
  return mission::failure::none;
}

/// What is known beside the arguments.
struct Context {
  const StoredTelecommand& telecommand;
  const suite::Deployment& deployment;
};

struct Handler {
  std::uint16_t function;
  FailureCode (*check)(OctetView arguments, const suite::Deployment& deployment);
  SuiteActions (*decide)(const Context& context);
};

/// @param decide  takes the command and its context, returns the actions
template <class Command, class Decide>
constexpr Handler on(Decide /*decide*/) {
  return {Command::function_id, &check<Command>, [](const Context& context) -> SuiteActions {
            const auto command = Command::decode(context.telecommand.arguments);
            if (!command) return {AnswerTelecommand{failure_code(command.error())}};
            return Decide{}(*command, context);
          }};
}

constexpr auto itself = [](const auto& command, const Context&) -> SuiteActions { return {command}; };

template <std::uint8_t operation>
constexpr auto save = [](const auto& command, const Context&) -> SuiteActions {
  SaveNodeParameters action{.node = command.node, .request = {}};
  action.request.operation = operation;
  action.request.origin = save_origin;
  if constexpr (requires { command.generation; }) action.request.generation = command.generation;
  return {action};
};

constexpr auto send_report = [](const mission::NodeSendReport& c, const Context&) -> SuiteActions {
  return {
      SendCrashReport{c.node, c.incarnation == newest_report ? std::nullopt : std::optional(c.incarnation)}};
};

constexpr auto set_log_level = [](const mission::NodeSetLogLevel& c, const Context&) -> SuiteActions {
  constexpr std::array names = {"debug", "info", "warn", "error"};
  return {SetLogLevel{c.node, names.at(static_cast<std::size_t>(c.level))}};
};

constexpr auto use_version = [](const mission::NodeUseVersion& c, const Context& context) -> SuiteActions {
  return {UseVersion{c.node, c.version,
                     c.probation_s == 0 ? suite::default_probation(context.deployment.ring, c.node)
                                        : seconds(c.probation_s)}};
};

constexpr auto use_previous = [](const mission::NodePreviousVersion& c,
                                 const Context& context) -> SuiteActions {
  return {UseVersion{c.node, std::nullopt, suite::default_probation(context.deployment.ring, c.node)}};
};

constexpr auto confirm = [](const mission::NodeConfirmVersion& c, const Context& context) -> SuiteActions {
  return {
      ConfirmVersion{c.node, c.version, context.telecommand.expiry - mission::NodeConfirmVersion::timeout}};
};

/// One that is gone may have been removed by this telecommand, before the end of an earlier process.
constexpr auto remove_node = [](const mission::NodeRemove& c, const Context& context) -> SuiteActions {
  const suite::NodeEntry* const node = context.deployment.find(c.node);
  if (node != nullptr && !node->added) return {AnswerTelecommand{mission::failure::not_added}};
  return {c};
};

template <bool retake>
constexpr auto scrub = [](const auto&, const Context&) -> SuiteActions {
  return {RunScrubbing{retake}, AnswerTelecommand{}};
};

constexpr std::array handlers{
    on<mission::RingHold>(itself),
    on<mission::RingRelease>(itself),
    on<mission::RingReleaseInactive>(itself),
    on<mission::RingRestoreOrders>(itself),
    on<mission::BootStepUp>(itself),
    on<mission::RingReportFaults>(itself),
    on<mission::NodeSetLogLevel>(set_log_level),
    on<mission::NodeSendReport>(send_report),
    on<mission::NodeUseVersion>(use_version),
    on<mission::NodePreviousVersion>(use_previous),
    on<mission::NodeConfirmVersion>(confirm),
    on<mission::NodeRemoveVersion>(itself),
    on<mission::NodeReportVersions>(itself),
    on<mission::NodeRemove>(remove_node),
    on<mission::PackageInstall>(itself),
    on<mission::PackageCancel>(itself),
    on<mission::PackageReport>(itself),
    on<mission::ScrubRun>(scrub<false>),
    on<mission::ScrubRetake>(scrub<true>),
    on<mission::ScrubReport>(itself),
    on<mission::ParametersKeep>(save<SaveRequest::KEEP>),
    on<mission::ParametersConfirm>(save<SaveRequest::CONFIRM>),
    on<mission::ParametersHistory>(save<SaveRequest::REPORT>),
    on<mission::ParametersRestore>(save<SaveRequest::RESTORE>),
    on<mission::ParametersFactoryReset>(save<SaveRequest::RESET>),
};

const Handler* find(std::uint16_t function) {
  const auto* const found = std::find_if(
      handlers.begin(), handlers.end(), [&](const Handler& handler) { return handler.function == function; });
  return found == handlers.end() ? nullptr : found;
}

}  // namespace

FailureCode check_command(std::uint16_t function, OctetView arguments, const suite::Deployment& deployment) {
  const Handler* const handler = find(function);
  return handler == nullptr ? mission::failure::unknown_function : handler->check(arguments, deployment);
}

SuiteActions actions_of(const StoredTelecommand& telecommand, const suite::Deployment& deployment) {
  const Handler* const handler = find(telecommand.function);
  if (handler == nullptr) return {AnswerTelecommand{mission::failure::unknown_function}};
  return handler->decide({telecommand, deployment});
}

SuiteActions on_saved(const SaveNodeParameters& asked,
                      const srfs_msgs::srv::SaveParameters_Response* answer) {
  if (answer == nullptr) return {AnswerTelecommand{mission::failure::node_silent}};
  if (!answer->success) {
    return {ReportParametersRefused{asked.node, answer->reason},
            AnswerTelecommand{mission::failure::parameters_refused}};
  }
  if (asked.request.operation != SaveRequest::REPORT) return {AnswerTelecommand{}};
  SendLines history;
  for (const auto& line : to_mission(asked.node, *answer)) history.lines.push_back(encode_line(line));
  return {std::move(history)};
}

SuiteActions on_log_level_set(const rcl_interfaces::srv::SetParameters_Response* answer) {
  if (answer == nullptr) return {AnswerTelecommand{mission::failure::node_silent}};
  if (!answer->results.empty() && answer->results.front().successful) return {AnswerTelecommand{}};
  return {LogFailure{fmt::format("log_level: {}",
                                 answer->results.empty() ? "no result" : answer->results.front().reason)},
          AnswerTelecommand{mission::failure::not_done}};
}

}  // namespace srfs
