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

/// Starts one node, the same way whoever asks: environment, scheduling, CPUs, limits, working folder, signal
/// mask and descriptors are set absolutely from the deployment. The node is no child of the caller. One
/// starter at a time (restart lock); never a second instance (instance lock); never while the suite is
/// stopping. Blocks until the program was executed or failed to (some ms).
/// @return what went wrong, ready to print. A node that runs already is no error: its pid is returned.
[[nodiscard]] Result<pid_t, std::string> launch(const LaunchRequest& request, const NodeEntry& node);

/// The folder of the running program's own executable.
[[nodiscard]] std::filesystem::path own_bin_folder();

}  // namespace srfs::ros
