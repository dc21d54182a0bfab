// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "programs/srfs/answer.hpp"
#include "programs/srfs/suite.hpp"

namespace srfs::tool {

/// `srfs lifecycle NODE TRANSITION`: requests a transition and waits for its end. A transition that takes
/// longer is not taken for a failed one. Blocks up to @p deadline, plus 1.5 s to find the node.
int change_state(const Target& target, const std::string& node, const std::string& label,
                 milliseconds deadline, bool json);

/// `srfs stats NODE`: run times of its callbacks, what was lost at its inputs.
int show_statistics(const Target& target, const std::string& node, bool reset, bool json);

/// `srfs param ...`. Values are written as in YAML ("5", "true", "[1, 2]").
int list_parameters(const Target& target, const std::string& node, bool json);
int get_parameter(const Target& target, const std::string& node, const std::string& name, bool json);
/// @param name  empty: all of the node; as JSON a list of what one has alone
int describe_parameter(const Target& target, const std::string& node, const std::string& name, bool json);
/// @param next_start  store the value for the next start instead of changing it now (read-only parameters)
int set_parameter(const Target& target, const std::string& node, const std::string& name,
                  const std::string& value, bool next_start, bool json);
/// What a node keeps over its restarts (srfs_msgs/srv/SaveParameters).
/// @param names  empty: all that differ from the deployment (keep), all that are stored (forget)
int keep_parameters(const Target& target, const std::string& node, const std::vector<std::string>& names,
                    bool json);
int forget_parameters(const Target& target, const std::string& node, const std::vector<std::string>& names,
                      bool json);
int confirm_parameters(const Target& target, const std::string& node, bool json);
int restore_parameters(const Target& target, const std::string& node, std::uint32_t generation, bool json);
int reset_parameters(const Target& target, const std::string& node, bool json);
int show_parameter_history(const Target& target, const std::string& node, bool json);

}  // namespace srfs::tool
