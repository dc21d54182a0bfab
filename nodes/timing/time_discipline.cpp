// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/time_discipline.hpp"

#include <algorithm>
#include <limits>

namespace srfs {
namespace {

constexpr UtcTime earliest_settable{seconds(315'532'800)};  // 1980
constexpr UtcTime latest_settable{seconds(7'258'118'400)};  // 2200
constexpr nanoseconds command_age_max = seconds(60);

nanoseconds absolute(nanoseconds d) {
  return d < nanoseconds(0) ? -d : d;
}

}  // namespace

float telemetered_error_us(std::optional<nanoseconds> error) {
  if (!error) return std::numeric_limits<float>::quiet_NaN();
  return static_cast<float>(std::min(*error, largest_error).count()) * 1e-3F;
}

TimeDiscipline::TimeDiscipline(const PulseClockSettings& settings, const ClockStart& start, MonotonicTime now,
                               DisciplinedClock& clock)
    : jump_limit_(settings.jump_limit), pulses_(settings, start, now), clock_(&clock) {}

void TimeDiscipline::follow(MonotonicTime now) {
  pulses_.on_rate_changed(clock_->follow(pulses_.reference(), now), now);
}

PulseVerdict TimeDiscipline::on_pulse(MonotonicTime edge, MonotonicTime handled) {
  const PulseVerdict verdict = pulses_.on_pulse(edge, handled);
  if (verdict != PulseVerdict::outlier && verdict != PulseVerdict::repeated) follow(handled);
  return verdict;
}

TimeOfDayVerdict TimeDiscipline::on_time_of_day(const wire::GnssTime& time, MonotonicTime received) {
  if (!time.fix_valid || !time.utc || time.utc->since_epoch() % seconds(1) != nanoseconds(0))
    return TimeOfDayVerdict::not_a_second;
  const TimeOfDayVerdict verdict = pulses_.on_time_of_day(*time.utc, received);
  if (verdict == TimeOfDayVerdict::set) clock_->step_to(pulses_.utc_at(received), received);
  if (verdict == TimeOfDayVerdict::set || verdict == TimeOfDayVerdict::corrected) follow(received);
  return verdict;
}

void TimeDiscipline::on_time_passing(MonotonicTime now) {
  pulses_.on_time_passing(now);
  follow(now);
}

SetTimeVerdict TimeDiscipline::set_time(const TimeCommand& command, MonotonicTime now) {
  if (command.utc < earliest_settable || command.utc >= latest_settable ||
      absolute(command.at - now) > command_age_max || command.accuracy < nanoseconds(0)) {
    return SetTimeVerdict::implausible;
  }
  commanded_difference_ = command.utc - clock_->utc_at(command.at);
  const bool step = command.allow_jump || !pulses_.time_valid();
  if (!step && absolute(commanded_difference_) > jump_limit_) return SetTimeVerdict::jump_refused;
  pulses_.set_time(command.utc, command.at, command.accuracy);
  if (step) clock_->step_to(pulses_.utc_at(now), now);
  follow(now);
  return step ? SetTimeVerdict::stepped : SetTimeVerdict::slewed;
}

std::optional<nanoseconds> TimeDiscipline::error_at(MonotonicTime t) const {
  const auto error = pulses_.error_at(t);
  if (!error) return std::nullopt;
  return *error + absolute(pulses_.utc_at(t) - clock_->utc_at(t));
}

}  // namespace srfs
