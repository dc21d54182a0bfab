// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "base/result.hpp"
#include "suite/instance.hpp"

namespace srfs::suite {

class HeartbeatPage;

/// From now on a fatal signal (SEGV, BUS, FPE, ILL, ABRT, and with it std::terminate and the SIGABRT of an
/// observer that finds this process hung) writes its name, the thread and 48 frames at most to stderr and the
/// signal into @p page; then the signal does what it does by default. A handler that is there already (a
/// sanitizer's) is left alone. Call once, on the work thread, whose stack may be the cause: it gets another
/// one for this.
/// @param page  outlives the process' last signal
void install_crash_handler(HeartbeatPage& page);

/// The log of a process as it was at its end, though the successor writes on.
struct LogEnd {
  Fd log;
  off_t size = 0;
};
[[nodiscard]] LogEnd remember_log_end(const VarPaths& var, const std::string& node);

struct EndedProcess {
  std::string node;
  std::uint32_t incarnation = 0;
  pid_t pid = 0;
};

/// What the ground needs to understand a death, in one file for a file transfer:
/// VAR/state/NODE/reports/INCARNATION.report, of @p header, the backtrace and the last 64 KiB of the log. At
/// most five per node, the oldest goes. Blocks on the disk.
[[nodiscard]] Result<std::filesystem::path, std::string> write_crash_report(const VarPaths& var,
                                                                            const EndedProcess& process,
                                                                            const std::string& header,
                                                                            const LogEnd& log_end);

struct CrashReport {
  std::uint32_t incarnation = 0;  ///< 0: it ended before it had one
  std::filesystem::path file;
  std::filesystem::file_time_type written;
};
/// Oldest first, by incarnation: clocks are set back. The one without is in front, or at the end when it was
/// written last.
void sort_by_age(std::vector<CrashReport>& reports);
/// Of a node, oldest first. Blocks on the disk.
[[nodiscard]] std::vector<CrashReport> find_crash_reports(const VarPaths& var, const std::string& node);

}  // namespace srfs::suite
