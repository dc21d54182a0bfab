// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "base/fd.hpp"
#include "base/result.hpp"
#include "suite/deployment.hpp"
#include "suite/instance.hpp"
#include "suite/ring/fault.hpp"

namespace srfs::suite {

struct LaunchRequest {
  const Deployment& deployment;
  VarPaths var;
  std::filesystem::path bin_folder;  ///< where node executables are
  std::string cause;                 ///< "up", or why this is a restart
};

/// The right to kill and to start one node: one holder in the whole suite, at most, and the kernel takes it
/// back with the holder, however that ends. The file left behind means nothing.
class RestartLock {
 public:
  struct Refusal {
    bool held = false;  ///< by another holder; otherwise there is no place for a lock
    std::string text;   ///< ready to print
  };
  /// Never waits. On a disk that takes no new file the lock is on tmpfs.
  [[nodiscard]] static Result<RestartLock, Refusal> take(const VarPaths& var, const std::string& node);
  RestartLock(RestartLock&&) = default;
  RestartLock& operator=(RestartLock&& other) noexcept {
    std::swap(fd_, other.fd_);  // the other's destructor unlocks
    return *this;
  }
  ~RestartLock();

 private:
  explicit RestartLock(Fd fd) : fd_(std::move(fd)) {}
  Fd fd_;
};

/// Starts one node, in the same way for every caller: environment, user, control group, scheduling, CPUs,
/// limits, I/O priority, timer slack, working folder, signal mask and descriptors are set absolutely from the
/// deployment. Limits are soft ones: the hard ones stay open, so that a node can start another one whose
/// limits are wider. What the system does not permit leaves the node running without it; the node logs that
/// once. The node is no child of the caller. One starter at a time (restart lock); never a second instance
/// (instance lock); never while the suite is stopping. Blocks until the program holds its instance lock or
/// has ended: some 10 ms, 2 s at most.
/// @param patience  with another starter of the node
/// @return what went wrong, ready to print. A node that runs or starts already is no error: its pid is
/// returned.
[[nodiscard]] Result<pid_t, std::string> launch(const LaunchRequest& request, const NodeEntry& node,
                                                nanoseconds patience = {});

/// Whether the program of the active version is read whole and its SHA-256 compared before the start, or its
/// size alone, and all of it only when it did not start.
enum class ProgramCheck : std::uint8_t { size, hash };

struct Launched {
  pid_t pid = 0;
  std::uint32_t version = 0;                ///< 0: golden, the deployment's executable
  std::optional<VersionFallback> fallback;  ///< the active version could not be started
  MonotonicTime stopped{};                  ///< of use_version(): when the process before it was asked to end
};
/// The start alone, for a caller that holds the lock and has checked that no process of the node runs or
/// starts. Works on a full disk; waits for no fsync. Starts the active version (lib/update). One whose
/// program is missing or damaged, and one on probation that does not come to its instance lock, is set aside
/// for the next best: last good, golden, what was good once; settle_versions() is to follow.
[[nodiscard]] Result<Launched, std::string> launch_locked(const LaunchRequest& request, const NodeEntry& node,
                                                          const RestartLock& held, ProgramCheck check);
/// Changes the node to a version and puts it to work: the program is compared with its hash, the change is
/// durable, then the process that runs is ended (SIGTERM, after 1 s SIGKILL) and the active version started.
/// A node that does not run is left to its next start, and so is this process itself. Blocks on the disk, and
/// up to 5 s in all.
/// @param self  name of the node that this process is; empty: none
/// @return what was started; nullopt: nothing was
[[nodiscard]] Result<std::optional<Launched>, std::string> use_version(const LaunchRequest& request,
                                                                       const NodeEntry& node,
                                                                       std::uint32_t version,
                                                                       milliseconds probation,
                                                                       const std::string& self = {});

/// Before `srfs up` starts the first node: a version of this one on probation sees one more start of the
/// suite (lib/update: most_resets). Durable before the start that it counts; one that cannot be counted is
/// set aside at once. Blocks on the disk, only for a node with a version on probation.
void count_suite_start(const LaunchRequest& request, const NodeEntry& node);

/// The start record of a start that has happened. Blocks on the disk.
void count_start_on_disk(const LaunchRequest& request, const NodeEntry& node);

/// Lines NAME=value of those variables of this process that nodes may have: sanitizer settings, the place of
/// the mission dictionary of a build tree, a library path. `srfs up` writes them to
/// VarPaths::environment_file(); later starters of a node take them from there instead of from their own
/// environment.
[[nodiscard]] std::string environment_for_nodes();

/// The folder of the suite's executables: as the starter of this process said, which may run from a slot
/// elsewhere; else that of its own executable.
[[nodiscard]] std::filesystem::path suite_bin_folder();

}  // namespace srfs::suite
