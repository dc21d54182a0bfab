// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "base/config.hpp"
#include "base/octets.hpp"
#include "base/time.hpp"

namespace srfs::sim {

enum class GpsFault : std::uint8_t {
  none,
  no_pulse,  ///< sentences go on
  no_fix,    ///< no pulse; sentences say "void"
  off,       ///< neither
};
[[nodiscard]] std::optional<GpsFault> gps_fault(const std::string& name);
[[nodiscard]] const char* to_string(GpsFault fault);

enum class GpsProtocol : std::uint8_t { nmea, ubx, both };

/// What is wrong with the receiver, or with what it receives.
struct GpsDisturbance {
  GpsFault fault = GpsFault::none;
  double lost_pulses = 0;                        ///< probability of each
  double false_pulses = 0;                       ///< probability of one more in a second, anywhere in it
  nanoseconds pulse_step{0};                     ///< every pulse comes so much later: spoofed
  std::optional<nanoseconds> second_receiver{};  ///< pulses of another one, so long after ours
  seconds time_step{0};                          ///< the messages name a time so far off
  int week_eras = 0;                             ///< and a date so many times 1024 weeks off
  double bad_checksum = 0;                       ///< probability of each message
  double cut_short = 0;                          ///< likewise
  bool unplugged = false;                        ///< the serial line is gone
  bool leap_second = false;  ///< the present minute, as the messages count, has a second 60
};
/// Keys: fault, lost_pulses, false_pulses, pulse_step_us, second_receiver_ms, time_step_s, week_eras,
/// bad_checksum, cut_short, unplugged, leap_second. Not named: nothing wrong. Throws ConfigError.
[[nodiscard]] GpsDisturbance read_disturbance(const ConfigSection& section);

/// A disturbance that comes by itself.
struct ScriptedDisturbance {
  nanoseconds at{0};  ///< since the start
  GpsDisturbance disturbance;
};

struct GpsSettings {
  milliseconds pulse_period{1000};  ///< 100 for tests; divides the second
  milliseconds sentence_delay{40};  ///< pulse -> first octet of the sentences
  std::optional<UtcTime> start;     ///< true time at the start; nullopt: the host's clock, also while running
  double drift_ppm = 0;             ///< true time against CLOCK_MONOTONIC; only with `start`
  double wander_ppm = 0;            ///< amplitude of the drift's swing with temperature; only with `start`
  seconds wander_period{5700};      ///< an orbit
  double jitter_us = 0;             ///< standard deviation of the pulse edge
  GpsProtocol protocol = GpsProtocol::nmea;
  std::vector<ScriptedDisturbance> script;  ///< in order of time
  std::uint64_t seed = 1;
};

/// True UTC on the simulated satellite over CLOCK_MONOTONIC: a straight line and, by the oscillator's
/// temperature, a sine.
class TrueTime {
 public:
  TrueTime(MonotonicTime at, UtcTime utc, double drift_ppm, double wander_ppm = 0,
           seconds wander_period = seconds(5700))
      : at_(at), utc_(utc), drift_ppm_(drift_ppm), wander_ppm_(wander_ppm), wander_period_(wander_period) {}
  [[nodiscard]] UtcTime utc(MonotonicTime t) const;
  [[nodiscard]] MonotonicTime monotonic(UtcTime t) const;

 private:
  MonotonicTime at_;
  UtcTime utc_;
  double drift_ppm_;
  double wander_ppm_;
  seconds wander_period_;
};

struct GpsPulse {
  MonotonicTime edge;
  UtcTime utc;                ///< what the edge marks: a multiple of the pulse period
  std::uint64_t counter = 0;  ///< counts suppressed pulses too
  bool emitted = true;        ///< false under a fault
  std::array<std::optional<MonotonicTime>, 2> strays;  ///< pulses that no second of ours begins with
};

/// Where the receiver is, for its sentences.
struct GpsPosition {
  double latitude_deg = 0;
  double longitude_deg = 0;
  double speed_m_s = 0;
  double course_deg = 0;
};

/// A GPS receiver with a pulse output and NMEA 0183 sentences. Pure: time is an argument.
class GpsReceiver {
 public:
  explicit GpsReceiver(const GpsSettings& settings) : settings_(settings), random_(settings.seed) {}

  /// The pulse after the last one given, the first after @p now if there was none or it has been missed by
  /// far.
  [[nodiscard]] GpsPulse next_pulse(const TrueTime& time, MonotonicTime now);
  /// RMC and ZDA, NAV-TIMEUTC or all three for the second that @p utc begins; empty when there is nothing to
  /// send. Only whole seconds have sentences.
  [[nodiscard]] Octets messages(UtcTime utc, const GpsPosition& position);

  void disturb(const GpsDisturbance& disturbance);
  [[nodiscard]] const GpsDisturbance& disturbance() const { return disturbance_; }
  [[nodiscard]] GpsFault fault() const { return disturbance_.fault; }
  [[nodiscard]] const GpsSettings& settings() const { return settings_; }

 private:
  [[nodiscard]] bool happens(double probability);
  void spoil(Octets& message);

  GpsSettings settings_;
  GpsDisturbance disturbance_;
  bool leap_pending_ = false;
  std::int64_t leaps_ = 0;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  std::optional<UtcTime> last_;
  std::uint64_t counter_ = 0;
};

/// "$GPRMC,...*hh\r\n". @param fix  false: status V, no position and no time
/// @param leap  the second 60 that follows @p utc is meant
[[nodiscard]] std::string nmea_rmc(UtcTime utc, const GpsPosition& position, bool fix, bool leap = false);
/// "$GPZDA,...*hh\r\n". @param fix  false: no time
[[nodiscard]] std::string nmea_zda(UtcTime utc, bool fix, bool leap = false);
/// @param fix  false: no validity bit
[[nodiscard]] Octets ubx_timeutc(UtcTime utc, bool fix, bool leap = false);

}  // namespace srfs::sim
