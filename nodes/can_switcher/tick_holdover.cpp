// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/tick_holdover.hpp"

#include <algorithm>
#include <utility>

namespace srfs {

nanoseconds TickHoldover::grace(nanoseconds period) {
  return std::max<nanoseconds>(period / 4, milliseconds(5));
}

HoldoverActions TickHoldover::on_tick(const HeardTick& tick) {
  if (!follows(tick.cycle)) {
    ++counters_.repeated;
    return {};
  }
  if (last_cycle_ && tick.cycle > *last_cycle_)
    counters_.missed_cycles += static_cast<std::uint32_t>(tick.cycle - *last_cycle_ - 1);
  last_cycle_ = tick.cycle;
  ++counters_.ticks;

  const bool known = tick.period > nanoseconds(0) && tick.period <= longest_period;
  // Around a change of the period the shorter one counts: the first tick of the new one comes after the old.
  const nanoseconds period =
      known ? std::min(tick.period, period_ > nanoseconds(0) ? period_ : tick.period) : nanoseconds(0);
  const bool plausible = tick.due <= tick.received && tick.received - tick.due <= tick.period;
  const MonotonicTime due = plausible ? tick.due : tick.received;

  HoldoverActions actions = end_outage(due);
  if (last_beat_ && due < *last_beat_ + period / 2) {
    ++counters_.made;
  } else {
    last_beat_ = due;
    actions.emplace_back(Beat{tick.received});
  }
  period_ = known ? tick.period : nanoseconds(0);
  phase_ = last_real_ = due;
  turning_ = true;
  return actions;
}

HoldoverActions TickHoldover::end_outage(MonotonicTime at) {
  const ReportTicksBack outage{std::exchange(in_a_row_, 0), at - last_real_};
  if (!std::exchange(told_, false)) return {};
  return {outage};
}

std::optional<MonotonicTime> TickHoldover::next_substitute() const {
  if (!turning_ || period_ == nanoseconds(0)) return std::nullopt;
  return phase_ + period_ + (in_a_row_ == 0 ? grace(period_) : nanoseconds(0));
}

HoldoverActions TickHoldover::on_deadline(MonotonicTime now) {
  const auto due = next_substitute();
  if (!due || now < *due) return {};
  phase_ = phase_ + period_ * ((now - phase_) / period_);
  last_beat_ = now;
  ++in_a_row_;
  ++counters_.substitutes;
  const Beat beat{now, true};
  if (told_ || now - last_real_ < std::max(2 * period_, least_outage)) return {beat};
  told_ = true;
  ++counters_.outages;
  return {ReportTicksMissing{cycle()}, beat};
}

HoldoverActions TickHoldover::stop(MonotonicTime now) {
  turning_ = false;
  return end_outage(now);
}

void TickHoldover::rest() {
  turning_ = false;
  last_beat_.reset();
  in_a_row_ = 0;
  told_ = false;
}

bool TickHoldover::follows(MissionCycle cycle) {
  const auto plausible_after = [cycle](const std::optional<MissionCycle>& before, MissionCycle farthest) {
    return before && cycle > *before && cycle - *before <= farthest;
  };
  if (!last_cycle_ || plausible_after(last_cycle_, longest_gap) || plausible_after(doubted_cycle_, 10)) {
    doubted_cycle_.reset();
    return true;
  }
  doubted_cycle_ = cycle;
  return false;
}

}  // namespace srfs
