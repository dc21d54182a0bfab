// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace srfs::mcap {

/// A field's line of a .msg file: "geometry_msgs/Point[<=4] points  # where".
struct MessageLine {
  std::string_view type;   ///< without bounds: "geometry_msgs/Point", "string"
  std::string_view array;  ///< "[<=4]"; empty: none
  std::string_view name;   ///< "points"
};

/// @return nullopt: a comment, a constant or nothing
[[nodiscard]] std::optional<MessageLine> field_of(std::string_view line);

/// bool, float32, string and so on; also time and duration of ROS 1
[[nodiscard]] bool is_primitive(std::string_view type);

/// A type as a package's message names it. "Part" of the package own -> own, Part; "p/msg/Part" -> p, Part
struct TypeName {
  std::string package;
  std::string name;
  friend bool operator==(const TypeName&, const TypeName&) = default;
};
[[nodiscard]] TypeName type_name(std::string_view type, const std::string& package);

}  // namespace srfs::mcap
