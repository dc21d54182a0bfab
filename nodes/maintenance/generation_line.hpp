// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include <mission/structures.hpp>
#include <srfs_msgs/srv/save_parameters.hpp>

namespace srfs {

/// What a node keeps, as the ground gets it: the newest set first; one line for the deployment's values when
/// there is none. What the structure has no room for is cut. Pure.
[[nodiscard]] std::vector<mission::ParameterGenerationHousekeeping> to_mission(
    const std::string& node, const srfs_msgs::srv::SaveParameters_Response& said);

}  // namespace srfs
