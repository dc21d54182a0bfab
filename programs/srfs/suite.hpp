// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "ros/participant.hpp"
#include "suite/deployment.hpp"
#include "suite/instance.hpp"

namespace srfs::tool {

/// The deployment an operator's command is about.
struct Target {
  suite::Deployment deployment;
  suite::VarPaths var;
};

/// A tool's participant: it belongs to the suite that it inspects.
[[nodiscard]] ros::ParticipantOptions participant_options(const Target& target, int domain,
                                                          ros::Executor& executor);

/// One line of `srfs status`.
struct NodeStatus {
  std::string name;
  std::string state = "not running";  ///< lifecycle label; "not running"; "not answering"
  std::optional<suite::RunningInstance> instance;
  suite::StartRecord starts;
  std::string reason;  ///< of the last transition that was refused or failed; empty: it succeeded
  std::uint32_t failed_callbacks = 0;  ///< since its start
};

struct UpOptions {
  std::string cause = "up";
  seconds deadline{15};  ///< of time in which no awaited node makes progress (StartPatience)
  bool all = false;      ///< nodes that flight does not need are waited for, too
  std::optional<int> domain;
  std::vector<std::string> only;  ///< these nodes alone; empty: all. The others are left as they are
  /// A domain the caller already holds for this suite: no other process may take it during a restart.
  std::shared_ptr<suite::DomainLock> held_domain;
};

struct UpReport {
  bool all_reached = false;  ///< all awaited ones
  milliseconds took{0};      ///< first exec to the last awaited node in its desired state
  int domain = 0;
  std::vector<std::string> problems;
  std::vector<std::string> coming;  ///< nodes that were not waited for and are not there yet
  std::vector<std::string> advice;  ///< why a start was too slow, and what to do
  std::vector<std::string> held;    ///< nodes that were not started because the operator holds them, and why
  std::vector<NodeStatus> nodes;
};

/// Starts every node of the deployment: those that flight needs in list order, then the others. Waits until
/// the needed ones (with @p options only or all: all) are in their desired state. Nodes that run and nodes
/// that are held (`srfs ring hold`) are left alone. Nothing of it stays behind. Shows on stderr what it waits
/// for. Blocks while nodes make progress, for ten deadlines at most.
[[nodiscard]] UpReport up(const Target& target, const UpOptions& options);

struct DownReport {
  std::vector<std::string> killed;   ///< nodes that needed SIGKILL
  std::vector<std::string> starved;  ///< those of them that got too little CPU time to end
  std::vector<std::string> left;     ///< nodes that survived even that
};

/// Stops every node in reverse order, and every process that is about to become a node. Sets the stopping
/// flag first, so that nothing revives a stopped node. Sends SIGTERM, after @p patience SIGKILL. Then locks
/// and the domain file are removed. The simulated watchdog is disarmed. Time in which a process waits for a
/// CPU does not count, up to ten times the patience. Blocks.
[[nodiscard]] DownReport down(const Target& target, milliseconds patience);

struct RestartReport {
  DownReport down;
  std::optional<UpReport>
      up;  ///< nullopt: not all could be stopped, or the suite was stopped by another process
};

/// down() and up() as one step: no other start or stop comes in between. A suite that was stopped while this
/// waited for its turn stays down. @param if_up  so does one that was stopped before
[[nodiscard]] RestartReport restart(const Target& target, milliseconds patience, const UpOptions& options,
                                    bool if_up);

/// Asks every node for its state over DDS. Blocks for at most @p deadline.
[[nodiscard]] std::vector<NodeStatus> status(const Target& target, milliseconds deadline);

/// DDS domain of the running suite; nullopt when VAR has none.
[[nodiscard]] std::optional<int> running_domain(const Target& target);

}  // namespace srfs::tool
