// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace srfs::tool {

/// Where the definitions of message types are, each with PACKAGE/msg/NAME.msg: the folders that the engineer
/// names, this installation or the tree that this was built from, and the ROS 2 of this shell
/// (AMENT_PREFIX_PATH).
[[nodiscard]] std::vector<std::filesystem::path> definition_folders(const std::vector<std::string>& named);

}  // namespace srfs::tool
