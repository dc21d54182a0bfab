// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.hpp"

namespace srfs {

/// CPU time of one process so far, from /proc/PID/stat.
struct ProcessTicks {
  std::string name;  ///< at most 15 characters, the kernel's
  std::uint64_t ticks = 0;
};
/// nullopt: not of that form. Pure.
[[nodiscard]] std::optional<ProcessTicks> parse_process_stat(std::string_view text);

using ProcessTable = std::map<pid_t, ProcessTicks>;
/// All processes of this machine, 4096 at most. Blocks as /proc does: some ms with a few hundred processes.
[[nodiscard]] ProcessTable read_process_table();

/// All processes of one name.
struct CpuUser {
  std::string name;
  int processes = 0;
  double cpus = 0;    ///< 1: one CPU's whole time
  pid_t largest = 0;  ///< of these processes, the one that used most
};
/// The users of the CPUs between two readings, the largest first, those above 5 % of one CPU. Pure.
[[nodiscard]] std::vector<CpuUser> largest_cpu_users(const ProcessTable& before, const ProcessTable& after,
                                                     nanoseconds elapsed, std::size_t most = 5);
/// "stress-ng (16 processes) 180 %, ttc_node 3 %"; 100 %: one CPU. Pure.
[[nodiscard]] std::string to_text(const std::vector<CpuUser>& users);

/// The share of the last 10 s in which some task of this machine waited for a CPU, 0 to 1
/// (/proc/pressure/cpu); nullopt: a kernel without pressure stall information. Blocks for a moment.
[[nodiscard]] std::optional<double> cpu_pressure();
/// At this pressure and above a machine is busy: the suite spaces its starts.
inline constexpr double busy_cpu_pressure = 0.6;
/// "some avg10=12.34 avg60=..." of that file. Pure.
[[nodiscard]] std::optional<double> parse_pressure(std::string_view text);

}  // namespace srfs
