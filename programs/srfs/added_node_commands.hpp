// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "base/time.hpp"
#include "programs/srfs/suite.hpp"

namespace srfs::tool {

/// `srfs node add FOLDER --program FILE`: what maintenance does with a package of a new node, by hand: the
/// program goes into the version store, the node into the list of added nodes, and it is started.
/// @param folder     with package.yaml, the manifest beside its sources (ground/README.md)
/// @param probation  zero: none, the program is good from now on
int add_node(const Target& target, const std::filesystem::path& folder, const std::filesystem::path& program,
             seconds probation, bool json);
/// `srfs node remove NODE`
int remove_node(const Target& target, const std::string& node, bool json);
/// `srfs node list`: the nodes that were added. Needs neither DDS nor a running suite.
int list_added_nodes(const Target& target, bool json);

}  // namespace srfs::tool
