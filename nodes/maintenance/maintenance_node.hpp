#pragma once

#include <deque>
#include <functional>

#include <mission/structures.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>

#include "commanding/commanded_node.hpp"

namespace srfs {

/// What the ground asks of the suite as such: the ring's hold and release, its fault ledger, reports of
/// deaths, log levels. (Parameters and nodes from uplinked source: not yet, README.md.)
class MaintenanceNode : public CommandedNode {
 public:
  explicit MaintenanceNode(ros::NodeContext& context);

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

  /// A job that may wait for a disk or a lock; its outcome ends the telecommand.
  void run(std::function<FailureCode()> job);
  void report_faults(std::size_t count);
  void send_report(const mission::NodeSendReport& command);
  void send_next_fault();
  void set_log_level(const mission::NodeSetLogLevel& command);

  std::shared_ptr<ros::Worker> worker_;
  std::deque<mission::RingFaultHousekeeping> faults_;  ///< still to be sent, 100 at most
  ros::Timer sending_;
  std::shared_ptr<ros::Client<SetParameters>> parameters_of_;  ///< while a call is under way
};

}  // namespace srfs
