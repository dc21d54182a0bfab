#pragma once

#include <optional>
#include <string>

#include "base/process.hpp"
#include "base/result.hpp"
#include "ros/instance.hpp"
#include "ros/lifecycle.hpp"
#include "ros/ring/restart_policy.hpp"

namespace srfs::ros {

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
/// The process that was started last, while it lives. Only who looked for the instance before knows that it
/// is still starting.
[[nodiscard]] std::optional<StartingProcess> find_starting(const VarPaths& var, const std::string& node);

/// Who has taken the node down to start another version of it, and until when nobody else may think of it as
/// dead: the restart lock keeps others away, this bounds how long. Valid while that process lives; on tmpfs.
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
/// The process of a stand-in that has overrun its lease; nullopt: it has not, or has ended.
[[nodiscard]] std::optional<Process> find_overrun(const StandIn& stand_in, MonotonicTime now);

/// Why the operator holds the node: nobody restarts it, neither dead nor hung. nullopt: not held.
[[nodiscard]] std::optional<std::string> held_because(const VarPaths& var, const std::string& node);
[[nodiscard]] Result<void, std::string> hold(const VarPaths& var, const std::string& node,
                                             const std::string& reason);
/// The state that the node's next start aims at (run_node), for a node that does not come up to be told.
[[nodiscard]] Result<void, std::string> set_desired_state(const VarPaths& var, const std::string& node,
                                                          State state);
/// Lifts hold, back-off and quarantine. Waits for a restart under way, @p patience at most.
[[nodiscard]] Result<void, std::string> release(const VarPaths& var, const std::string& node,
                                                milliseconds patience);

}  // namespace srfs::ros
