// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"
#include "nodes/timing/disciplined_clock.hpp"
#include "nodes/timing/pulse_clock.hpp"
#include "wire/gnss_time.hpp"

namespace srfs {

/// An order to set the time.
struct TimeCommand {
  UtcTime utc;
  MonotonicTime at;         ///< when it is that time
  nanoseconds accuracy{0};  ///< how well that is known
  bool allow_jump = false;  ///< a step, forward or back, is what is wanted
};

/// What became of it.
enum class SetTimeVerdict : std::uint8_t {
  stepped,       ///< the time is set: it was invalid, or the jump was allowed
  slewed,        ///< a small correction: the time slews to it
  jump_refused,  ///< larger than the limit and no jump allowed
  implausible,   ///< no time of 1980 to 2199, or its instant is more than a minute from now
};

/// How wrong the time may be, as ticks, records and telemetry report it: that or more.
inline constexpr nanoseconds largest_error = seconds(1000);
/// Of the structure `timing`: at most largest_error, not a number while the time is not valid.
[[nodiscard]] float telemetered_error_us(std::optional<nanoseconds> error);

/// The whole discipline: pulses, times of day and commands in, one continuous time out. Once the time is
/// valid, nothing but a command that allows a jump makes it step. Pure; one thread.
class TimeDiscipline {
 public:
  /// @param clock  stands at start.utc at @p now; outlives this
  TimeDiscipline(const PulseClockSettings& settings, const ClockStart& start, MonotonicTime now,
                 DisciplinedClock& clock);

  PulseVerdict on_pulse(MonotonicTime edge, MonotonicTime handled);
  TimeOfDayVerdict on_time_of_day(const wire::GnssTime& time, MonotonicTime received);
  /// To call at least once a second.
  void on_time_passing(MonotonicTime now);
  [[nodiscard]] SetTimeVerdict set_time(const TimeCommand& command, MonotonicTime now);

  /// The mission's time.
  [[nodiscard]] UtcTime utc_at(MonotonicTime t) const { return clock_->utc_at(t); }
  /// How wrong that may be, a slew that is not finished included; nullopt while the time is invalid.
  [[nodiscard]] std::optional<nanoseconds> error_at(MonotonicTime t) const;
  /// The command's time minus the mission's at the last set_time().
  [[nodiscard]] nanoseconds commanded_difference() const { return commanded_difference_; }
  [[nodiscard]] const PulseClock& pulse_clock() const { return pulses_; }

 private:
  void follow(MonotonicTime now);

  nanoseconds jump_limit_;
  PulseClock pulses_;
  DisciplinedClock* clock_;
  nanoseconds commanded_difference_{0};
};

}  // namespace srfs
