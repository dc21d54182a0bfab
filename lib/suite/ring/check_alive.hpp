// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <srfs_msgs/srv/check_alive.hpp>

#include "base/time.hpp"
#include "ros/service.hpp"

namespace srfs::suite {

class Node;
struct WorkStatus;

/// What a node's answer reports of its work.
struct DueWork {
  std::uint32_t due = 0;
  std::uint32_t done = 0;
  std::optional<MonotonicTime> oldest;
};

/// Input that waits and the node's own work together. The work done is that of the kind whose work has
/// waited longer: a node that handles its input and neglects its own work, or the reverse, is detected.
[[nodiscard]] DueWork due_work(const ros::Executor::Backlog& input, const WorkStatus& own);

/// A node's answers to the liveness checks, given on its work thread with or without a ring. A part of
/// Node.
class CheckAliveService {
 public:
  /// What the node's own half of the ring adds.
  class RingMember {
   public:
    virtual ~RingMember() = default;
    virtual void on_asked(const std::string& observer, std::uint32_t generation) = 0;
    [[nodiscard]] virtual std::uint32_t generation() const = 0;
    [[nodiscard]] virtual nanoseconds last_check_age() const = 0;
    /// Time this node was stopped or starved since then.
    [[nodiscard]] virtual nanoseconds held_up_since(MonotonicTime since) const = 0;
    /// Time since then in which this whole process was stopped, or its machine.
    [[nodiscard]] virtual nanoseconds stopped_since(MonotonicTime since) const = 0;
  };

  explicit CheckAliveService(Node& node);
  /// @param member nullptr: no ring; else outlives its place here
  void set_member(RingMember* member) { member_ = member; }

 private:
  void answer(const srfs_msgs::srv::CheckAlive_Request& request,
              srfs_msgs::srv::CheckAlive_Response& response);
  void fill_work(srfs_msgs::srv::CheckAlive_Response& response);
  void fill_worker(srfs_msgs::srv::CheckAlive_Response& response);
  [[nodiscard]] std::uint32_t age_ms(MonotonicTime since) const;
  /// How long a worker has owed what it owes since then: time in which it could run.
  [[nodiscard]] nanoseconds age_of(const ros::Worker& worker, MonotonicTime since) const;

  Node& node_;
  RingMember* member_ = nullptr;
  std::shared_ptr<ros::Service<srfs_msgs::srv::CheckAlive>> service_;
};

/// "/NODE/check_alive"
[[nodiscard]] std::string check_alive_name(std::string_view node);

}  // namespace srfs::suite
