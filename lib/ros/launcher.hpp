#pragma once

#include <filesystem>
#include <string>

#include "base/result.hpp"
#include "ros/deployment.hpp"
#include "ros/instance.hpp"

namespace srfs::ros {

struct LaunchRequest {
  const Deployment& deployment;
  VarPaths var;
  std::filesystem::path bin_folder;  ///< where node executables are
  std::string cause;                 ///< "up", or why this is a restart
};

/// Starts one node, the same way whoever asks: environment, user, scheduling, CPUs, limits, I/O priority,
/// timer slack, working folder, signal mask and descriptors are set absolutely from the deployment. Limits
/// are soft ones: the hard ones stay open, so that a node can start another one whose limits are wider. What
/// the system does not permit leaves the node running without it; the node says so once. The node is no child
/// of the caller. One starter at a time (restart lock); never a second instance (instance lock); never while
/// the suite is stopping. Blocks until the program was executed or failed to (some ms).
/// @return what went wrong, ready to print. A node that runs already is no error: its pid is returned.
[[nodiscard]] Result<pid_t, std::string> launch(const LaunchRequest& request, const NodeEntry& node);

/// Lines NAME=value of those variables of this process that nodes may have: sanitizer settings, the place of
/// the mission dictionary of a build tree, a library path. `srfs up` writes them to
/// VarPaths::environment_file(); whoever starts a node later takes them from there instead of from its own
/// environment.
[[nodiscard]] std::string environment_for_nodes();

/// The folder of the running program's own executable.
[[nodiscard]] std::filesystem::path own_bin_folder();

}  // namespace srfs::ros
