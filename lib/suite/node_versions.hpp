// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "base/process.hpp"
#include "base/result.hpp"
#include "suite/instance.hpp"
#include "suite/ring/restart_policy.hpp"
#include "update/version_store.hpp"

namespace srfs::suite {

/// The versions of a node (lib/update) as the processes of a suite share them. On disk: the store. On tmpfs:
/// what a restarter decided and the disk, which it does not wait for, may not have yet; and which version the
/// last started process runs.

/// Writes a file of var.memory(). Not write_file_atomically: there is nothing to sync on tmpfs, and one
/// process at a time writes. @return false: not written
bool replace_in_memory(const VarPaths& var, const std::string& name, const std::string& text);
/// Empty when there is none, when it is larger than @p limit, and when another user may have made it.
[[nodiscard]] std::string read_from_memory(const VarPaths& var, const std::string& name, std::size_t limit);

/// VAR/versions/NODE
[[nodiscard]] std::filesystem::path versions_folder(const VarPaths& var, const std::string& node);

struct NodeVersions {
  update::VersionTable table;  ///< what was set aside in this boot counts as failed
  std::string problem;         ///< for people; empty: all is well
};
/// Without a folder: golden alone, at the cost of opening it. Else reads two small files.
[[nodiscard]] NodeVersions read_versions(const VarPaths& var, const std::string& node);

/// The version has failed, from now on and for every process. Under the node's restart lock. Waits for no
/// disk: settle_versions() is to follow. @return false: not stored, no tmpfs
bool set_aside(const VarPaths& var, const std::string& node, update::VersionNumber version,
               const std::string& reason);
/// Writes to disk what was set aside. Blocks on the disk.
[[nodiscard]] Result<void, std::string> settle_versions(const VarPaths& var, const std::string& node);

using VersionChange = std::function<Result<void, std::string>(update::VersionStore&)>;
/// Settles, and changes the store under its lock. Blocks on the disk; for the lock 2 s at most.
[[nodiscard]] Result<void, std::string> change_versions(const VarPaths& var, const std::string& node,
                                                        const VersionChange& change);

/// The process that was started last, living or not.
struct StartedProcess {
  pid_t pid = 0;
  std::uint64_t start_ticks = 0;
  MonotonicTime since;
  update::VersionNumber version = update::golden;
};
void remember_started(const VarPaths& var, const std::string& node, const Process& process, MonotonicTime now,
                      update::VersionNumber version);
/// nullopt: none since boot, or since `srfs down`.
[[nodiscard]] std::optional<StartedProcess> last_started(const VarPaths& var, const std::string& node);

/// The probation of the version that the node's process runs, or ran when it died: nullopt when that one is
/// not on probation. @param seen a process of the node was seen: without a record of it, it is taken to have
/// died at once
[[nodiscard]] std::optional<VersionTrial> trial_of(const VarPaths& var, const RingSettings& ring,
                                                   const std::string& node, const update::VersionTable& table,
                                                   bool seen, MonotonicTime now);

/// Records a violation by a process of a node: its observers are to judge its version. On tmpfs.
void report_violation(const VarPaths& var, const std::string& node, pid_t pid, const std::string& what);
/// nullopt: no violation recorded for this process.
[[nodiscard]] std::optional<std::string> violation_of(const VarPaths& var, const std::string& node,
                                                      pid_t pid);

/// A version of this node passes its probation only when the operator confirms it.
[[nodiscard]] bool needs_confirmation(const RingSettings& ring, const std::string& node);
[[nodiscard]] milliseconds default_probation(const RingSettings& ring, const std::string& node);
/// When the living process of the node was started, if it runs this version.
[[nodiscard]] std::optional<MonotonicTime> runs_since(const VarPaths& var, const std::string& node,
                                                      update::VersionNumber version);

}  // namespace srfs::suite
