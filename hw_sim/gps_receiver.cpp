#include "hw_sim/gps_receiver.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <utility>

#include <fmt/chrono.h>
#include <fmt/format.h>

namespace srfs::sim {
namespace {

constexpr std::array<std::pair<GpsFault, const char*>, 4> fault_names{{{GpsFault::none, "none"},
                                                                       {GpsFault::no_pulse, "no_pulse"},
                                                                       {GpsFault::no_fix, "no_fix"},
                                                                       {GpsFault::off, "off"}}};

std::string with_checksum(const std::string& body) {
  unsigned sum = 0;
  for (const char c : body) sum ^= static_cast<unsigned char>(c);
  return fmt::format("${}*{:02X}\r\n", body, sum);
}

std::tm calendar(UtcTime utc) {
  const std::time_t t = utc.ns() / 1'000'000'000;
  std::tm out{};
  gmtime_r(&t, &out);
  return out;
}

/// Degrees and minutes, "ddmm.mmmm,N".
std::string angle(double degrees, int digits, char positive, char negative) {
  const double size = std::abs(degrees);
  auto whole = static_cast<int>(size);
  double minutes = (size - whole) * 60;
  if (minutes >= 59.99995) {  // would be printed as 60.0000
    ++whole;
    minutes = 0;
  }
  return fmt::format("{:0{}d}{:07.4f},{}", whole, digits, minutes, degrees < 0 ? negative : positive);
}

}  // namespace

std::optional<GpsFault> gps_fault(const std::string& name) {
  for (const auto& [fault, text] : fault_names) {
    if (name == text) return fault;
  }
  return std::nullopt;
}

const char* to_string(GpsFault fault) {
  for (const auto& [value, text] : fault_names) {
    if (value == fault) return text;
  }
  return "?";
}

UtcTime TrueTime::utc(MonotonicTime t) const {
  const nanoseconds elapsed = t - at_;
  return utc_ + elapsed + nanoseconds(std::llround(static_cast<double>(elapsed.count()) * drift_ppm_ * 1e-6));
}

MonotonicTime TrueTime::monotonic(UtcTime t) const {
  const nanoseconds elapsed = t - utc_;
  const double rate_error = drift_ppm_ * 1e-6;
  return at_ + elapsed -
         nanoseconds(std::llround(static_cast<double>(elapsed.count()) * rate_error / (1 + rate_error)));
}

GpsPulse GpsReceiver::next_pulse(const TrueTime& time, MonotonicTime now) {
  const nanoseconds period = settings_.pulse_period;
  const UtcTime present = time.utc(now);
  const UtcTime following((present.since_epoch() / period + 1) * period);
  // Early by jitter, the pulse just given would come out again; long ago, the clock was stepped or the
  // process stopped.
  const bool continues = last_ && following - *last_ < 2 * period && *last_ - following < period;
  const UtcTime utc = continues ? *last_ + period : following;
  if (last_)
    counter_ +=
        continues ? 1 : static_cast<std::uint64_t>(std::max<std::int64_t>(1, (utc - *last_) / period));
  last_ = utc;
  const bool silenced = fault_ != GpsFault::none;
  const double jitter_ns = settings_.jitter_us * 1000 * normal_(random_);
  return {time.monotonic(utc) + nanoseconds(std::llround(jitter_ns)), utc, counter_, !silenced};
}

std::string GpsReceiver::sentences(UtcTime utc, const GpsPosition& position) const {
  if (fault_ == GpsFault::off || utc.ns() % 1'000'000'000 != 0) return {};
  const bool fix = fault_ != GpsFault::no_fix;
  return nmea_rmc(utc, position, fix) + nmea_zda(utc, fix);
}

std::string nmea_rmc(UtcTime utc, const GpsPosition& position, bool fix) {
  if (!fix) return with_checksum("GPRMC,,V,,,,,,,,,,N");
  constexpr double knots_per_m_s = 1.9438444924406;
  const std::tm t = calendar(utc);
  const double course = std::fmod(position.course_deg + 360, 360);
  return with_checksum(fmt::format(
      "GPRMC,{:%H%M%S}.00,A,{},{},{:.1f},{:.1f},{:%d%m%y},,,A", t, angle(position.latitude_deg, 2, 'N', 'S'),
      angle(position.longitude_deg, 3, 'E', 'W'), position.speed_m_s * knots_per_m_s, course, t));
}

std::string nmea_zda(UtcTime utc, bool fix) {
  if (!fix) return with_checksum("GPZDA,,,,,,");
  const std::tm t = calendar(utc);
  return with_checksum(fmt::format("GPZDA,{:%H%M%S}.00,{:%d,%m,%Y},00,00", t, t));
}

}  // namespace srfs::sim
