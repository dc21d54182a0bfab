// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "ground/archive/archive.hpp"
#include "ground/console.hpp"

namespace srfs::ground {

/// How rows of the archive are written.
enum class RowForm : std::uint8_t { lines, json, csv };

struct ArchiveCommand {
  ArchivePlace place;
  RowForm form = RowForm::lines;
  Period period = {};
  std::size_t most = 0;        ///< rows; 0: all
  std::string parameter = {};  ///< of a history
  std::string source = {};     ///< of packets: an application process; empty: all
  unsigned severity = 1;       ///< of events, at least
  std::string table = {};      ///< to prune
  ArchivePlace target = {};    ///< of a copy
};

// They read the archive themselves, beside a server or without one. Output to standard output, errors to
// standard error.
[[nodiscard]] Exit show_events(const ArchiveCommand& command, const mission::Dictionary& dictionary);
[[nodiscard]] Exit show_packets(const ArchiveCommand& command, const mission::Dictionary& dictionary);
[[nodiscard]] Exit show_commands(const ArchiveCommand& command, const mission::Dictionary& dictionary);
[[nodiscard]] Exit show_history(const ArchiveCommand& command, const mission::Dictionary& dictionary);
[[nodiscard]] Exit show_gaps(const ArchiveCommand& command, const mission::Dictionary& dictionary);
[[nodiscard]] Exit show_passes(const ArchiveCommand& command);
[[nodiscard]] Exit show_transfers(const ArchiveCommand& command);
/// Exit::refused: something is wrong with it.
[[nodiscard]] Exit check_archive(const ArchiveCommand& command);
/// No server may run; the caller holds its lock.
[[nodiscard]] Exit repair(const ArchiveCommand& command);
[[nodiscard]] Exit rebuild(const ArchiveCommand& command);
[[nodiscard]] Exit prune(const ArchiveCommand& command);
/// Nobody else writes the target when it is a file. Progress to standard error.
[[nodiscard]] Exit copy(const ArchiveCommand& command);

}  // namespace srfs::ground
