// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"

namespace srfs::ros {

enum class NameKind : std::uint8_t { topic, service };

/// One remapping rule, as `--ros-args -r FROM:=TO` gives it (design.ros2.org: "Remapping Names").
struct RemapRule {
  std::string from;
  std::string to;
  std::string node = {};    ///< it holds for the node of this name alone; empty: for all
  bool of_topics = true;    ///< false with "rosservice://"
  bool of_services = true;  ///< false with "rostopic://"
  friend bool operator==(const RemapRule&, const RemapRule&) = default;
};

/// The rule in "[NODE:][rostopic://|rosservice://]FROM:=TO". @return what is wrong with it
[[nodiscard]] Result<RemapRule, std::string> parse_remap_rule(std::string_view text);

/// A command line, its ROS arguments apart: what stands between `--ros-args` and `--`, or the end.
struct CommandLine {
  std::vector<RemapRule> remap;     ///< `-r RULE`, `--remap RULE`
  std::vector<std::string> others;  ///< all that is no ROS argument, in its order; without the program's name
};
/// @return which ROS argument is wrong, or not known here
[[nodiscard]] Result<CommandLine, std::string> read_command_line(int argc, const char* const* argv);

/// Why @p name cannot be the name of a topic or service, as rcl judges it: parts of letters, digits and '_'
/// that do not begin with a digit, separated by single '/', at most 247 characters. A first "~/" or "/" is
/// part of it. Empty: it can.
[[nodiscard]] std::string refusal_of_name(std::string_view name);

/// A node's name, its namespace, and what its topics and services are called for others. Pure.
class NodeNames {
 public:
  /// The rules `__node`, `__name` and `__ns` change the node itself. The first rule that matches is used, as
  /// in rcl; a rule for a node means its first name.
  /// @param name without slash; @param name_space "/" or "/a/b"
  explicit NodeNames(std::string name, std::string name_space = "/", std::vector<RemapRule> rules = {});

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const std::string& name_space() const { return name_space_; }
  /// "/NAME", "/NAMESPACE/NAME".
  [[nodiscard]] std::string full_name() const;
  /// The absolute name after remapping. @param name "/x" absolute, "~/x" below the node, "x" in its namespace
  [[nodiscard]] std::string resolve(std::string_view name, NameKind kind) const;

 private:
  [[nodiscard]] std::string expand(std::string_view name) const;

  std::string name_;
  std::string name_space_;
  std::vector<RemapRule> rules_;
};

}  // namespace srfs::ros
