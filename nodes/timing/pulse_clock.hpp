#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"
#include "nodes/timing/tick_generator.hpp"

namespace srfs {

/// How well the clock follows the pulse. Values of srfs_msgs/TimeTick.
enum class SyncState : std::uint8_t { unlocked = 0, locking = 1, locked = 2, holdover = 3 };

/// What a pulse was taken for.
enum class PulseVerdict : std::uint8_t {
  accepted,
  outlier,   ///< too far from the prediction: ignored and counted
  adopted,   ///< several outliers in a row agreed with each other: the phase follows them now
  repeated,  ///< not later than the previous pulse
};

/// What a time of day (one NMEA sentence) was taken for.
enum class TimeOfDayVerdict : std::uint8_t {
  agrees,        ///< names the second the clock already has
  waiting,       ///< plausible, but more sentences must confirm it first
  set,           ///< the time is set (first time, or a small correction)
  jump_refused,  ///< the difference is larger than the limit; the clock keeps its time
  implausible,   ///< before the earliest plausible time
  no_pulse,      ///< no accepted pulse belongs to it
};

struct PulseClockSettings {
  nanoseconds outlier_limit = milliseconds(2);  ///< largest accepted distance from the prediction when locked
  nanoseconds lock_limit = microseconds(500);   ///< residual below which a pulse counts towards lock
  int pulses_to_lock = 4;                       ///< so many good pulses in a row lock
  int outliers_to_adopt = 5;  ///< so many outliers in a row that agree with each other are believed
  nanoseconds holdover_after = milliseconds(2500);  ///< silence of the pulse
  double drift_limit_ppm = 500;                     ///< worst crystal
  int sentences_to_set = 2;                         ///< so many consistent times of day set the time
  nanoseconds jump_limit = seconds(2);              ///< a larger change of a valid time needs an operator
  UtcTime earliest_plausible{
      seconds(1'735'689'600)};  ///< 2025-01-01: a receiver after a week rollover says less
};

/// Disciplines a mission clock by a pulse per second and the time of day that follows it. Estimates the phase
/// and the rate of the pulse against the monotonic clock with a proportional-integral filter; never touches a
/// system clock. The time is invalid until it was set by the receiver or by command. Pure; one thread.
class PulseClock {
 public:
  /// @param start  UTC to start from at @p now
  /// @param valid  that time was set before (an earlier process of this boot); else it is invalid until set
  PulseClock(const PulseClockSettings& settings, UtcTime start, MonotonicTime now, bool valid = false);

  /// @param edge  monotonic time of the pulse's edge (not of its handling)
  PulseVerdict on_pulse(MonotonicTime edge);
  /// @param second    the second named; its fraction must be zero
  /// @param received  when the sentence was complete; belongs to the pulse less than a second before it
  TimeOfDayVerdict on_time_of_day(UtcTime second, MonotonicTime received);
  /// An operator's word: sets the time, however far it jumps. With a locked pulse it is rounded to the
  /// nearest pulse.
  void set_time(UtcTime utc, MonotonicTime at);
  /// To call at least once a second: notices that the pulse went silent.
  void on_time_passing(MonotonicTime now);

  [[nodiscard]] SyncState state() const { return state_; }
  [[nodiscard]] bool time_valid() const { return time_valid_; }
  [[nodiscard]] UtcTime utc_at(MonotonicTime t) const;
  /// Where ticks belong; nullopt before the first pulse.
  [[nodiscard]] std::optional<SecondGrid> grid() const;
  /// Last measured pulse minus prediction.
  [[nodiscard]] nanoseconds offset() const { return offset_; }
  /// Rate of the monotonic clock against the pulse; positive: the monotonic clock runs fast.
  [[nodiscard]] double drift_ppm() const { return (second_ns_ / 1e9 - 1.0) * 1e6; }
  /// How far the last refused time of day was from ours.
  [[nodiscard]] nanoseconds refused_jump() const { return refused_jump_; }

  struct Counters {
    std::uint64_t pulses = 0;
    std::uint64_t outliers = 0;
    std::uint64_t repeated_pulses = 0;
    std::uint64_t phase_adoptions = 0;
    std::uint64_t sentences_without_pulse = 0;
    std::uint64_t implausible_times = 0;
    std::uint64_t jumps_refused = 0;
    std::uint64_t times_set = 0;
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  void start_phase(MonotonicTime edge);
  void steer(nanoseconds error, std::int64_t elapsed_s, MonotonicTime edge);
  PulseVerdict on_outlier(MonotonicTime edge);
  void move_to(MonotonicTime estimated_edge, std::int64_t elapsed_s);
  [[nodiscard]] nanoseconds outlier_window(MonotonicTime edge) const;

  PulseClockSettings settings_;
  SyncState state_ = SyncState::unlocked;
  bool have_phase_ = false;
  bool time_valid_ = false;
  MonotonicTime edge_;      ///< estimated time of the last accepted pulse
  MonotonicTime measured_;  ///< the same as measured: the time of day is matched to it
  std::optional<MonotonicTime> last_pulse_;
  UtcTime utc_at_edge_;
  double second_ns_ = 1e9;
  nanoseconds offset_{0};
  int good_pulses_ = 0;
  std::uint64_t accepted_pulses_ = 0;

  std::optional<MonotonicTime> last_outlier_;
  int agreeing_outliers_ = 0;

  std::optional<nanoseconds> candidate_;  ///< proposed change of utc_at_edge_
  int candidate_sentences_ = 0;
  nanoseconds refused_jump_{0};
  Counters counters_;
};

}  // namespace srfs
