// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/maintenance_node.hpp"

#include <algorithm>
#include <csignal>

#include <unistd.h>

#include <mission/structures.hpp>

#include "nodes/maintenance/scrub_list.hpp"
#include "nodes/maintenance/suite_files.hpp"
#include "nodes/maintenance/update_line.hpp"
#include "suite/mission_time.hpp"
#include "suite/set_aside.hpp"
#include "suite/step_down.hpp"

namespace srfs {
namespace {

using ros::CallbackReturn;
using srfs_msgs::srv::SaveParameters;

constexpr auto between_lines = milliseconds(150);  // a little above the structures' interval at ttc
constexpr auto before_own_end = seconds(1);        // its telecommand is reported first
constexpr auto longest_job = seconds(10);          // a change of version waits for locks, an end and a start
constexpr auto answer_deadline = seconds(2);
/// Of one attempt: the search for the node's service and a write to its disk.
constexpr auto save_deadline = seconds(4);
constexpr int save_attempts = 2;  // a repeat names its first attempt: done once
constexpr std::size_t longest_reason = 150;
constexpr auto set_aside_report_period = seconds(10);  // ttc may come late, or be the one that fails

}  // namespace

MaintenanceNode::MaintenanceNode(suite::NodeContext& context) : CommandedNode(context) {
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
  report_set_aside();
  return CallbackReturn::success;
}

/// Reported twice rather than never: the note goes after the event, and the event waits for ttc.
void MaintenanceNode::report_set_aside() {
  set_aside_report_ = create_timer(
      set_aside_report_period,
      [this] {
        if (!is_heard_by_ttc()) return;
        report_step();
        (void)worker_->ask([paths = var()] { return suite::read_set_aside_note(paths); },
                           [this](const std::optional<suite::SetAsideNote>& note) {
                             set_aside_report_.reset();
                             if (!note) return;
                             mission::MaintenanceOrdersSetAsideEvent event;
                             event.starts = note->starts;
                             event.what = note->what.substr(0, longest_reason);
                             raise(event);
                             worker_->post([paths = var()] {
                               if (const auto removed = suite::remove_set_aside_note(paths); !removed)
                                 log::error("{}", removed.error());
                             });
                           });
      },
      "orders set aside");
}

void MaintenanceNode::report_step() {
  (void)worker_->ask(
      [boot = var().boot()] { return suite::StepStore(boot).read(); },
      [this](const suite::StepRecord& record) {
        if (record.reported) return;
        raise(mission::SuiteSteppedDownEvent{.step = static_cast<mission::BootStep>(record.step),
                                             .cause = static_cast<mission::BootStepCause>(record.cause),
                                             .starts = record.unhealthy_starts(),
                                             .set_aside = record.set_aside});
        (void)worker_->post([boot = var().boot()] {
          const auto problem = suite::StepStore(boot).change([](suite::StepRecord r) {
            r.reported = true;
            return r;
          });
          if (!problem.empty()) log::error("{}", problem);
        });
      });
}

CallbackReturn MaintenanceNode::on_cleanup() {
  set_aside_report_.reset();
  sending_.reset();
  lines_.clear();
  suite_actions_.clear();
  parameters_of_.reset();
  save_clients_.clear();
  close_commanding();
  close_packages();
  close_scrubbing();
  close_limits();
  worker_.reset();
  return CallbackReturn::success;
}

// ---------------------------------------------------------------- telecommands

FailureCode MaintenanceNode::check(std::uint16_t function, OctetView arguments) const {
  return check_command(function, arguments, deployment());
}

void MaintenanceNode::execute(const StoredTelecommand& telecommand) {
  run(actions_of(telecommand, deployment()));
}

void MaintenanceNode::run(SuiteActions actions) {
  run(suite_actions_, std::move(actions));
}

void MaintenanceNode::carry_out(const AnswerTelecommand& action) {
  finished(action.code);
}

template <SuiteOrder Order>
void MaintenanceNode::carry_out(const Order& order) {
  const bool taken =
      worker_->ask([order, suite = SuiteFiles{var(), deployment(), name()}] { return perform(order, suite); },
                   [this](SuiteActions actions) { run(std::move(actions)); });
  if (!taken) finished(mission::failure::queue_full);
}

void MaintenanceNode::on_mode_changed() {
  if (transaction_) run(transaction_->rest(!mode_reaction().work));
  report_mode_obeyed(0);
}

void MaintenanceNode::carry_out(const mission::PackageInstall& action) {
  run(transaction_->install(action.file, action.activate));
}

void MaintenanceNode::carry_out(const mission::PackageCancel& /*action*/) {
  run(transaction_->cancel());
}

void MaintenanceNode::carry_out(const mission::PackageReport& /*action*/) {
  carry_out(SendLines{{encode_line(to_mission(transaction_->update()))}});
}

void MaintenanceNode::carry_out(const RunScrubbing& action) {
  run(scrubbing_->run(action.retake));
}

void MaintenanceNode::carry_out(const mission::ScrubReport& /*action*/) {
  carry_out(SendLines{{encode_line(to_mission(scrubbing_->status()))}});
}

void MaintenanceNode::carry_out(const SetLogLevel& action) {
  rcl_interfaces::msg::Parameter parameter;
  parameter.name = "log_level";
  parameter.value = ros::to_message(ros::ParameterValue(action.level));
  SetParameters::Request request;
  request.parameters = {parameter};
  parameters_of_ = create_client<SetParameters>("/" + action.node + "/set_parameters");
  parameters_of_->call(request, answer_deadline, 1,
                       [this](const ros::Client<SetParameters>::Outcome& answer) {
                         run(on_log_level_set(answer ? &*answer : nullptr));
                       });
}

void MaintenanceNode::carry_out(const SaveNodeParameters& action) {
  auto& client = save_clients_[action.node];
  if (!client) client = create_client<SaveParameters>("/" + action.node + "/save_parameters");
  client->call(action.request, save_deadline, save_attempts,
               [this, action](const ros::Client<SaveParameters>::Outcome& answer) {
                 run(on_saved(action, answer ? &*answer : nullptr));
               });
}

void MaintenanceNode::carry_out(const ReportParametersRefused& action) {
  log::error("{}: {}", action.node, action.reason);
  raise(mission::ParameterRequestRefusedEvent{.node = action.node,
                                              .reason = action.reason.substr(0, longest_reason)});
}

void MaintenanceNode::carry_out(const ReportQueuedForDownlink& action) {
  raise(mission::MaintenanceReportQueuedEvent{.name = action.report.name,
                                              .octets = static_cast<std::uint32_t>(action.report.octets)});
}

void MaintenanceNode::carry_out(const LogFailure& action) {
  log::error("{}", action.text);
}

void MaintenanceNode::carry_out(const EndOwnProcess& /*action*/) {
  own_end_ = create_one_shot(
      now() + before_own_end,
      [] {
        log::info("exiting so that the ring starts the other version");
        kill(getpid(), SIGTERM);
      },
      "own end");
}

void MaintenanceNode::carry_out(const SendLines& action) {
  lines_.insert(lines_.end(), action.lines.begin(), action.lines.end());
  send_next();
}

/// One at a time: ttc sends a structure live no more often than its interval.
void MaintenanceNode::send_next() {
  if (lines_.empty()) {
    sending_.reset();
    finished(mission::failure::none);
    return;
  }
  srfs_msgs::msg::PayloadTelemetry m;
  m.source = name();
  m.apid = lines_.front().apid;
  m.structure_id = lines_.front().structure_id;
  m.time_valid = false;  // the node's own clock; ttc stamps the report with mission time
  m.data = std::move(lines_.front().data);
  lines_.pop_front();
  m.utc = ros::to_message(system_utc_now());
  m.monotonic_ns = static_cast<std::uint64_t>(now().ns());
  publish_telemetry(m);
  sending_ = create_one_shot(
      now() + between_lines, [this] { send_next(); }, "lines");
}

}  // namespace srfs
