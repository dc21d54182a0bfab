// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "suite/crash_report.hpp"

namespace srfs {

/// Reports that may wait in the outbox; other files there do not count.
constexpr std::size_t queued_reports_max = 16;

/// Which of a node's reports goes down; nullptr: there is none. Pure.
/// @param reports  oldest first, as find_crash_reports() gives them
/// @param incarnation  nullopt: the newest
[[nodiscard]] const suite::CrashReport* choose_report(const std::vector<suite::CrashReport>& reports,
                                                      std::optional<std::uint32_t> incarnation);

struct QueuedReport {
  std::string name;  ///< NAME.report, in the outbox and on the ground
  std::uint64_t octets = 0;
};
enum class QueueError : std::uint8_t {
  gone,  ///< the report, since it was looked for
  full,
  disk
};
struct QueueFailure {
  QueueError error;
  std::string text;
};

/// Puts a report where the file transfer looks for what to send (lib/cfdp/transfer_folders.hpp): whole, and
/// on the medium when it returns. One that waits there already stays as it is. A hard link, which a full disk
/// allows too; a copy where there can be none. Blocks on the disk. One caller at a time.
/// @param name  on the ground, without ".report". @param file  never written to again, only replaced
[[nodiscard]] Result<QueuedReport, QueueFailure> queue_report(const std::filesystem::path& outbox,
                                                              const std::string& name,
                                                              const std::filesystem::path& file);

}  // namespace srfs
