#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "ros/deployment.hpp"
#include "ros/instance.hpp"
#include "ros/participant.hpp"

namespace srfs::tool {

/// The deployment an operator's command is about.
struct Target {
  ros::Deployment deployment;
  ros::VarPaths var;
};

/// A tool's participant: it belongs to the suite that it looks at.
[[nodiscard]] ros::ParticipantOptions participant_options(const ros::Deployment& deployment, int domain,
                                                          ros::Executor& executor);

/// One line of `srfs status`.
struct NodeStatus {
  std::string name;
  std::string state = "not running";  ///< lifecycle label; "not running"; "not answering"
  std::optional<ros::RunningInstance> instance;
  ros::StartRecord starts;
  std::string reason;  ///< of the last transition that was refused or failed; empty: it succeeded
  std::uint32_t failed_callbacks = 0;  ///< since its start
};

struct UpOptions {
  std::string cause = "up";
  seconds deadline{15};  ///< for all nodes to reach their desired state
  std::optional<int> domain;
  std::vector<std::string> only;  ///< these nodes alone; empty: all. The others are left as they are
  /// A domain the caller holds for this suite already: over a restart nobody else may take it in between.
  std::shared_ptr<ros::DomainLock> held_domain;
};

struct UpReport {
  bool all_reached = false;
  milliseconds took{0};  ///< first exec to the last node in its desired state
  int domain = 0;
  std::vector<std::string> problems;
  std::vector<std::string> held;  ///< nodes that were not started because the operator holds them, and why
  std::vector<NodeStatus> nodes;
};

/// Starts every node of the deployment in list order and waits until all are in their desired state. Nodes
/// that run and nodes that are held (`srfs ring hold`) are left alone. Nothing of it stays behind. Blocks up
/// to the deadline.
[[nodiscard]] UpReport up(const Target& target, const UpOptions& options);

struct DownReport {
  std::vector<std::string> killed;  ///< nodes that needed SIGKILL
  std::vector<std::string> left;    ///< nodes that survived even that
};

/// Stops every node in reverse order: stopping flag first, so that nobody revives what is stopped; SIGTERM,
/// after
/// @p patience SIGKILL; then locks and the domain file are removed. The simulated watchdog is disarmed.
/// Blocks.
[[nodiscard]] DownReport down(const Target& target, milliseconds patience);

/// Asks every node for its state over DDS. Blocks for at most @p deadline.
[[nodiscard]] std::vector<NodeStatus> status(const Target& target, milliseconds deadline);

/// DDS domain of the running suite; nullopt when VAR has none.
[[nodiscard]] std::optional<int> running_domain(const Target& target);

}  // namespace srfs::tool
