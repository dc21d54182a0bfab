#pragma once

#include "ros/deployment.hpp"
#include "ros/instance.hpp"
#include "ros/ring/fault.hpp"

namespace srfs::ros {

/// The least a restart is: the accused process is killed by its pidfd when it still holds the node's instance
/// lock, and the node is launched. Blocks for 1 s at most. No back-off, no ledger.
[[nodiscard]] RestartOutcome plain_restart(const Deployment& deployment, const VarPaths& var,
                                           const Accusation& accusation);

}  // namespace srfs::ros
