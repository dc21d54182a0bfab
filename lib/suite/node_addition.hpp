// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "base/result.hpp"
#include "suite/added_nodes.hpp"
#include "update/package.hpp"

namespace srfs::suite {

/// Adding a node to the running system, and removing it. The list of added nodes (added_nodes.hpp) is the one
/// commit point of both: a process killed before the list is replaced leaves the suite as it was, after that
/// as it shall be. All block on the disk, and for the list's lock up to 2 s: not for a work thread.

/// What the package of a new node states of it. @param dictionary  the text of its fragment; empty: it has
/// none
[[nodiscard]] AddedNode added_node_of(const update::Manifest& manifest, std::string dictionary);

/// The node becomes a member of the suite: of its ring, its slot plan and its dictionary, within a second in
/// every process. Its program must be in the version store, active, and whole. Everything is checked before
/// anything is changed: names, description, the place in the ring and in the slot plan, the fragment against
/// the mission's dictionary and those of the other added nodes. Then launch() starts it, or the ring, which
/// misses it.
/// @param node  `flag` is ignored: its slot gets the lowest free position. One that was added exactly so
/// already is no error
/// @param dictionary  folder of the mission dictionary
/// @return why not, ready to print
[[nodiscard]] Result<void, std::string> add_node(const VarPaths& var, const Deployment& deployment,
                                                 AddedNode node, const std::filesystem::path& dictionary);
/// The same with the mission dictionary of this program.
[[nodiscard]] Result<void, std::string> add_node(const VarPaths& var, const Deployment& deployment,
                                                 AddedNode node);

/// The node's process is ended under its restart lock (SIGTERM, after a second SIGKILL), then it leaves the
/// list, then its versions, locks and marks go. Its state and its log stay. Blocks for 5 s at most.
/// @return why not, ready to print; only nodes that were added can be removed
[[nodiscard]] Result<void, std::string> remove_node(const VarPaths& var, const std::string& node);

}  // namespace srfs::suite
