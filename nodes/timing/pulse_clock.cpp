// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/pulse_clock.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include <mission/structures.hpp>

#include "wire/gnss_time.hpp"

namespace srfs {
namespace {

constexpr double second_nominal_ns = 1e9;

// Gains of a least-squares line through the last n pulses, taken recursively; n grows to memory_limit (time
// constant about a minute, noise of the rate 0.02 of the pulses' per second) and stays there.
constexpr int memory_limit = 34;
double phase_gain(int n) {
  return 2.0 * (2.0 * n - 1) / (n * (n + 1.0));
}
double rate_gain(int n) {
  return 6.0 / (n * (n + 1.0));
}

// The message that names a pulse's second comes after it: no receiver has computed and sent one so early,
// and past the end it may belong to the next.
constexpr nanoseconds earliest_message = milliseconds(20);
constexpr nanoseconds latest_message = milliseconds(980);
// Returning pulses may be off by this much per second of silence; others come from another source.
constexpr nanoseconds silent_growth_per_s = microseconds(5);
constexpr nanoseconds widest_window = milliseconds(250);
// A time not further off names the right second.
constexpr nanoseconds surely_nearest = milliseconds(400);
constexpr double variance_weight = 1.0 / 16;
constexpr double gate_sigmas = 8;
constexpr int widest_gate_shift = 10;

nanoseconds absolute(nanoseconds d) {
  return d < nanoseconds(0) ? -d : d;
}

nanoseconds rounded_ns(double ns) {
  return nanoseconds(std::llround(ns));
}

nanoseconds times(std::int64_t n, double second_ns) {
  return seconds(n) + rounded_ns(static_cast<double>(n) * (second_ns - second_nominal_ns));
}

UtcTime rounded_to_second(UtcTime t) {
  return UtcTime(std::chrono::floor<seconds>(t.since_epoch() + milliseconds(500)));
}

}  // namespace

PulseClock::PulseClock(const PulseClockSettings& settings, const ClockStart& start, MonotonicTime now)
    : settings_(settings),
      time_valid_(start.valid),
      drift_known_(start.drift_ppm.has_value()),
      edge_(now),
      measured_(now),
      utc_at_edge_(start.utc),
      label_error_(start.error),
      label_since_(now) {
  const double limit = settings_.drift_limit_ppm;
  if (start.drift_ppm) second_ns_ += std::clamp(*start.drift_ppm, -limit, limit) * 1e3;
}

UtcTime PulseClock::utc_at(MonotonicTime t) const {
  return reference().utc_at(t);
}

ReferenceTime PulseClock::reference() const {
  return {edge_, utc_at_edge_, (second_nominal_ns / second_ns_ - 1) * 1e6};
}

std::optional<SecondGrid> PulseClock::grid() const {
  if (!have_phase_) return std::nullopt;
  return SecondGrid{edge_, std::chrono::floor<seconds>(utc_at_edge_.since_epoch()).count(), second_ns_};
}

bool PulseClock::pulse_rules() const {
  return state_ == mission::SyncState::locked || state_ == mission::SyncState::locking;
}

/// Largest accepted distance from the prediction.
nanoseconds PulseClock::window() const {
  // Until two seconds were measured, the crystal's tolerance is the measure.
  if (memory_ < 3) {
    const bool unknown = !drift_known_ || memory_ == 2;
    return settings_.outlier_limit + (unknown ? rounded_ns(settings_.drift_limit_ppm * 1e3) : nanoseconds(0));
  }
  if (state_ == mission::SyncState::locking) return settings_.outlier_limit;
  const nanoseconds scatter = rounded_ns(gate_sigmas * std::sqrt(variance_ns2_));
  const nanoseconds steady = std::min(std::max(settings_.outlier_floor, scatter), settings_.outlier_limit);
  // What shuts out too much opens again.
  return std::min(steady * (std::int64_t{1} << std::min(outliers_in_row_, widest_gate_shift)),
                  settings_.outlier_limit);
}

/// How far the oscillator can have moved since the last accepted pulse.
nanoseconds PulseClock::wander_window(MonotonicTime edge) const {
  const std::int64_t silent_s = std::clamp<std::int64_t>((edge - edge_) / seconds(1), 0, 100'000);
  nanoseconds window = settings_.outlier_limit + silent_growth_per_s * silent_s;
  if (!drift_known_) window += rounded_ns(settings_.drift_limit_ppm * 1e3 * static_cast<double>(silent_s));
  return std::min(window, widest_window);
}

/// A pulse after none: it begins the second that is nearest by our own time.
void PulseClock::name_by_nearest_second(UtcTime at_edge, MonotonicTime edge) {
  const auto error = error_at(edge);
  if (error && *error < surely_nearest) label_error_ = nanoseconds(0);
  utc_at_edge_ = rounded_to_second(at_edge);
}

void PulseClock::start_phase(MonotonicTime edge) {
  name_by_nearest_second(utc_at(edge), edge);
  if (!drift_known_) second_ns_ = second_nominal_ns;
  edge_ = edge;
  measured_ = edge;
  have_phase_ = true;
  memory_ = 1;
  phase_memory_ = 1;
  good_pulses_ = 0;
  outliers_in_row_ = 0;
  offset_ = nanoseconds(0);
  stray_.forget();
  candidate_.reset();
  state_ = mission::SyncState::locking;
}

/// After a silence: the phase is taken anew, the rate is known from before.
void PulseClock::rejoin(MonotonicTime edge) {
  const int memory = memory_;
  start_phase(edge);
  if (memory >= 3) memory_ = memory;
}

PulseVerdict PulseClock::on_pulse(MonotonicTime edge, MonotonicTime handled) {
  ++counters_.pulses;
  if (last_pulse_ && edge <= *last_pulse_) {
    ++counters_.repeated_pulses;
    return PulseVerdict::repeated;
  }
  last_pulse_ = edge;
  // Handled late, a message that waits beside it may belong to the pulse before.
  if (handled - edge > earliest_message) {
    doubtful_ = true;
    doubtful_since_ = handled;
  } else if (edge > doubtful_since_) {
    doubtful_ = false;
  }
  if (!have_phase_) {
    start_phase(edge);
    return PulseVerdict::accepted;
  }

  const double elapsed = static_cast<double>((edge - edge_).count()) / second_ns_;
  const std::int64_t elapsed_s = std::llround(elapsed);
  const nanoseconds error = (edge - edge_) - times(elapsed_s, second_ns_);
  if (elapsed_s < 1 || absolute(error) > window()) return on_outlier(error, edge);
  accept(error, elapsed_s, edge);
  return PulseVerdict::accepted;
}

void PulseClock::accept(nanoseconds error, std::int64_t elapsed_s, MonotonicTime edge) {
  const bool after_silence = edge - measured_ > settings_.holdover_after;
  utc_at_edge_ += seconds(elapsed_s);
  if (!pulse_rules()) name_by_nearest_second(utc_at_edge_, edge);
  offset_ = error;
  measured_ = edge;
  outliers_in_row_ = 0;
  stray_.forget();
  const auto error_ns = static_cast<double>(error.count());
  memory_ = std::min(memory_ + 1, memory_limit);
  phase_memory_ = after_silence && memory_ >= 3 ? 1 : std::min(phase_memory_ + 1, memory_limit);
  // The phase alone is taken anew after a silence: by averaging until that is no faster than the filter.
  const double of_phase =
      phase_memory_ < memory_ ? std::max(1.0 / phase_memory_, phase_gain(memory_)) : phase_gain(memory_);
  if (memory_ >= 3) {
    const double weight = memory_ == 3 ? 1.0 : variance_weight;
    variance_ns2_ += (error_ns * error_ns - variance_ns2_) * weight;
  }
  const double limit_ns = settings_.drift_limit_ppm * 1e-6 * second_nominal_ns;
  second_ns_ = std::clamp(second_ns_ + error_ns / static_cast<double>(elapsed_s) * rate_gain(memory_),
                          second_nominal_ns - limit_ns, second_nominal_ns + limit_ns);
  edge_ = edge - rounded_ns(error_ns * (1.0 - std::min(of_phase, 1.0)));
  if (memory_ >= 3) drift_known_ = true;
  count_towards_lock(error);
}

void PulseClock::count_towards_lock(nanoseconds error) {
  if (!pulse_rules()) {
    state_ = mission::SyncState::locking;
    good_pulses_ = 0;
  }
  good_pulses_ = absolute(error) <= settings_.lock_limit ? good_pulses_ + 1 : 0;
  if (state_ == mission::SyncState::locking && good_pulses_ >= settings_.pulses_to_lock) {
    state_ = mission::SyncState::locked;
    was_locked_ = true;
  }
}

PulseVerdict PulseClock::on_outlier(nanoseconds error, MonotonicTime edge) {
  ++counters_.outliers;
  ++outliers_in_row_;
  const nanoseconds tolerance = settings_.lock_limit + rounded_ns(settings_.drift_limit_ppm * 1e3);
  const int agreeing = stray_.on_pulse(edge, tolerance);
  const bool silent = edge - measured_ > settings_.holdover_after;
  if (silent && absolute(error) <= wander_window(edge) && agreeing >= settings_.pulses_to_rejoin) {
    rejoin(edge);
    return PulseVerdict::rejoined;
  }
  if (agreeing < (was_locked_ ? settings_.pulses_to_adopt : settings_.pulses_to_restart))
    return PulseVerdict::outlier;
  ++counters_.phase_adoptions;
  start_phase(edge);
  return PulseVerdict::adopted;
}

void PulseClock::on_time_passing(MonotonicTime now) {
  if (!have_phase_ || now - measured_ <= settings_.holdover_after) return;
  if (state_ == mission::SyncState::locked) state_ = mission::SyncState::holdover;
  if (state_ == mission::SyncState::locking) {
    // Never locked, or lost again before it locked: the time it has is still the best known.
    state_ = time_valid_ ? mission::SyncState::holdover : mission::SyncState::unlocked;
  }
  good_pulses_ = 0;
}

void PulseClock::on_rate_changed(double ppm, MonotonicTime now) {
  if (ppm == 0) return;
  // At this instant nothing changes but the slope of the line.
  const double changed = second_ns_ + ppm * 1e3;
  const auto since_ns = static_cast<double>((now - edge_).count());
  edge_ = edge_ - rounded_ns(since_ns * (changed - second_ns_) / second_ns_);
  second_ns_ = changed;
}

double PulseClock::rate_uncertainty() const {
  if (memory_ < 3) return (drift_known_ ? settings_.wander_ppm : settings_.crystal_ppm) * 1e-6;
  const double n = memory_;
  return settings_.wander_ppm * 1e-6 + 3e-9 * std::sqrt(12 * variance_ns2_ / (n * n * n));
}

std::optional<nanoseconds> PulseClock::error_at(MonotonicTime t) const {
  if (!time_valid_) return std::nullopt;
  const MonotonicTime since = have_phase_ ? std::max(measured_, label_since_) : label_since_;
  const auto grown = rounded_ns(std::max(0.0, static_cast<double>((t - since).count())) * rate_uncertainty());
  nanoseconds error = label_error_ + grown;
  if (have_phase_) error += memory_ >= 3 ? rounded_ns(std::sqrt(variance_ns2_)) : settings_.lock_limit;
  // The receiver has begun to insist on another second.
  if (candidate_ && candidate_times_ > 1) error += absolute(*candidate_);
  return error;
}

bool PulseClock::belongs_to_pulse(MonotonicTime received) const {
  const nanoseconds after_pulse = received - measured_;
  return have_phase_ && !doubtful_ && after_pulse >= earliest_message && after_pulse <= latest_message;
}

TimeOfDayVerdict PulseClock::on_time_of_day(UtcTime named, MonotonicTime received) {
  if (!belongs_to_pulse(received)) {
    ++counters_.times_without_pulse;
    return TimeOfDayVerdict::no_pulse;
  }
  const auto second = wire::in_era_of(named, settings_.not_before);
  if (!second) {
    ++counters_.implausible_times;
    return TimeOfDayVerdict::implausible;
  }
  if (*second != named) ++counters_.week_rollovers;
  const nanoseconds change = *second - utc_at_edge_;
  if (time_valid_ && change == nanoseconds(0)) {
    candidate_.reset();
    label_error_ = nanoseconds(0);
    return TimeOfDayVerdict::agrees;
  }
  if (time_valid_ && absolute(change) > settings_.jump_limit) {
    ++counters_.jumps_refused;
    refused_jump_ = change;
    candidate_.reset();
    return TimeOfDayVerdict::jump_refused;
  }
  if (candidate_ != change) {
    candidate_times_ = 1;
  } else if (candidate_pulse_ != measured_) {  // a second in two messages is confirmed once
    ++candidate_times_;
  }
  candidate_ = change;
  candidate_pulse_ = measured_;
  if (candidate_times_ < (time_valid_ ? settings_.times_to_change : settings_.times_to_set))
    return TimeOfDayVerdict::waiting;
  const bool was_valid = time_valid_;
  utc_at_edge_ = *second;
  candidate_.reset();
  label_error_ = nanoseconds(0);
  time_valid_ = true;
  ++counters_.times_set;
  return was_valid ? TimeOfDayVerdict::corrected : TimeOfDayVerdict::set;
}

void PulseClock::set_time(UtcTime utc, MonotonicTime at, nanoseconds accuracy) {
  // The phase stays the pulse's, so that it is found again where it is expected.
  const UtcTime at_edge = utc - (utc_at(at) - utc_at_edge_);
  const bool to_pulse = pulse_rules();
  utc_at_edge_ = to_pulse ? rounded_to_second(at_edge) : at_edge;
  label_error_ = to_pulse && accuracy < surely_nearest ? nanoseconds(0) : accuracy;
  label_since_ = at;
  candidate_.reset();
  time_valid_ = true;
  ++counters_.times_set;
}

}  // namespace srfs
