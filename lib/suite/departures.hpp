// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/process.hpp"
#include "ros/executor.hpp"
#include "ros/participant.hpp"
#include "suite/instance.hpp"

namespace srfs::suite {

/// ParticipantOptions::lease where a ring watches: the ring decides which nodes are dead. DDS' own verdict
/// would only cut off nodes that were stopped for a while.
inline constexpr std::chrono::seconds lease_beside_the_ring{20};

/// Says goodbye for nodes that ended without a word. A killed process stays in the ROS graph of all others
/// until its lease ends: 20 s here, longer than any stop that a node is to outlive. The kernel knows sooner:
/// every node holds the process of each other node that discovery shows (a pidfd; the instance lock proves
/// which process is that incarnation). When that process ends, the node announces to the domain that its
/// participant is gone. A node that starts again has another GUID. A stopped or starved process has not
/// ended. Work thread.
class Departures {
 public:
  /// @param is_node whether a name in an identity names a node of the suite
  Departures(ros::Executor& executor, ros::Participant& participant, VarPaths var,
             std::function<bool(const std::string&)> is_node);
  ~Departures();
  Departures(const Departures&) = delete;
  Departures& operator=(const Departures&) = delete;

  /// Nodes whose process is held.
  [[nodiscard]] std::size_t watched() const { return watches_.size(); }
  /// Goodbyes said for others since the start.
  [[nodiscard]] std::uint64_t announced() const { return announced_; }

 private:
  struct Watch {
    ros::KnownParticipants::Member member;
    Process process;
    ros::Executor::Handle handle;
  };
  void look();
  void watch(const ros::KnownParticipants::Member& member);
  void on_exit(const ros::GuidPrefix& prefix);
  void announce(const ros::KnownParticipants::Member& member);

  ros::Executor& executor_;
  ros::Participant& participant_;
  const VarPaths var_;
  const std::function<bool(const std::string&)> is_node_;
  std::vector<Watch> watches_;  // at most as many as discovery remembers
  std::uint64_t announced_ = 0;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);  // for what discovery's thread posts
};

}  // namespace srfs::suite
