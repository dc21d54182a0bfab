// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tick_counter.hpp"

namespace srfs {

std::optional<mission::TickCounterCountedEvent> TickCounter::on_tick(std::uint32_t report_every) {
  ++ticks_;
  if (ticks_ % report_every != 0) return std::nullopt;
  return mission::TickCounterCountedEvent{.ticks = ticks_};
}

FailureCode TickCounter::execute(const mission::TickCounterClear& /*command*/) {
  ticks_ = 0;
  ++clears_;
  return mission::failure::none;
}

mission::TickCounterHousekeeping TickCounter::housekeeping(MissionCycle cycle) const {
  mission::TickCounterHousekeeping hk;
  hk.cycle = cycle;
  hk.ticks = ticks_;
  hk.clears = clears_;
  return hk;
}

FailureCode TickCounter::execute(const mission::TickCounterSetStart& command) {
  set_start_ = command.value;
  return mission::failure::none;
}

}  // namespace srfs
