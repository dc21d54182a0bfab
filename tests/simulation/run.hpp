// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <string>

#include "tests/simulation/coverage.hpp"
#include "tests/simulation/faults.hpp"
#include "tests/simulation/kernel.hpp"

namespace srfs::simulation {

struct RunSettings {
  std::uint64_t seed = 1;
  FaultSet faults;
  nanoseconds duration = seconds(3600);  ///< virtual
  std::FILE* trace = nullptr;
  std::string* plot = nullptr;  ///< gets the run as SVG
};

/// What a run came to. The same settings give the same outcome, octet by octet.
struct RunOutcome {
  std::optional<Violation> violation;
  nanoseconds at{0};    ///< end of the run, since its begin
  std::string diagram;  ///< of the last steps before the violation
  std::uint64_t hash = 0;
  std::uint64_t steps = 0;
  std::uint64_t events = 0;
  std::uint64_t ticks = 0;
  std::uint64_t slots = 0;  ///< granted
  std::uint64_t telecommands = 0;
  std::uint64_t completed = 0;  ///< of them
  std::uint64_t released = 0;   ///< by the schedule
  std::uint64_t stored = 0;     ///< packets in the stores, synced
  std::uint64_t retrieved = 0;  ///< periods of them, compared
  std::uint64_t files = 0;      ///< that arrived, compared
  std::uint64_t packages = 0;   ///< made
  std::uint64_t installed = 0;  ///< of them
  std::uint64_t starts = 0;     ///< of processes
  std::uint32_t boots = 0;
  std::uint64_t faults = 0;  ///< injected
  /// Writes of ttc's journal in which its process ended: nothing was written, written, written and synced.
  std::array<std::uint64_t, 3> journal_cut{};
  TransitionCounts transitions{};
};

[[nodiscard]] RunOutcome run(const RunSettings& settings);

/// The fewest faults with which the run still fails in the same check: each fault that is not needed is
/// left out, until none can be.
[[nodiscard]] FaultSet shrink(const RunSettings& settings, const RunOutcome& failed);

}  // namespace srfs::simulation
