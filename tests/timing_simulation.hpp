// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <optional>
#include <vector>

#include "hw_sim/gps_receiver.hpp"
#include "nodes/timing/mission_clock.hpp"
#include "nodes/timing/tick_generator.hpp"
#include "nodes/timing/time_discipline.hpp"
#include "wire/gnss_time.hpp"

namespace srfs::testing_support {

/// The timing node's logic with the simulated receiver, in simulated time. Compares mission time with true
/// time and measures the regularity of the ticks.
class TimingSimulation {
 public:
  struct Sample {
    std::int64_t second = 0;  ///< since the start
    nanoseconds error{0};     ///< mission time minus true time, at a true second
    std::optional<nanoseconds> estimated;
    mission::SyncState state = mission::SyncState::unlocked;
    bool time_valid = false;
  };

  explicit TimingSimulation(const sim::GpsSettings& settings, const PulseClockSettings& clock = {},
                            nanoseconds tick_period = milliseconds(100))
      : receiver_(settings),
        truth_(start_, settings.start.value_or(default_start()), settings.drift_ppm, settings.wander_ppm,
               settings.wander_period),
        clock_(stored(), start_),
        time_(clock, ClockStart{.utc = stored(), .valid = false, .error = nanoseconds(0), .drift_ppm = {}},
              start_, clock_),
        ticks_(tick_period, 0, start_ + milliseconds(1)) {}

  static UtcTime default_start() { return UtcTime(seconds(1'795'247'990) + milliseconds(400)); }
  /// The mission time stored long ago.
  static UtcTime stored() { return UtcTime(seconds(1'780'000'000)); }

  sim::GpsReceiver& receiver() { return receiver_; }
  [[nodiscard]] const TimeDiscipline& time() const { return time_; }
  [[nodiscard]] const wire::GnssTimeStream& stream() const { return stream_; }
  [[nodiscard]] const std::vector<Sample>& samples() const { return samples_; }
  [[nodiscard]] const Sample& last() const { return samples_.back(); }
  /// Largest deviation of a tick interval from the period, as a fraction of the period.
  [[nodiscard]] double worst_interval() const { return worst_interval_; }
  /// Largest deviation of the mission time's rate from one, from tick to tick, while the time was valid.
  [[nodiscard]] double worst_rate() const { return worst_rate_; }

  void run(std::int64_t for_seconds) {
    for (std::int64_t i = 0; i < for_seconds; ++i) second();
  }

  [[nodiscard]] double rms_error_ns(std::int64_t from, std::int64_t to) const {
    double squares = 0;
    std::int64_t count = 0;
    for (const Sample& sample : samples_) {
      if (sample.second < from || sample.second >= to) continue;
      squares += static_cast<double>(sample.error.count()) * static_cast<double>(sample.error.count());
      ++count;
    }
    return std::sqrt(squares / static_cast<double>(std::max<std::int64_t>(1, count)));
  }

 private:
  struct Happening {
    MonotonicTime at;
    std::function<void()> what;
  };

  void second() {
    const sim::GpsPulse pulse = receiver_.next_pulse(truth_, now_);
    const MonotonicTime true_edge = truth_.monotonic(pulse.utc);
    std::vector<Happening> happenings;
    const auto edge_at = [&](MonotonicTime edge) {
      const MonotonicTime handled = edge + microseconds(30);
      happenings.push_back({handled, [this, edge, handled] { time_.on_pulse(edge, handled); }});
    };
    if (pulse.emitted) edge_at(pulse.edge);
    for (const auto& stray : pulse.strays) {
      if (stray) edge_at(*stray);
    }
    happenings.push_back(
        {pulse.edge + milliseconds(120), [this, utc = pulse.utc, at = pulse.edge + milliseconds(120)] {
           for (const wire::GnssTime& named : stream_.push(receiver_.messages(utc, {})))
             time_.on_time_of_day(named, at);
         }});
    happenings.push_back({true_edge + milliseconds(350),
                          [this, at = true_edge + milliseconds(350)] { time_.on_time_passing(at); }});
    happenings.push_back(
        {true_edge + milliseconds(2), [this, true_edge, utc = pulse.utc] { sample(true_edge, utc); }});
    std::stable_sort(happenings.begin(), happenings.end(),
                     [](const Happening& a, const Happening& b) { return a.at < b.at; });
    for (const Happening& happening : happenings) {
      run_ticks(happening.at);
      happening.what();
    }
    now_ = true_edge + milliseconds(1);
    ++second_;
  }

  void sample(MonotonicTime at, UtcTime truth) {
    samples_.push_back({.second = second_,
                        .error = time_.utc_at(at) - truth,
                        .estimated = time_.error_at(at),
                        .state = time_.pulse_clock().state(),
                        .time_valid = time_.pulse_clock().time_valid()});
  }

  void run_ticks(MonotonicTime until) {
    while (ticks_.next_due() <= until) {
      if (const auto grid = time_.pulse_clock().grid()) ticks_.follow(*grid);
      const auto tick = ticks_.on_wakeup(ticks_.next_due());
      const UtcTime shown = time_.utc_at(tick->due);
      const bool valid = time_.pulse_clock().time_valid();
      if (previous_due_) {
        const auto interval = static_cast<double>((tick->due - *previous_due_).count());
        const auto period = static_cast<double>(ticks_.period().count());
        worst_interval_ = std::max(worst_interval_, std::abs(interval / period - 1));
        if (valid && was_valid_) {
          worst_rate_ = std::max(
              worst_rate_, std::abs(static_cast<double>((shown - previous_shown_).count()) / interval - 1));
        }
      }
      previous_due_ = tick->due;
      previous_shown_ = shown;
      was_valid_ = valid;
    }
  }

  static constexpr MonotonicTime start_{seconds(1000)};
  sim::GpsReceiver receiver_;
  sim::TrueTime truth_;
  MissionClock clock_;
  TimeDiscipline time_;
  TickGenerator ticks_;
  wire::GnssTimeStream stream_;
  std::vector<Sample> samples_;
  MonotonicTime now_ = start_;
  std::int64_t second_ = 0;
  std::optional<MonotonicTime> previous_due_;
  UtcTime previous_shown_;
  bool was_valid_ = false;
  double worst_interval_ = 0;
  double worst_rate_ = 0;
};

}  // namespace srfs::testing_support
