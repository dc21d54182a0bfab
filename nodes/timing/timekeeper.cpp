// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/timekeeper.hpp"

#include <utility>

namespace srfs {

TimeActions Timekeeper::on_pulse(MonotonicTime edge, MonotonicTime now) {
  if (edge > now) return {};
  const UtcTime before = time_.pulse_clock().utc_at(edge);
  last_pulse_ = edge;
  if (time_.on_pulse(edge, now) != PulseVerdict::adopted) return {};
  const nanoseconds moved = time_.pulse_clock().utc_at(edge) - before;
  return {ReportPulseMoved{static_cast<double>(moved.count()) * 1e-3}};
}

TimeActions Timekeeper::on_time_of_day(const wire::GnssTime& time, MonotonicTime received) {
  const PulseClock& pulses = time_.pulse_clock();
  switch (time_.on_time_of_day(time, received)) {
    case TimeOfDayVerdict::set:
    case TimeOfDayVerdict::corrected:
      return {ReportTimeSet{pulses.utc_at(received)}};
    case TimeOfDayVerdict::jump_refused:
      if (pulses.counters().jumps_refused % refused_jumps_per_event != 1) return {};
      return {ReportJumpRefused{pulses.refused_jump()}};
    case TimeOfDayVerdict::agrees:
    case TimeOfDayVerdict::waiting:
    case TimeOfDayVerdict::implausible:
    case TimeOfDayVerdict::no_pulse:
    case TimeOfDayVerdict::not_a_second:
      break;
  }
  return {};
}

TimeActions Timekeeper::on_time_passing(MonotonicTime now) {
  time_.on_time_passing(now);
  return review_state(now);
}

TimeActions Timekeeper::review_state(MonotonicTime now) {
  const PulseClock& pulses = time_.pulse_clock();
  if (std::exchange(reported_state_, pulses.state()) == pulses.state()) return {};
  if (reported_state_ == mission::SyncState::locked)
    return {ReportLocked{pulses.offset(), pulses.drift_ppm()}};
  if (reported_state_ == mission::SyncState::holdover) return {ReportHoldover{now - last_pulse_}};
  return {};
}

Timekeeper::SetTime Timekeeper::set_time(const TimeCommand& command, MonotonicTime now) {
  SetTime set{time_.set_time(command, now), {}};
  if (set.is_set()) {
    set.actions.emplace_back(ReportTimeSet{command.utc});
  } else {
    set.actions.emplace_back(ReportTimeRejected{command.utc, set.verdict});
  }
  return set;
}

}  // namespace srfs
