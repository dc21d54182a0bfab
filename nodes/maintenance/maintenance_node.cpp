// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/maintenance_node.hpp"

#include <algorithm>
#include <array>
#include <csignal>

#include <fmt/format.h>
#include <unistd.h>

#include <mission/structures.hpp>

#include "nodes/maintenance/fault_line.hpp"
#include "nodes/maintenance/report_downlink.hpp"
#include "nodes/maintenance/scrub_list.hpp"
#include "nodes/maintenance/update_line.hpp"
#include "nodes/maintenance/version_line.hpp"
#include "ros/launcher.hpp"
#include "ros/mission_time.hpp"
#include "ros/node_versions.hpp"
#include "ros/ring/node_record.hpp"

namespace srfs {
namespace {

using ros::CallbackReturn;

constexpr auto release_patience = milliseconds(2000);  // for a restart of the node that is under way
constexpr auto between_lines = milliseconds(150);      // a little above the structures' interval at ttc
constexpr auto before_own_end = seconds(1);
constexpr auto longest_job = seconds(10);  // a change of version waits for locks, an end and a start
constexpr auto answer_deadline = seconds(2);
constexpr std::uint32_t newest_report = UINT32_MAX;

FailureCode outcome_of(const Result<void, std::string>& result) {
  if (result) return mission::failure::none;
  log::error("{}", result.error());
  return mission::failure::not_done;
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

/// What is so already is no failure: a telecommand may be repeated.
FailureCode change_version(
    const ros::VarPaths& var, const std::string& node, std::uint32_t version,
    Result<void, std::string> (update::VersionStore::*operation)(update::VersionNumber)) {
  const auto table = ros::read_versions(var, node).table;
  if (table.find(version) == nullptr) return mission::failure::no_version;
  return outcome_of(ros::change_versions(
      var, node, [&](update::VersionStore& store) { return (store.*operation)(version); }));
}

/// @param accepted  by ttc. A version of ttc or maintenance proves itself by the telecommand that came
/// through it: one that was on its way before it ran proves nothing.
FailureCode confirm_version(const ros::VarPaths& var, const ros::RingSettings& ring,
                            const mission::NodeConfirmVersion& command, MonotonicTime accepted) {
  const auto table = ros::read_versions(var, command.node).table;
  if (table.find(command.version) == nullptr) return mission::failure::no_version;
  if (table.last_good() == command.version) return mission::failure::none;
  const auto since = ros::runs_since(var, command.node, command.version);
  if (!since) return mission::failure::version_not_running;
  if (ros::needs_confirmation(ring, command.node) && accepted < *since)
    return mission::failure::confirmed_too_early;
  return change_version(var, command.node, command.version, &update::VersionStore::commit);
}

template <class Command>
FailureCode judge(OctetView arguments, const ros::Deployment& deployment) {
  const auto command = Command::decode(arguments);
  if (!command) {
    return command.error().parameter == 0 ? mission::failure::bad_arguments_length
                                          : mission::failure::bad_argument;
  }
  if constexpr (requires { command->node; }) {
    if (deployment.find(command->node) == nullptr) return mission::failure::unknown_node;
  }
  // Down or Inactive by telecommand, such a node could not be brought back by telecommand.
  constexpr bool takes_away =
      std::is_same_v<Command, mission::RingHold> || std::is_same_v<Command, mission::RingReleaseInactive>;
  if constexpr (takes_away) {
    if (deployment.on_command_path(command->node)) return mission::failure::on_command_path;
  }
  return mission::failure::none;
}

}  // namespace

MaintenanceNode::MaintenanceNode(ros::NodeContext& context) : CommandedNode(context) {
  declare_scrubbing();
}

CallbackReturn MaintenanceNode::on_configure() {
  worker_ = create_worker("ring_files", 4, std::max<milliseconds>(worker_deadline(), longest_job));
  open_packages();
  open_scrubbing();
  open_limits();
  open_commanding();
  return CallbackReturn::success;
}

CallbackReturn MaintenanceNode::on_activate() {
  resume_commanding();
  resume_update();
  return CallbackReturn::success;
}

CallbackReturn MaintenanceNode::on_cleanup() {
  sending_.reset();
  lines_.clear();
  parameters_of_.reset();
  save_clients_.clear();
  close_commanding();
  close_packages();
  close_scrubbing();
  close_limits();
  worker_.reset();
  return CallbackReturn::success;
}

FailureCode MaintenanceNode::check(std::uint16_t function, OctetView arguments) const {
  switch (function) {
    case mission::RingHold::function_id:
      return judge<mission::RingHold>(arguments, deployment());
    case mission::RingRelease::function_id:
      return judge<mission::RingRelease>(arguments, deployment());
    case mission::RingReleaseInactive::function_id:
      return judge<mission::RingReleaseInactive>(arguments, deployment());
    case mission::RingReportFaults::function_id:
      return judge<mission::RingReportFaults>(arguments, deployment());
    case mission::NodeSetLogLevel::function_id:
      return judge<mission::NodeSetLogLevel>(arguments, deployment());
    case mission::NodeSendReport::function_id:
      return judge<mission::NodeSendReport>(arguments, deployment());
    case mission::NodeUseVersion::function_id:
      return judge<mission::NodeUseVersion>(arguments, deployment());
    case mission::NodePreviousVersion::function_id:
      return judge<mission::NodePreviousVersion>(arguments, deployment());
    case mission::NodeConfirmVersion::function_id:
      return judge<mission::NodeConfirmVersion>(arguments, deployment());
    case mission::NodeRemoveVersion::function_id:
      return judge<mission::NodeRemoveVersion>(arguments, deployment());
    case mission::NodeReportVersions::function_id:
      return judge<mission::NodeReportVersions>(arguments, deployment());
    case mission::PackageInstall::function_id:
      return judge<mission::PackageInstall>(arguments, deployment());
    case mission::NodeRemove::function_id:
      return judge<mission::NodeRemove>(arguments, deployment());
    case mission::PackageCancel::function_id:
      return judge<mission::PackageCancel>(arguments, deployment());
    case mission::PackageReport::function_id:
      return judge<mission::PackageReport>(arguments, deployment());
    case mission::ScrubRun::function_id:
      return judge<mission::ScrubRun>(arguments, deployment());
    case mission::ScrubReport::function_id:
      return judge<mission::ScrubReport>(arguments, deployment());
    case mission::ScrubRetake::function_id:
      return judge<mission::ScrubRetake>(arguments, deployment());
    default:
      return check_parameters(function, arguments);
  }
}

void MaintenanceNode::execute(const StoredTelecommand& telecommand) {
  const OctetView arguments = telecommand.arguments;
  switch (telecommand.function) {
    case mission::RingHold::function_id:
      run([this, plan = deployment(), node = mission::RingHold::decode(arguments)->node] {
        return outcome_of(ros::hold(var(), plan, node, "held by telecommand", monotonic_now()));
      });
      break;
    case mission::RingRelease::function_id:
      run([this, node = mission::RingRelease::decode(arguments)->node] {
        return outcome_of(ros::release(var(), node, release_patience));
      });
      break;
    case mission::RingReleaseInactive::function_id:
      run([this, plan = deployment(), node = mission::RingReleaseInactive::decode(arguments)->node] {
        if (ros::find_instance(var(), node)) return mission::failure::node_runs;
        const FailureCode set =
            outcome_of(ros::set_desired_state(var(), plan, node, ros::State::inactive, monotonic_now()));
        return set != mission::failure::none ? set : outcome_of(ros::release(var(), node, release_patience));
      });
      break;
    case mission::RingReportFaults::function_id:
      report_faults(mission::RingReportFaults::decode(arguments)->count);
      break;
    case mission::NodeSetLogLevel::function_id:
      set_log_level(*mission::NodeSetLogLevel::decode(arguments));
      break;
    case mission::NodeSendReport::function_id:
      send_report(*mission::NodeSendReport::decode(arguments));
      break;
    case mission::NodeUseVersion::function_id: {
      const auto command = mission::NodeUseVersion::decode(arguments);
      use_version(command->node, command->version,
                  command->probation_s == 0 ? ros::default_probation(deployment().ring, command->node)
                                            : seconds(command->probation_s));
      break;
    }
    case mission::NodePreviousVersion::function_id: {
      const std::string node = mission::NodePreviousVersion::decode(arguments)->node;
      use_version(node, std::nullopt, ros::default_probation(deployment().ring, node));
      break;
    }
    case mission::NodeConfirmVersion::function_id:
      run([this, command = *mission::NodeConfirmVersion::decode(arguments),
           accepted = telecommand.expiry - mission::NodeConfirmVersion::timeout] {
        return confirm_version(var(), deployment().ring, command, accepted);
      });
      break;
    case mission::NodeRemoveVersion::function_id:
      run([this, command = *mission::NodeRemoveVersion::decode(arguments)] {
        return change_version(var(), command.node, command.version, &update::VersionStore::remove);
      });
      break;
    case mission::NodeReportVersions::function_id:
      report_versions(mission::NodeReportVersions::decode(arguments)->node);
      break;
    case mission::PackageInstall::function_id: {
      const auto command = mission::PackageInstall::decode(arguments);
      run(transaction_->install(command->file, command->activate));
      break;
    }
    case mission::NodeRemove::function_id:
      remove_node(mission::NodeRemove::decode(arguments)->node);
      break;
    case mission::PackageCancel::function_id:
      run(transaction_->cancel());
      break;
    case mission::PackageReport::function_id:
      lines_.push_back(telemetry(to_mission(transaction_->update())));
      send_next();
      break;
    case mission::ScrubRun::function_id:
      run(scrubbing_->run(false));
      finished(mission::failure::none);
      break;
    case mission::ScrubReport::function_id:
      lines_.push_back(telemetry(to_mission(scrubbing_->status())));
      send_next();
      break;
    case mission::ScrubRetake::function_id:
      run(scrubbing_->run(true));
      finished(mission::failure::none);
      break;
    default:
      execute_parameters(telecommand);
  }
}

void MaintenanceNode::run(std::function<FailureCode()> job) {
  const bool taken = worker_->ask(std::move(job), [this](FailureCode outcome) { finished(outcome); });
  if (!taken) finished(mission::failure::queue_full);
}

// ---------------------------------------------------------------- the fault ledger

void MaintenanceNode::report_faults(std::size_t count) {
  const bool taken = worker_->ask(
      [ledger = ros::FaultLedger(var()), count] {
        const auto content = ledger.read();
        const std::size_t first = content.records.size() - std::min(count, content.records.size());
        std::deque<mission::RingFaultHousekeeping> lines;
        for (std::size_t i = first; i < content.records.size(); ++i)
          lines.push_back(to_mission(content.records[i]));
        return lines;
      },
      [this](const auto& lines) {
        for (const auto& line : lines) lines_.push_back(telemetry(line));
        send_next();
      });
  if (!taken) finished(mission::failure::queue_full);
}

/// A structure as it goes to ttc, but for its times.
template <class Structure>
srfs_msgs::msg::PayloadTelemetry MaintenanceNode::telemetry(const Structure& structure) const {
  srfs_msgs::msg::PayloadTelemetry m;
  m.source = name();
  m.apid = Structure::apid;
  m.structure_id = Structure::structure_id;
  m.time_valid = false;  // the node's own clock; ttc stamps the report with mission time
  m.data = structure.encoded();
  return m;
}

/// One at a time: ttc sends a structure live no more often than its interval.
void MaintenanceNode::send_next() {
  if (lines_.empty()) {
    sending_.reset();
    finished(mission::failure::none);
    return;
  }
  srfs_msgs::msg::PayloadTelemetry m = std::move(lines_.front());
  lines_.pop_front();
  m.utc = ros::to_message(system_utc_now());
  m.monotonic_ns = static_cast<std::uint64_t>(now().ns());
  publish_telemetry(m);
  sending_ = create_one_shot(
      now() + between_lines, [this] { send_next(); }, "lines");
}

// ---------------------------------------------------------------- versions

/// @param version  nullopt: the previous one
void MaintenanceNode::use_version(const std::string& node, std::optional<std::uint32_t> version,
                                  milliseconds probation) {
  const bool taken = worker_->ask(
      [this, node, version, probation] {
        const auto table = ros::read_versions(var(), node).table;
        const auto wanted = version ? version : table.previous();
        if (!wanted || (*wanted != update::golden && table.find(*wanted) == nullptr))
          return mission::failure::no_version;
        const ros::LaunchRequest request{deployment(), var(), ros::suite_bin_folder(),
                                         fmt::format("version {} by telecommand", *wanted)};
        const auto used = ros::use_version(request, *deployment().find(node), *wanted, probation, name());
        if (!used) {
          log::error("version {} of {}: {}", *wanted, node, used.error());
        } else if (*used && (*used)->fallback) {
          log::error("{}: {}", node, to_text(*(*used)->fallback));
        } else {
          return mission::failure::none;
        }
        return mission::failure::not_done;
      },
      [this, node](FailureCode outcome) {
        finished(outcome);
        if (node != name() || outcome != mission::failure::none) return;
        // This process is the old version: it ends once its report is out, and the ring starts the new one.
        own_end_ = create_one_shot(
            now() + before_own_end, [] { kill(getpid(), SIGTERM); }, "own end");
      });
  if (!taken) finished(mission::failure::queue_full);
}

void MaintenanceNode::report_versions(const std::string& node) {
  const bool taken = worker_->ask(
      [node, versions = var()] {
        const auto table = ros::read_versions(versions, node).table;
        std::deque<mission::NodeVersionHousekeeping> lines{to_mission(node, table, nullptr)};
        for (const update::Version& version : table.versions())
          lines.push_back(to_mission(node, table, &version));
        return lines;
      },
      [this](const auto& lines) {
        for (const auto& line : lines) lines_.push_back(telemetry(line));
        send_next();
      });
  if (!taken) finished(mission::failure::queue_full);
}

// ---------------------------------------------------------------- reports of deaths

void MaintenanceNode::send_report(const mission::NodeSendReport& command) {
  const bool taken = worker_->ask(
      [var = var(), command]() -> Result<QueuedReport, FailureCode> {
        const auto incarnation =
            command.incarnation == newest_report ? std::nullopt : std::optional(command.incarnation);
        const auto reports = ros::find_crash_reports(var, command.node);
        const ros::CrashReport* report = choose_report(reports, incarnation);
        if (report == nullptr) return Err(mission::failure::no_report);
        auto queued = queue_report(var.root / "files" / "outbox",
                                   fmt::format("{}_{}", command.node, report->incarnation), report->file);
        if (!queued) {
          log::error("cannot queue the crash report of {} for downlink: {}", command.node,
                     queued.error().text);
          return Err(to_failure_code(queued.error().error));
        }
        return std::move(*queued);
      },
      [this](const Result<QueuedReport, FailureCode>& queued) {
        if (queued) {
          mission::MaintenanceReportQueuedEvent event;
          event.name = queued->name;
          event.octets = static_cast<std::uint32_t>(queued->octets);
          raise(event);
        }
        finished(queued ? mission::failure::none : queued.error());
      });
  if (!taken) finished(mission::failure::queue_full);
}

// ---------------------------------------------------------------- log levels

void MaintenanceNode::set_log_level(const mission::NodeSetLogLevel& command) {
  constexpr std::array names = {"debug", "info", "warn", "error"};
  rcl_interfaces::msg::Parameter parameter;
  parameter.name = "log_level";
  parameter.value =
      ros::to_message(ros::ParameterValue(std::string(names.at(static_cast<std::size_t>(command.level)))));
  SetParameters::Request request;
  request.parameters = {parameter};
  parameters_of_ = create_client<SetParameters>("/" + command.node + "/set_parameters");
  parameters_of_->call(
      request, answer_deadline, 1, [this](const ros::Client<SetParameters>::Outcome& outcome) {
        FailureCode code = mission::failure::none;
        if (!outcome) {
          code = mission::failure::node_silent;
        } else if (outcome->results.empty() || !outcome->results.front().successful) {
          log::error("log_level: {}",
                     outcome->results.empty() ? "no result" : outcome->results.front().reason);
          code = mission::failure::not_done;
        }
        finished(code);
      });
}

}  // namespace srfs
