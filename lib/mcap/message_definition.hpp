// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace srfs::mcap {

/// The text of a type and of all types that it uses, as MCAP's schema encoding "ros2msg" wants it: each of
/// the others behind a line of 80 '=' and a line "MSG: package/Name".
/// @param type "std_msgs/msg/String" @param folders each with PACKAGE/msg/NAME.msg; the first that has it
/// @return nullopt: one of the files is missing. At most 256 types of 1 MiB
[[nodiscard]] std::optional<std::string> message_definition(
    const std::string& type, const std::vector<std::filesystem::path>& folders);

}  // namespace srfs::mcap
