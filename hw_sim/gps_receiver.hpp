#pragma once

#include <cstdint>
#include <optional>
#include <random>
#include <string>

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

struct GpsSettings {
  milliseconds pulse_period{1000};  ///< 100 for tests; divides the second
  milliseconds sentence_delay{40};  ///< pulse -> first octet of the sentences
  std::optional<UtcTime> start;     ///< true time at the start; nullopt: the host's clock, also while running
  double drift_ppm = 0;             ///< true time against CLOCK_MONOTONIC; only with `start`
  double jitter_us = 0;             ///< standard deviation of the pulse edge
  std::uint64_t seed = 1;
};

/// True UTC on the simulated satellite as a straight line over CLOCK_MONOTONIC.
class TrueTime {
 public:
  TrueTime(MonotonicTime at, UtcTime utc, double drift_ppm) : at_(at), utc_(utc), drift_ppm_(drift_ppm) {}
  [[nodiscard]] UtcTime utc(MonotonicTime t) const;
  [[nodiscard]] MonotonicTime monotonic(UtcTime t) const;

 private:
  MonotonicTime at_;
  UtcTime utc_;
  double drift_ppm_;
};

struct GpsPulse {
  MonotonicTime edge;
  UtcTime utc;                ///< what the edge marks: a multiple of the pulse period
  std::uint64_t counter = 0;  ///< counts suppressed pulses too
  bool emitted = true;        ///< false under a fault
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
  /// RMC and ZDA for the second that @p utc begins; empty when there is nothing to say. Only whole seconds
  /// have sentences.
  [[nodiscard]] std::string sentences(UtcTime utc, const GpsPosition& position) const;

  void set_fault(GpsFault fault) { fault_ = fault; }
  [[nodiscard]] GpsFault fault() const { return fault_; }
  [[nodiscard]] const GpsSettings& settings() const { return settings_; }

 private:
  GpsSettings settings_;
  GpsFault fault_ = GpsFault::none;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  std::optional<UtcTime> last_;
  std::uint64_t counter_ = 0;
};

/// "$GPRMC,...*hh\r\n". @param fix  false: status V, no position and no time
[[nodiscard]] std::string nmea_rmc(UtcTime utc, const GpsPosition& position, bool fix);
/// "$GPZDA,...*hh\r\n". @param fix  false: no time
[[nodiscard]] std::string nmea_zda(UtcTime utc, bool fix);

}  // namespace srfs::sim
