// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"
#include "suite/commanding/command_set.hpp"

#include "tick_counter_structures.hpp"

namespace srfs {

/// What the node decides: it counts ticks, and reports every so many of them. Pure: no DDS, no clock.
class TickCounter {
 public:
  /// Each has an execute() below.
  using Commands = CommandSet<mission::TickCounterClear, mission::TickCounterSetStart>;

  /// @param report_every  ticks, at least 1
  /// @return the event that is due; nullopt: none
  [[nodiscard]] std::optional<mission::TickCounterCountedEvent> on_tick(std::uint32_t report_every);

  /// @return mission::failure::none: done; else the telecommand fails with this code
  [[nodiscard]] FailureCode execute(const mission::TickCounterClear& command);
  [[nodiscard]] FailureCode execute(const mission::TickCounterSetStart& command);
  /// What the last tick_counter.set_start brought; nullopt: none came yet.
  [[nodiscard]] std::optional<std::uint32_t> set_start() const { return set_start_; }

  [[nodiscard]] mission::TickCounterHousekeeping housekeeping(MissionCycle cycle) const;

 private:
  std::uint32_t ticks_ = 0;   ///< since the start or the last clear
  std::uint32_t clears_ = 0;  ///< executed
  std::optional<std::uint32_t> set_start_;
};

}  // namespace srfs
