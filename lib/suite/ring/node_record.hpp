// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "base/process.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "ros/lifecycle.hpp"
#include "suite/deployment.hpp"
#include "suite/instance.hpp"
#include "suite/ring/restart_policy.hpp"

namespace srfs::suite {

/// What the restarters of a suite share about one node: the deaths of this boot (on tmpfs) and the operator's
/// hold (on disk, it outlives a boot). Written under the node's restart lock.

/// A missing or damaged file is an empty history.
[[nodiscard]] DeathHistory read_deaths(const VarPaths& var, const std::string& node);
/// Waits for no disk. @return false: not stored; restarts go on without memory of it
bool write_deaths(const VarPaths& var, const std::string& node, const DeathHistory& history);

/// A process that was started (remember_started) and does not hold its instance lock yet.
struct StartingProcess {
  Process process;
  MonotonicTime since;
};
/// The process that was started last, while it lives. Only a caller that looked for the instance before knows
/// that it is still starting.
[[nodiscard]] std::optional<StartingProcess> find_starting(const VarPaths& var, const std::string& node);

/// The process that has taken the node down to start another version of it, and until when no other process
/// may take the node for dead. The restart lock keeps others away; this bounds how long. Valid while that
/// process lives; on tmpfs.
struct StandIn {
  std::string by;  ///< name of a node, or of a tool
  pid_t pid = 0;
  std::uint64_t start_ticks = 0;
  MonotonicTime until;
};
/// Under the node's restart lock. @param by this process. @return false: not stored, no tmpfs
bool write_stand_in(const VarPaths& var, const std::string& node, const std::string& by, MonotonicTime until);
void end_stand_in(const VarPaths& var, const std::string& node);
[[nodiscard]] std::optional<StandIn> read_stand_in(const VarPaths& var, const std::string& node);
/// The process of a stand-in that has overrun its lease, to be killed; nullopt: it has not, or has ended, or
/// the record may not name it (VarPaths::may_name).
[[nodiscard]] std::optional<Process> find_overrun(const VarPaths& var, const StandIn& stand_in,
                                                  MonotonicTime now);

/// An operator's orders to a node: held, or a state other than Active. They stand until they are lifted, on
/// disk. Those to a node of the command path stand on tmpfs and end by themselves: after
/// ring.command_path_limit, with a reset, `srfs down` or a restart of the suite by the watchdog. Otherwise
/// they could never be lifted.
/// @return nullopt: an order given @p now stands until it is lifted
[[nodiscard]] std::optional<MonotonicTime> end_of_order(const Deployment& deployment, const std::string& node,
                                                        MonotonicTime now);

/// Why the operator holds the node: it is not restarted, neither dead nor hung. nullopt: not held.
[[nodiscard]] std::optional<std::string> held_because(const VarPaths& var, const Deployment& deployment,
                                                      const std::string& node, MonotonicTime now);
[[nodiscard]] Result<void, std::string> hold(const VarPaths& var, const Deployment& deployment,
                                             const std::string& node, const std::string& reason,
                                             MonotonicTime now);

struct DesiredState {
  ros::State state = ros::State::active;
  std::optional<MonotonicTime> until;  ///< then Active
};
/// The state that the node's next start aims at (run_node).
[[nodiscard]] DesiredState desired_state(const VarPaths& var, const Deployment& deployment,
                                         const std::string& node, MonotonicTime now);
[[nodiscard]] Result<void, std::string> set_desired_state(const VarPaths& var, const Deployment& deployment,
                                                          const std::string& node, ros::State state,
                                                          MonotonicTime now);
/// Lifts hold, back-off and quarantine. Waits for a restart under way, @p patience at most.
[[nodiscard]] Result<void, std::string> release(const VarPaths& var, const std::string& node,
                                                milliseconds patience);

}  // namespace srfs::suite
