#include "nodes/timing/pulse_clock.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace srfs {
namespace {

// Gains of the filter: two thirds of the error are gone after three pulses, noise of the pulse is damped by
// about three.
constexpr double phase_gain = 0.4;
constexpr double rate_gain = 0.08;
constexpr double second_nominal_ns = 1e9;

// The sentence that names a pulse's second comes after it; past this it may belong to the next one.
constexpr nanoseconds sentence_window = milliseconds(980);
// How much worse a prediction gets for each second without pulses.
constexpr nanoseconds holdover_growth_per_s = microseconds(20);

nanoseconds absolute(nanoseconds d) {
  return d < nanoseconds(0) ? -d : d;
}

nanoseconds times(std::int64_t n, double second_ns) {
  return seconds(n) + nanoseconds(std::llround(static_cast<double>(n) * (second_ns - second_nominal_ns)));
}

UtcTime rounded_to_second(UtcTime t) {
  const auto s = std::chrono::floor<seconds>(t.since_epoch() + milliseconds(500));
  return UtcTime(s);
}

}  // namespace

PulseClock::PulseClock(const PulseClockSettings& settings, UtcTime start, MonotonicTime now, bool valid)
    : settings_(settings), time_valid_(valid), edge_(now), measured_(now), utc_at_edge_(start) {}

UtcTime PulseClock::utc_at(MonotonicTime t) const {
  const double ratio = second_nominal_ns / second_ns_;
  return utc_at_edge_ + nanoseconds(std::llround(static_cast<double>((t - edge_).count()) * ratio));
}

std::optional<SecondGrid> PulseClock::grid() const {
  if (!have_phase_) return std::nullopt;
  return SecondGrid{edge_, std::chrono::floor<seconds>(utc_at_edge_.since_epoch()).count(), second_ns_};
}

nanoseconds PulseClock::outlier_window(MonotonicTime edge) const {
  const nanoseconds silent = edge - edge_;
  const nanoseconds grown =
      settings_.outlier_limit + holdover_growth_per_s * std::max<std::int64_t>(0, silent / seconds(1) - 1);
  // Before the rate is known, the crystal's tolerance is the measure.
  const nanoseconds crystal(
      std::llround(static_cast<double>(silent.count()) * settings_.drift_limit_ppm * 1e-6));
  const nanoseconds window = state_ == SyncState::locking && accepted_pulses_ < 3 ? grown + crystal : grown;
  return std::min<nanoseconds>(window, milliseconds(250));
}

void PulseClock::start_phase(MonotonicTime edge) {
  utc_at_edge_ = rounded_to_second(utc_at(edge));
  edge_ = edge;
  measured_ = edge;
  have_phase_ = true;
  accepted_pulses_ = 1;
  good_pulses_ = 0;
  offset_ = nanoseconds(0);
  last_outlier_.reset();
  agreeing_outliers_ = 0;
  state_ = SyncState::locking;
}

PulseVerdict PulseClock::on_pulse(MonotonicTime edge) {
  ++counters_.pulses;
  if (last_pulse_ && edge <= *last_pulse_) {
    ++counters_.repeated_pulses;
    return PulseVerdict::repeated;
  }
  last_pulse_ = edge;
  if (!have_phase_) {
    start_phase(edge);
    return PulseVerdict::accepted;
  }

  const double elapsed = static_cast<double>((edge - edge_).count()) / second_ns_;
  const std::int64_t elapsed_s = std::llround(elapsed);
  const nanoseconds error = (edge - edge_) - times(elapsed_s, second_ns_);
  if (elapsed_s < 1 || absolute(error) > outlier_window(edge)) return on_outlier(edge);

  measured_ = edge;
  last_outlier_.reset();
  agreeing_outliers_ = 0;
  steer(error, elapsed_s, edge);
  return PulseVerdict::accepted;
}

void PulseClock::steer(nanoseconds error, std::int64_t elapsed_s, MonotonicTime edge) {
  offset_ = error;
  ++accepted_pulses_;
  const double limit_ns = settings_.drift_limit_ppm * 1e-6 * second_nominal_ns;
  const auto error_ns = static_cast<double>(error.count());

  // The second pulse measures the rate at once; from then on the filter does.
  const bool first_interval = accepted_pulses_ == 2;
  const double rate_step = error_ns / static_cast<double>(elapsed_s) * (first_interval ? 1.0 : rate_gain);
  const MonotonicTime estimated =
      first_interval ? edge : edge - nanoseconds(std::llround(error_ns * (1.0 - phase_gain)));
  second_ns_ = std::clamp(second_ns_ + rate_step, second_nominal_ns - limit_ns, second_nominal_ns + limit_ns);
  move_to(estimated, elapsed_s);

  if (state_ == SyncState::holdover || state_ == SyncState::unlocked) {
    state_ = SyncState::locking;
    good_pulses_ = 0;
  }
  good_pulses_ = absolute(error) <= settings_.lock_limit ? good_pulses_ + 1 : 0;
  if (state_ == SyncState::locking && good_pulses_ >= settings_.pulses_to_lock) state_ = SyncState::locked;
}

void PulseClock::move_to(MonotonicTime estimated_edge, std::int64_t elapsed_s) {
  utc_at_edge_ += seconds(elapsed_s);
  edge_ = estimated_edge;
}

PulseVerdict PulseClock::on_outlier(MonotonicTime edge) {
  ++counters_.outliers;
  // Agreement is judged between neighbours: one second apart within what the worst crystal allows.
  const nanoseconds tolerance =
      settings_.lock_limit + nanoseconds(std::llround(settings_.drift_limit_ppm * 1e3));
  const bool agrees = last_outlier_ && absolute((edge - *last_outlier_) - seconds(1)) <= tolerance;
  agreeing_outliers_ = agrees ? agreeing_outliers_ + 1 : 1;
  last_outlier_ = edge;
  if (agreeing_outliers_ < settings_.outliers_to_adopt) return PulseVerdict::outlier;
  ++counters_.phase_adoptions;
  start_phase(edge);
  return PulseVerdict::adopted;
}

void PulseClock::on_time_passing(MonotonicTime now) {
  if (!have_phase_ || now - measured_ <= settings_.holdover_after) return;
  if (state_ == SyncState::locked) state_ = SyncState::holdover;
  if (state_ == SyncState::locking) {
    // Never locked, or lost again before it locked: the time it has is still the best known.
    state_ = time_valid_ ? SyncState::holdover : SyncState::unlocked;
    good_pulses_ = 0;
  }
}

TimeOfDayVerdict PulseClock::on_time_of_day(UtcTime second, MonotonicTime received) {
  const nanoseconds after_pulse = received - measured_;
  if (!have_phase_ || after_pulse < nanoseconds(0) || after_pulse > sentence_window) {
    ++counters_.sentences_without_pulse;
    return TimeOfDayVerdict::no_pulse;
  }
  if (second < settings_.earliest_plausible) {
    ++counters_.implausible_times;
    return TimeOfDayVerdict::implausible;
  }
  const nanoseconds change = second - utc_at_edge_;
  if (time_valid_ && change == nanoseconds(0)) {
    candidate_.reset();
    return TimeOfDayVerdict::agrees;
  }
  if (time_valid_ && absolute(change) > settings_.jump_limit) {
    ++counters_.jumps_refused;
    refused_jump_ = change;
    return TimeOfDayVerdict::jump_refused;
  }
  candidate_sentences_ = candidate_ == change ? candidate_sentences_ + 1 : 1;
  candidate_ = change;
  if (candidate_sentences_ < settings_.sentences_to_set) return TimeOfDayVerdict::waiting;
  utc_at_edge_ = second;
  candidate_.reset();
  time_valid_ = true;
  ++counters_.times_set;
  return TimeOfDayVerdict::set;
}

void PulseClock::set_time(UtcTime utc, MonotonicTime at) {
  const nanoseconds since_edge = utc_at(at) - utc_at_edge_;
  const UtcTime at_edge = utc - since_edge;
  const bool pulse_rules = state_ == SyncState::locked || state_ == SyncState::locking;
  utc_at_edge_ = pulse_rules ? rounded_to_second(at_edge) : at_edge;
  candidate_.reset();
  time_valid_ = true;
  ++counters_.times_set;
}

}  // namespace srfs
