// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "programs/srfs/suite.hpp"

namespace srfs::tool {

struct RunOrder {
  std::string program;                 ///< a path, or a name beside `srfs`
  std::vector<std::string> arguments;  ///< behind it
  std::string node;                    ///< empty: as the program is called
  std::optional<int> domain;           ///< nullopt: ROS_DOMAIN_ID, else the running suite's, else 42
  std::filesystem::path folder;        ///< its VAR and deployment; empty: ~/.local/state/srfs/run/NODE
};

/// `srfs run PROGRAM [--ros-args ...]`: becomes a node of no suite, which obeys everyone in its DDS domain.
/// @return exit code, when it cannot
int run_program(const Target& target, const RunOrder& order);

}  // namespace srfs::tool
