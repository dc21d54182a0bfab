// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"

/// Nodes that run without a deployment (`srfs run`): the one that is written for them. Pure.
namespace srfs::tool {

/// `-p NAME:=VALUE` of a command line.
struct GivenParameter {
  std::string name;
  std::string value;  ///< as in YAML
};

/// What stands behind the program on the command line.
struct AdHocArguments {
  std::vector<GivenParameter> parameters;  ///< -p, --param
  std::vector<std::string> files;          ///< --params-file
  std::vector<std::string> others;         ///< for the program, in their order
};
/// Takes -p and --params-file out of what stands between `--ros-args` and `--`, or the end.
/// @return which of them is wrong
[[nodiscard]] Result<AdHocArguments, std::string> read_ad_hoc_arguments(
    const std::vector<std::string>& arguments);

/// The parameters that a parameter file of ROS 2 has for a node: under "/**", "NAME" or "/NAME" its
/// `ros__parameters`; of a mapping inside, names joined by '.'.
/// @return what is wrong with the file
[[nodiscard]] Result<std::vector<GivenParameter>, std::string> parameters_of_file(const std::string& text,
                                                                                  std::string_view node);

/// "/a/b/tick_counter_node" -> "tick_counter".
[[nodiscard]] std::string node_name_of(std::string_view program);

/// The text of a deployment of this one node, which obeys everyone in its DDS domain.
/// @param parameters the last one of a name counts
/// @return what is wrong with a value
[[nodiscard]] Result<std::string, std::string> ad_hoc_deployment(
    const std::string& node, const std::string& program, const std::vector<GivenParameter>& parameters);

}  // namespace srfs::tool
