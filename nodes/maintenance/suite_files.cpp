// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/suite_files.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "nodes/maintenance/fault_line.hpp"
#include "nodes/maintenance/version_line.hpp"
#include "nodes/maintenance/version_rules.hpp"
#include "suite/launcher.hpp"
#include "suite/node_addition.hpp"
#include "suite/node_versions.hpp"
#include "suite/ring/node_record.hpp"
#include "suite/set_aside.hpp"
#include "suite/step_down.hpp"

namespace srfs {
namespace {

constexpr auto release_patience = milliseconds(2000);  // for a restart of the node that is under way

SuiteActions failed(std::string why, FailureCode code = mission::failure::not_done) {
  return {LogFailure{std::move(why)}, AnswerTelecommand{code}};
}

SuiteActions end_with(const Result<void, std::string>& result) {
  if (!result) return failed(result.error());
  return {AnswerTelecommand{}};
}

SuiteActions change_version(
    const SuiteFiles& suite, const std::string& node, update::VersionNumber version,
    Result<void, std::string> (update::VersionStore::*operation)(update::VersionNumber)) {
  return end_with(suite::change_versions(
      suite.var, node, [&](update::VersionStore& store) { return (store.*operation)(version); }));
}

FailureCode to_failure_code(QueueError error) {
  switch (error) {
    case QueueError::gone:
      return mission::failure::no_report;
    case QueueError::full:
      return mission::failure::outbox_full;
    case QueueError::disk:
      break;
  }
  return mission::failure::disk_failed;
}

}  // namespace

// ---------------------------------------------------------------- the ring

SuiteActions perform(const mission::RingHold& order, const SuiteFiles& suite) {
  return end_with(
      suite::hold(suite.var, suite.deployment, order.node, "held by telecommand", monotonic_now()));
}

SuiteActions perform(const mission::RingRelease& order, const SuiteFiles& suite) {
  return end_with(suite::release(suite.var, order.node, release_patience));
}

SuiteActions perform(const mission::RingReleaseInactive& order, const SuiteFiles& suite) {
  if (suite::find_instance(suite.var, order.node)) return {AnswerTelecommand{mission::failure::node_runs}};
  const auto set = suite::set_desired_state(suite.var, suite.deployment, order.node, ros::State::inactive,
                                            monotonic_now());
  return end_with(set ? suite::release(suite.var, order.node, release_patience) : set);
}

SuiteActions perform(const mission::RingRestoreOrders& order, const SuiteFiles& suite) {
  const auto restored = suite::restore_orders(suite.var, order.node);
  if (!restored) return failed(restored.error());
  return {AnswerTelecommand{*restored ? mission::failure::none : mission::failure::nothing_set_aside}};
}

SuiteActions perform(const mission::BootStepUp& /*order*/, const SuiteFiles& suite) {
  const auto problem = suite::StepStore(suite.var.boot()).change([](suite::StepRecord record) {
    return suite::on_commanded(std::move(record), suite::BootStep::normal);
  });
  return problem.empty() ? SuiteActions{AnswerTelecommand{}} : failed(problem);
}

SuiteActions perform(const mission::RingReportFaults& order, const SuiteFiles& suite) {
  const auto records = suite::FaultLedger(suite.var).read().records;
  const std::size_t count = std::min<std::size_t>(order.count, records.size());
  SendLines newest;
  std::for_each(records.end() - static_cast<std::ptrdiff_t>(count), records.end(),
                [&](const auto& record) { newest.lines.push_back(encode_line(to_mission(record))); });
  return {std::move(newest)};
}

SuiteActions perform(const SendCrashReport& order, const SuiteFiles& suite) {
  const auto reports = suite::find_crash_reports(suite.var, order.node);
  const suite::CrashReport* report = choose_report(reports, order.incarnation);
  if (report == nullptr) return {AnswerTelecommand{mission::failure::no_report}};
  const auto queued = queue_report(suite.var.root / "files" / "outbox",
                                   fmt::format("{}_{}", order.node, report->incarnation), report->file);
  if (!queued) {
    return failed(
        fmt::format("cannot queue the crash report of {} for downlink: {}", order.node, queued.error().text),
        to_failure_code(queued.error().error));
  }
  return {ReportQueuedForDownlink{*queued}, AnswerTelecommand{}};
}

// ---------------------------------------------------------------- versions

SuiteActions perform(const UseVersion& order, const SuiteFiles& suite) {
  const suite::NodeEntry* const node = suite.deployment.find(order.node);
  if (node == nullptr) return {AnswerTelecommand{mission::failure::unknown_node}};
  const auto version = version_to_use(suite::read_versions(suite.var, order.node).table, order.version);
  if (!version) return {AnswerTelecommand{mission::failure::no_version}};
  const suite::LaunchRequest request{suite.deployment, suite.var, suite::suite_bin_folder(),
                                     fmt::format("version {} by telecommand", *version)};
  const auto used = suite::use_version(request, *node, *version, order.probation, suite.own_node);
  if (!used) return failed(fmt::format("version {} of {}: {}", *version, order.node, used.error()));
  if (*used && (*used)->fallback)
    return failed(fmt::format("{}: {}", order.node, to_text(*(*used)->fallback)));
  if (order.node != suite.own_node) return {AnswerTelecommand{}};
  // This process is the old version: it ends once its report is out, and the ring starts the new one.
  return {AnswerTelecommand{}, EndOwnProcess{}};
}

SuiteActions perform(const ConfirmVersion& order, const SuiteFiles& suite) {
  const auto end =
      judge_confirmation(suite::read_versions(suite.var, order.node).table, order.version,
                         suite::runs_since(suite.var, order.node, order.version),
                         suite::needs_confirmation(suite.deployment.ring, order.node), order.accepted);
  if (end) return {AnswerTelecommand{*end}};
  return change_version(suite, order.node, order.version, &update::VersionStore::commit);
}

SuiteActions perform(const mission::NodeRemoveVersion& order, const SuiteFiles& suite) {
  if (suite::read_versions(suite.var, order.node).table.find(order.version) == nullptr)
    return {AnswerTelecommand{mission::failure::no_version}};
  return change_version(suite, order.node, order.version, &update::VersionStore::remove);
}

SuiteActions perform(const mission::NodeReportVersions& order, const SuiteFiles& suite) {
  const auto table = suite::read_versions(suite.var, order.node).table;
  SendLines lines{{encode_line(to_mission(order.node, table, nullptr))}};
  for (const update::Version& version : table.versions())
    lines.lines.push_back(encode_line(to_mission(order.node, table, &version)));
  return {std::move(lines)};
}

SuiteActions perform(const mission::NodeRemove& order, const SuiteFiles& suite) {
  return end_with(suite::remove_node(suite.var, order.node));
}

}  // namespace srfs
