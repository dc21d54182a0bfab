// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <diagnostic_msgs/msg/diagnostic_array.hpp>
#include <srfs_msgs/srv/get_node_status.hpp>

#include "base/time.hpp"
#include "suite/instance.hpp"

/// The suite's health as ROS 2's diagnostics have it (REP 107). Pure.
namespace srfs::tool {

/// What is known of a node.
struct NodeHealth {
  std::string node;
  std::optional<suite::RunningInstance> instance = std::nullopt;  ///< nullopt: it does not run
  suite::StartRecord starts = {};
  std::optional<srfs_msgs::srv::GetNodeStatus_Response> answer = std::nullopt;  ///< its last one
  std::optional<MonotonicTime> answered = std::nullopt;
};

/// An answer that is older says nothing of now.
inline constexpr seconds longest_silence{5};

/// ERROR: it does not run. STALE: it does not answer. WARN: it is not Active, its last transition failed, or
/// callbacks ended with an exception. OK: else.
[[nodiscard]] diagnostic_msgs::msg::DiagnosticStatus diagnose(const NodeHealth& health,
                                                              const std::string& suite, MonotonicTime now);

/// As aggregators show it: "/SUITE" with the worst level, then "/SUITE/NODE" for each.
/// @param statuses of diagnose(), by node
[[nodiscard]] std::vector<diagnostic_msgs::msg::DiagnosticStatus> aggregate(
    const std::vector<diagnostic_msgs::msg::DiagnosticStatus>& statuses, const std::string& suite);

}  // namespace srfs::tool
