// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/watchdog_feeding.hpp"

#include <algorithm>
#include <utility>

namespace srfs {

void WatchdogFeeding::on_tick(nanoseconds late, nanoseconds waited, MonotonicTime now) {
  last_tick_ = now;
  late_in_a_row_ = late - std::min(waited, longest_wait) > tolerance_ ? late_in_a_row_ + 1 : 0;
}

void WatchdogFeeding::change_tick(nanoseconds period, nanoseconds tolerance) {
  period_ = period;
  tolerance_ = tolerance;
  last_tick_.reset();
  late_in_a_row_ = 0;
}

FeedingActions WatchdogFeeding::on_due(MonotonicTime now) {
  const auto what = missing(now);
  if (!what) {
    reported_.clear();
    return {FeedWatchdog{}};
  }
  if (std::exchange(reported_, *what) == *what) return {WithholdWatchdog{}};
  return {WithholdWatchdog{}, ReportWithheld{*what}};
}

std::optional<std::string> WatchdogFeeding::missing(MonotonicTime now) const {
  if (!last_tick_) return "no tick yet";
  if (now - *last_tick_ > 2 * period_ + tolerance_) return "tick stopped";
  if (late_in_a_row_ > late_ticks_allowed) return "tick late";
  for (const WatchdogEvidence& evidence : evidence_) {
    if (!evidence.holds(now)) return evidence.name;
  }
  return std::nullopt;
}

}  // namespace srfs
