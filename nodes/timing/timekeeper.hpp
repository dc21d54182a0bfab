// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <variant>
#include <vector>

#include <mission/structures.hpp>

#include "base/time.hpp"
#include "nodes/timing/time_discipline.hpp"
#include "wire/gnss_time.hpp"

namespace srfs {

// What timekeeping decides; carried out by the adapter in the given order.

/// The clock follows another pulse than before.
struct ReportPulseMoved {
  double moved_us = 0;
};
/// The time was set or corrected; what is on disk is to follow.
struct ReportTimeSet {
  UtcTime utc;
};
/// The receiver insists on another time than the valid one.
struct ReportJumpRefused {
  nanoseconds difference{0};
};
struct ReportTimeRejected {
  UtcTime utc;
  SetTimeVerdict why = SetTimeVerdict::implausible;
};
struct ReportLocked {
  nanoseconds offset{0};
  double drift_ppm = 0;
};
struct ReportHoldover {
  nanoseconds silent{0};  ///< the pulse
};

using TimeAction = std::variant<ReportPulseMoved, ReportTimeSet, ReportJumpRefused, ReportTimeRejected,
                                ReportLocked, ReportHoldover>;
using TimeActions = std::vector<TimeAction>;

/// The discipline of the mission's time, and what of it the operator gets to know. Pure; one thread.
class Timekeeper {
 public:
  /// One event a minute while the receiver insists: its messages come once a second.
  static constexpr std::uint64_t refused_jumps_per_event = 60;

  /// As of TimeDiscipline.
  Timekeeper(const PulseClockSettings& settings, const ClockStart& start, MonotonicTime now,
             DisciplinedClock& clock)
      : time_(settings, start, now, clock) {}

  /// An edge later than @p now cannot be, and is ignored: it would shut out all true ones.
  [[nodiscard]] TimeActions on_pulse(MonotonicTime edge, MonotonicTime now);
  [[nodiscard]] TimeActions on_time_of_day(const wire::GnssTime& time, MonotonicTime received);
  /// To call at least once a second.
  [[nodiscard]] TimeActions on_time_passing(MonotonicTime now);
  /// Whether the clock is locked to the pulse, or in holdover, since the last call. To call when all pulses
  /// that waited were taken.
  [[nodiscard]] TimeActions review_state(MonotonicTime now);

  struct SetTime {
    SetTimeVerdict verdict = SetTimeVerdict::implausible;
    TimeActions actions;
    [[nodiscard]] bool is_set() const {
      return verdict == SetTimeVerdict::stepped || verdict == SetTimeVerdict::slewed;
    }
  };
  [[nodiscard]] SetTime set_time(const TimeCommand& command, MonotonicTime now);

  [[nodiscard]] const TimeDiscipline& time() const { return time_; }

 private:
  TimeDiscipline time_;
  mission::SyncState reported_state_ = mission::SyncState::unlocked;
  MonotonicTime last_pulse_;
};

}  // namespace srfs
