// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include <mission/structures.hpp>

namespace srfs::suite {

struct NodeContext;
class Node;

using NodeFactory = std::function<std::unique_ptr<Node>(NodeContext&)>;

/// Version of this build, "0.2.0".
[[nodiscard]] const char* version();

/// Exit codes of every node.
enum class ExitCode : int {
  stopped = 0,           ///< asked to (SIGTERM, SIGINT)
  bug = 1,               ///< an unexpected exception
  configuration = 2,     ///< arguments or deployment file
  already_running = 3,   ///< another instance holds the lock
  middleware = 4,        ///< no DDS participant
  deaf = 5,              ///< its own liveness checks do not reach it; the ring starts it again
  self_test_failed = 6,  ///< of `--self-test` alone
};

/// Everything a node's main does: arguments, signals (on a descriptor), configuration, instance lock,
/// participant, the way to the desired state, the work loop, deactivation and clean-up before destruction.
/// Blocks until the node ends. With `--self-test` the node goes to Active and back, in a domain and a VAR of
/// its own, without devices and without a ring; the exit code gives the result.
/// @param tables  what the dictionary says of the node. By default that of the mission that the program is
///                built with; a node whose fragment is added in flight gives mission::fragment_tables.
int run_node(int argc, char** argv, const mission::NodeTables& tables, const NodeFactory& factory);

template <class Node>
int run_node(int argc, char** argv, const mission::NodeTables& tables = mission::node_tables) {
  return run_node(argc, argv, tables, [](NodeContext& context) { return std::make_unique<Node>(context); });
}

}  // namespace srfs::suite
