// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/time.hpp"

namespace srfs {

/// One reason the hardware watchdog may be fed: true while it is fresh and positive at the given time.
struct WatchdogEvidence {
  std::string name;
  std::function<bool(MonotonicTime)> holds;
};

// What the feeding decides; carried out by the adapter in the given order.

struct FeedWatchdog {};
/// It is due and not fed.
struct WithholdWatchdog {};
/// Something else is missing than before.
struct ReportWithheld {
  std::string what;
};

using FeedingAction = std::variant<FeedWatchdog, WithholdWatchdog, ReportWithheld>;
using FeedingActions = std::vector<FeedingAction>;

/// Decides whether the watchdog may be fed: only while the tick runs on time and every further evidence holds
/// (the ring adds that its critical nodes answered). Whatever is missing starves the watchdog. Pure; one
/// thread.
class WatchdogFeeding {
 public:
  /// @param period     of the tick
  /// @param tolerance  a tick handled later than this after it was due is late
  WatchdogFeeding(nanoseconds period, nanoseconds tolerance) : period_(period), tolerance_(tolerance) {}

  /// For another tick: what was seen of the one before does not count.
  void change_tick(nanoseconds period, nanoseconds tolerance);

  void add_evidence(WatchdogEvidence evidence) { evidence_.push_back(std::move(evidence)); }
  /// @param late    how long after it was due the tick was handled
  /// @param waited  of that, this node's work thread was ready and had no CPU: not counted, a second at most
  void on_tick(nanoseconds late, nanoseconds waited, MonotonicTime now);

  /// The watchdog is due.
  [[nodiscard]] FeedingActions on_due(MonotonicTime now);

 private:
  /// Its name; nullopt: nothing is.
  [[nodiscard]] std::optional<std::string> missing(MonotonicTime now) const;

  static constexpr int late_ticks_allowed = 5;
  static constexpr nanoseconds longest_wait = seconds(1);

  nanoseconds period_;
  nanoseconds tolerance_;
  std::optional<MonotonicTime> last_tick_;
  int late_in_a_row_ = 0;
  std::vector<WatchdogEvidence> evidence_;
  std::string reported_;  ///< missing, as of the last report; empty: nothing
};

}  // namespace srfs
