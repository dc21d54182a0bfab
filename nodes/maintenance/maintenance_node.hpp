#pragma once

#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <string>

#include <mission/structures.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>
#include <srfs_msgs/srv/save_parameters.hpp>

#include "commanding/commanded_node.hpp"

namespace srfs {

/// What the ground asks of the suite as such: the ring's hold and release, its fault ledger, reports of
/// deaths, log levels, versions of the nodes' programs. (Parameters and nodes from uplinked source: not yet,
/// README.md.)
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
  void set_log_level(const mission::NodeSetLogLevel& command);
  void use_version(const std::string& node, std::optional<std::uint32_t> version, milliseconds probation);
  void report_versions(const std::string& node);
  template <class Structure>
  [[nodiscard]] srfs_msgs::msg::PayloadTelemetry telemetry(const Structure& structure) const;
  void send_next();
  // maintenance_parameters.cpp
  [[nodiscard]] FailureCode check_parameters(std::uint16_t function, OctetView arguments) const;
  void execute_parameters(const StoredTelecommand& telecommand);
  void report_generations(const std::string& node, const srfs_msgs::srv::SaveParameters::Response& said);

  std::shared_ptr<ros::Worker> worker_;
  std::deque<srfs_msgs::msg::PayloadTelemetry> lines_;  ///< still to be sent, 100 at most
  ros::Timer sending_;
  ros::Timer own_end_;
  std::shared_ptr<ros::Client<SetParameters>> parameters_of_;  ///< while a call is under way
  std::map<std::string, std::shared_ptr<ros::Client<srfs_msgs::srv::SaveParameters>>> save_clients_;
};

}  // namespace srfs
