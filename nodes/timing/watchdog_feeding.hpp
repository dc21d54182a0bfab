// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"

namespace srfs {

/// One reason the hardware watchdog may be fed: true while it is fresh and positive at the given time.
struct WatchdogEvidence {
  std::string name;
  std::function<bool(MonotonicTime)> holds;
};

/// Decides whether the watchdog may be fed: only while the tick runs on time and every further evidence holds
/// (the ring adds that its critical nodes answered). Whatever is missing starves the watchdog. Pure; one
/// thread.
class WatchdogFeeding {
 public:
  /// @param period     of the tick
  /// @param tolerance  a tick handled later than this after it was due is late
  WatchdogFeeding(nanoseconds period, nanoseconds tolerance) : period_(period), tolerance_(tolerance) {}

  void add_evidence(WatchdogEvidence evidence) { evidence_.push_back(std::move(evidence)); }
  /// @param late    how long after it was due the tick was handled
  /// @param waited  of that, this node's work thread was ready and had no CPU: not counted, a second at most
  void on_tick(nanoseconds late, nanoseconds waited, MonotonicTime now);

  /// The name of what is missing; nullopt: feed.
  [[nodiscard]] std::optional<std::string> missing(MonotonicTime now) const;

 private:
  static constexpr int late_ticks_allowed = 5;
  static constexpr nanoseconds longest_wait = seconds(1);

  nanoseconds period_;
  nanoseconds tolerance_;
  std::optional<MonotonicTime> last_tick_;
  int late_in_a_row_ = 0;
  std::vector<WatchdogEvidence> evidence_;
};

}  // namespace srfs
