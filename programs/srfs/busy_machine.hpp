// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/cpu_users.hpp"

namespace srfs::tool {

/// What was seen of the machine.
struct MachineLoad {
  int cpus = 1;
  std::optional<double> load_average;  ///< of the last minute
  std::optional<double> pressure;      ///< cpu_pressure()
  std::vector<CpuUser> users;
};
/// Blocks for a second.
[[nodiscard]] MachineLoad look_at_machine();

/// What a newcomer has to know about a start that was too slow: why, and what to do. Pure.
[[nodiscard]] std::vector<std::string> advice_on(const MachineLoad& load);

}  // namespace srfs::tool
