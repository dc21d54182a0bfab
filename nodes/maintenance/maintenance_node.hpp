// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include <mission/structures.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>
#include <srfs_msgs/srv/save_parameters.hpp>

#include "base/action_queue.hpp"
#include "base/child_process.hpp"
#include "nodes/maintenance/scrub_schedule.hpp"
#include "nodes/maintenance/suite_files.hpp"
#include "nodes/maintenance/update_transaction.hpp"
#include "suite/commanding/commanded_node.hpp"
#include "update/scrubber.hpp"

namespace srfs {

/// What the ground asks of the suite as such: the ring's hold and release, its fault ledger, reports of
/// deaths, log levels, versions of the nodes' programs, and new ones from uplinked source; scrubs what must
/// not rot.
class MaintenanceNode : public CommandedNode {
 public:
  explicit MaintenanceNode(suite::NodeContext& context);

  void on_mode_changed() override;

 protected:
  ros::CallbackReturn on_configure() override;
  ros::CallbackReturn on_activate() override;
  ros::CallbackReturn on_cleanup() override;
  ros::CallbackReturn on_shutdown() override { return on_cleanup(); }
  ros::CallbackReturn on_error() override { return on_cleanup(); }

  [[nodiscard]] FailureCode check(std::uint16_t function, OctetView arguments) const override;
  void execute(const StoredTelecommand& telecommand) override;

 private:
  using SetParameters = rcl_interfaces::srv::SetParameters;

  /// Carries out what logic decided.
  template <class Action>
  void run(ActionQueue<Action>& queue, std::vector<Action> actions) {
    queue.run(std::move(actions),
              [this](const Action& action) { std::visit([this](const auto& a) { carry_out(a); }, action); });
  }
  void run(UpdateTransaction::Actions actions) { run(update_actions_, std::move(actions)); }
  void run(ScrubSchedule::Actions actions) { run(scrub_actions_, std::move(actions)); }

  void run(SuiteActions actions);

  void report_set_aside();
  void report_step();

  // Telecommands
  void carry_out(const AnswerTelecommand& action);
  /// On the worker.
  template <SuiteOrder Order>
  void carry_out(const Order& order);
  void carry_out(const mission::PackageInstall& action);
  void carry_out(const mission::PackageCancel& action);
  void carry_out(const mission::PackageReport& action);
  void carry_out(const RunScrubbing& action);
  void carry_out(const mission::ScrubReport& action);
  void carry_out(const SetLogLevel& action);
  void carry_out(const SaveNodeParameters& action);
  void carry_out(const ReportParametersRefused& action);
  void carry_out(const ReportQueuedForDownlink& action);
  void carry_out(const LogFailure& action);
  void carry_out(const EndOwnProcess& action);
  void carry_out(const SendLines& action);
  void send_next();

  // maintenance_packages.cpp: one package at a time, from the folder of files to a running program.
  void open_packages();
  void close_packages();
  void resume_update();
  [[nodiscard]] LaneFolders lane_folders() const;
  [[nodiscard]] IntakeRules intake_rules() const;
  void carry_out(const TakeInPackage& action);
  void carry_out(const WriteUpdateJournal& action);
  void carry_out(const ReportRefusal& action);
  void carry_out(const ReportUpdate& action);
  void carry_out(const BuildProgram& action);
  void carry_out(const TestProgram& action);
  void carry_out(const StopLane& action);
  void carry_out(const SendLaneLog& action);
  void carry_out(const StoreProgram& action);
  void carry_out(const SwapProgram& action);
  void carry_out(const AddProgram& action);
  void carry_out(const AwaitActive& action);
  void carry_out(const RemoveWorkFolder& action);
  void swap_on_worker(std::function<Result<std::optional<StartedProgram>, std::string>()> job);
  [[nodiscard]] std::optional<std::string> describe_new_node(const TestProgram& action) const;
  void run_lane(const std::vector<std::string>& command, milliseconds patience);
  void read_lane_output();
  void on_lane_end();
  void review_added_nodes();

  /// The lane's process, and what waits for its end.
  struct Lane {
    ChildProcess child;
    ros::Executor::Handle ended;
    ros::Executor::Handle output;
    ros::Timer deadline;
    std::string line;   ///< begun by the child
    bool late = false;  ///< killed at its deadline
  };
  std::optional<UpdateTransaction> transaction_;  ///< while configured
  ActionQueue<UpdateAction> update_actions_;
  ros::Timer reviewing_added_;
  std::optional<Lane> lane_;
  bool resume_pending_ = false;  ///< what an earlier process left is checked once
  std::shared_ptr<ros::Worker> package_worker_;
  ros::Timer awaiting_active_;

  // maintenance_scrub.cpp
  void declare_scrubbing();
  void open_scrubbing();
  void close_scrubbing();
  [[nodiscard]] ScrubSchedule::Pace scrub_pace() const;
  void carry_out(const CheckSlice& action);
  void carry_out(const AwaitSlice& action);
  void carry_out(const ReportFinding& action);
  void carry_out(const ReportFilesTaken& action);
  void carry_out(const ReportScrubRound& action);

  std::optional<ScrubSchedule> scrubbing_;  ///< while configured
  ActionQueue<ScrubAction> scrub_actions_;
  std::shared_ptr<update::Scrubber> scrubber_;  ///< the worker's alone
  std::shared_ptr<ros::Worker> scrub_worker_;
  ros::Timer scrub_timer_;

  // maintenance_limits.cpp
  struct Limits;
  void open_limits();
  void watch_limits(std::shared_ptr<Limits> limits);
  void on_sample(const srfs_msgs::msg::PayloadTelemetry& message);
  void blame_version(const std::string& node, const std::string& violation);
  void close_limits();

  std::shared_ptr<Limits> limits_;  ///< nullptr: not configured, or no dictionary
  ActionQueue<SuiteAction> suite_actions_;
  std::shared_ptr<ros::Worker> worker_;
  std::deque<EncodedLine> lines_;  ///< still to be sent, 100 at most
  ros::Timer sending_;
  ros::Timer set_aside_report_;
  ros::Timer own_end_;
  std::shared_ptr<ros::Client<SetParameters>> parameters_of_;  ///< while a call is under way
  std::map<std::string, std::shared_ptr<ros::Client<srfs_msgs::srv::SaveParameters>>> save_clients_;
};

}  // namespace srfs
