// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include <srfs_msgs/msg/telecommand.hpp>
#include <srfs_msgs/msg/telecommand_report.hpp>

#include "suite/commanding/telecommand_journal.hpp"

namespace srfs {

/// An undefined repeat class is treated as the most careful one, at_most_once.
[[nodiscard]] StoredTelecommand from_message(const srfs_msgs::msg::Telecommand& message);
/// @param node name and incarnation of the node that reports
[[nodiscard]] srfs_msgs::msg::TelecommandReport to_message(const StageReport& report, const std::string& node,
                                                           std::uint32_t incarnation, MonotonicTime now);

/// What an earlier process of the node left in @p file, for this boot of the kernel. A file that cannot be
/// used is logged: stored telecommands and known ids are lost. Blocks on the disk.
[[nodiscard]] TelecommandJournal read_journal(const std::filesystem::path& file);

}  // namespace srfs
