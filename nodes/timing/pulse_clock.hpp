// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include <mission/structures.hpp>

#include "base/time.hpp"
#include "nodes/timing/disciplined_clock.hpp"
#include "nodes/timing/pulse_train.hpp"
#include "nodes/timing/tick_generator.hpp"

namespace srfs {

/// What a pulse was taken for.
enum class PulseVerdict : std::uint8_t {
  accepted,
  outlier,   ///< too far from the prediction: ignored and counted
  rejoined,  ///< after a silence: some pulses in a row agreed, as far off as the oscillator can have wandered
  adopted,   ///< many pulses in a row agreed with each other and none came where expected: believed
  repeated,  ///< not later than the previous pulse
};

/// What a time of day (one message of the receiver) was taken for.
enum class TimeOfDayVerdict : std::uint8_t {
  agrees,        ///< names the second the clock already has
  waiting,       ///< plausible, but more must confirm it first
  set,           ///< the time was invalid and is set
  corrected,     ///< a small correction of a valid time; the published time slews to it
  jump_refused,  ///< the difference is larger than the limit; the clock keeps its time
  implausible,   ///< of a receiver that knows no date
  no_pulse,      ///< no accepted pulse belongs to it, or it is unclear which one
  not_a_second,  ///< no valid fix, no time, or a fraction: says nothing about the pulse
};

struct PulseClockSettings {
  nanoseconds outlier_limit = milliseconds(2);   ///< largest distance from the prediction that is accepted...
  nanoseconds outlier_floor = microseconds(50);  ///< ...and what it shrinks to while pulses are steady
  nanoseconds lock_limit = microseconds(500);    ///< residual below which a pulse counts towards lock
  int pulses_to_lock = 4;                        ///< so many good pulses in a row lock
  int pulses_to_rejoin = 3;                      ///< see PulseVerdict::rejoined
  int pulses_to_restart = 5;                     ///< see adopted, before the first lock
  int pulses_to_adopt = 60;                      ///< and later: a spoofed step must last a minute
  nanoseconds holdover_after = milliseconds(2500);  ///< silence of the pulse
  double drift_limit_ppm = 500;                     ///< worst crystal
  double crystal_ppm = 50;   ///< frequency error of an oscillator that was never compared
  double wander_ppm = 0.3;   ///< of the oscillator since it was compared: what holdover's error grows by
  int times_to_set = 2;      ///< so many consistent times of day set an invalid time
  int times_to_change = 10;  ///< and correct a valid one
  nanoseconds jump_limit = seconds(2);  ///< a larger change of a valid time needs an operator
  /// Times of day are read as of the 1024 weeks from here on (2026-01-01).
  UtcTime not_before{seconds(1'767'225'600)};
};

/// What a clock knows when it starts.
struct ClockStart {
  UtcTime utc;
  bool valid = false;  ///< time was set before (an earlier process of this boot)
  nanoseconds error{0};
  std::optional<double> drift_ppm;  ///< as measured then
};

/// Estimates the phase and the rate of a pulse per second against the monotonic clock and names its seconds
/// by the time of day that follows it. A PI servo whose gains begin as a least-squares fit does and end
/// constant after 34 pulses. Its estimate jumps with each correction; what is published follows it through a
/// DisciplinedClock. The time is invalid until it was set by the receiver or by command. Pure; one thread.
class PulseClock {
 public:
  PulseClock(const PulseClockSettings& settings, const ClockStart& start, MonotonicTime now);

  /// @param edge     monotonic time of the pulse's edge
  /// @param handled  and of this call
  PulseVerdict on_pulse(MonotonicTime edge, MonotonicTime handled);
  /// @param second    the second named; its fraction must be zero. Belongs to the pulse less than a second
  ///                  before it
  /// @param received  when the message was complete
  TimeOfDayVerdict on_time_of_day(UtcTime second, MonotonicTime received);
  /// An operator's word: sets the time, however far it jumps. With a pulse it is rounded to the nearest one.
  void set_time(UtcTime utc, MonotonicTime at, nanoseconds accuracy);
  /// To call at least once a second: notices that the pulse went silent.
  void on_time_passing(MonotonicTime now);
  /// The discipline changed the rate of CLOCK_MONOTONIC itself, at @p now, by so much.
  void on_rate_changed(double ppm, MonotonicTime now);

  [[nodiscard]] mission::SyncState state() const { return state_; }
  [[nodiscard]] bool time_valid() const { return time_valid_; }
  [[nodiscard]] UtcTime utc_at(MonotonicTime t) const;
  /// What the published time has to follow.
  [[nodiscard]] ReferenceTime reference() const;
  /// Where ticks belong; nullopt before the first pulse.
  [[nodiscard]] std::optional<SecondGrid> grid() const;
  /// Last measured pulse minus prediction.
  [[nodiscard]] nanoseconds offset() const { return offset_; }
  /// Rate of the monotonic clock against the pulse; positive: the monotonic clock runs fast.
  [[nodiscard]] double drift_ppm() const { return (second_ns_ / 1e9 - 1.0) * 1e6; }
  /// The drift was measured, here or by the process before.
  [[nodiscard]] bool drift_known() const { return drift_known_; }
  /// How wrong utc_at(t) may be, from the scatter of the pulses and, in holdover, the oscillator's wander;
  /// nullopt while the time is invalid.
  [[nodiscard]] std::optional<nanoseconds> error_at(MonotonicTime t) const;
  /// How far the last refused time of day was from ours.
  [[nodiscard]] nanoseconds refused_jump() const { return refused_jump_; }

  struct Counters {
    std::uint64_t pulses = 0;
    std::uint64_t outliers = 0;
    std::uint64_t repeated_pulses = 0;
    std::uint64_t phase_adoptions = 0;
    std::uint64_t times_without_pulse = 0;
    std::uint64_t implausible_times = 0;
    std::uint64_t week_rollovers = 0;  ///< times of day of another era, put right
    std::uint64_t jumps_refused = 0;
    std::uint64_t times_set = 0;
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  void name_by_nearest_second(UtcTime at_edge, MonotonicTime edge);
  void start_phase(MonotonicTime edge);
  void rejoin(MonotonicTime edge);
  void accept(nanoseconds error, std::int64_t elapsed_s, MonotonicTime edge);
  void count_towards_lock(nanoseconds error);
  PulseVerdict on_outlier(nanoseconds error, MonotonicTime edge);
  [[nodiscard]] nanoseconds window() const;
  [[nodiscard]] nanoseconds wander_window(MonotonicTime edge) const;
  [[nodiscard]] double rate_uncertainty() const;
  [[nodiscard]] bool pulse_rules() const;
  [[nodiscard]] bool belongs_to_pulse(MonotonicTime received) const;

  PulseClockSettings settings_;
  mission::SyncState state_ = mission::SyncState::unlocked;
  bool have_phase_ = false;
  bool was_locked_ = false;
  bool time_valid_ = false;
  bool drift_known_ = false;
  MonotonicTime edge_;      ///< estimated time of the last accepted pulse
  MonotonicTime measured_;  ///< the same as measured: the time of day is matched to it
  std::optional<MonotonicTime> last_pulse_;
  UtcTime utc_at_edge_;
  double second_ns_ = 1e9;
  nanoseconds offset_{0};
  int good_pulses_ = 0;
  int memory_ = 0;        ///< pulses the estimate of the rate rests on, up to a limit
  int phase_memory_ = 0;  ///< and that of the phase
  int outliers_in_row_ = 0;
  double variance_ns2_ = 0;    ///< of the residuals
  nanoseconds label_error_;    ///< how wrong the name of the pulse's second may be
  MonotonicTime label_since_;  ///< without a pulse the error has grown since then
  PulseTrain stray_;

  bool doubtful_ = false;  ///< which pulse a time of day belongs to, until a pulse after this instant:
  MonotonicTime doubtful_since_;

  std::optional<nanoseconds> candidate_;  ///< proposed change of utc_at_edge_
  int candidate_times_ = 0;               ///< pulses whose time of day proposed it
  MonotonicTime candidate_pulse_;
  nanoseconds refused_jump_{0};
  Counters counters_;
};

}  // namespace srfs
