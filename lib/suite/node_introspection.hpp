// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include <srfs_msgs/srv/get_executor_statistics.hpp>
#include <srfs_msgs/srv/get_node_status.hpp>
#include <srfs_msgs/srv/save_parameters.hpp>

#include "ros/executor.hpp"
#include "ros/service.hpp"
#include "ros/worker.hpp"
#include "suite/parameter_storage.hpp"

namespace srfs::suite {

class Node;

/// A stored value, or a part of the file, that is not used.
struct NotUsed {
  std::string what;
  std::string reason;
};

/// The parameters that a node kept.
struct KeptParameters {
  ParameterHistory history;
  std::vector<NotUsed> not_used;  ///< at most 32
};
/// Of the node whose state lies in @p state. A damaged file is set aside. Blocks on the disk.
[[nodiscard]] KeptParameters read_kept_parameters(const std::filesystem::path& state);

/// What every node offers beside the services of ROS 2: ~/get_status, ~/get_executor_statistics,
/// ~/save_parameters with the file behind it, and the housekeeping structure of its work thread. A part of
/// Node; on the work thread.
class NodeIntrospection {
 public:
  /// Makes the services.
  NodeIntrospection(Node& node, KeptParameters kept);
  NodeIntrospection(const NodeIntrospection&) = delete;
  NodeIntrospection& operator=(const NodeIntrospection&) = delete;

  /// Moves unused stored values into parameters_set_aside.yaml and logs them; reports a trial that an earlier
  /// process left. After the last declaration. Blocks on the disk.
  void begin_keeping();
  /// Raises an event for each stored value that was not used, at most 8, and for that trial.
  void raise_start_report();
  /// After a change at run time.
  void on_parameters_changed(const std::vector<std::string>& names);
  /// Publishes the structure of the work thread; nodes that the mission dictionary lacks have none.
  void publish_work();

 private:
  using SaveParameters = srfs_msgs::srv::SaveParameters;

  [[nodiscard]] std::string path(const char* file) const;
  void fill(srfs_msgs::srv::GetNodeStatus_Response& response) const;
  void fill(srfs_msgs::srv::GetExecutorStatistics_Response& response) const;
  void on_save(const SaveParameters::Request& request, ros::Ticket ticket);
  [[nodiscard]] SaveParameters::Response outcome_of(const Result<void, std::string>& outcome) const;
  /// Writes what the storage wants written. @param answer  to be called then; may be empty
  void write(std::function<void(const Result<void, std::string>&)> answer);
  void keep_set_aside();
  /// Reports what became of values, and wakes up when the trial's time is over.
  void follow_storage();
  [[nodiscard]] milliseconds trial_time() const;

  Node& node_;
  MonotonicTime start_;
  MonotonicTime counted_since_;
  MonotonicTime last_work_;
  nanoseconds busy_before_reset_{0};
  nanoseconds busy_at_last_work_{0};
  void note_unused(std::string what, std::string reason);
  std::vector<NotUsed> not_used_;  ///< at most 32
  std::shared_ptr<ros::Service<srfs_msgs::srv::GetNodeStatus>> status_;
  std::shared_ptr<ros::Service<srfs_msgs::srv::GetExecutorStatistics>> statistics_;
  std::shared_ptr<ros::Service<SaveParameters>> save_;
  ParameterStorage storage_;
  ros::Timer trial_end_;
  std::unique_ptr<ros::Worker> disk_;  ///< made with the first write
};

}  // namespace srfs::suite
