// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/spacecraft_clock.hpp"

#include <cstdint>

namespace srfs {

bool SpacecraftClock::on_tick(const ReceivedTick& tick, MonotonicTime now) {
  constexpr std::uint8_t locked = 2;  // srfs_msgs/TimeTick
  constexpr std::uint8_t holdover = 3;
  const nanoseconds period = std::chrono::microseconds(tick.period_us);
  if (tick.utc_ns >= 1'000'000'000 || tick.monotonic_ns > INT64_MAX || period <= nanoseconds(0) ||
      period > period_max) {
    return false;
  }
  const MonotonicTime due(nanoseconds(static_cast<std::int64_t>(tick.monotonic_ns)));
  if (due > now + tick_age_max || due + tick_age_max < now) return false;
  utc_ = UtcTime(seconds(tick.utc_s) + nanoseconds(tick.utc_ns));
  monotonic_ = due;
  period_ = period;
  if (!tick.time_valid) {
    reference_ = TimeReference::invalid;
  } else if (tick.sync_state == locked) {
    reference_ = TimeReference::locked;
  } else {
    reference_ = tick.sync_state == holdover ? TimeReference::holdover : TimeReference::set_unlocked;
  }
  return true;
}

TimeReference SpacecraftClock::reference_at(MonotonicTime t) const {
  const bool silent = t - monotonic_ > missed_ticks_max * period_;
  return silent && reference_ == TimeReference::locked ? TimeReference::holdover : reference_;
}

}  // namespace srfs
