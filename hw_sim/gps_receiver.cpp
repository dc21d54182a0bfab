// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/gps_receiver.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <numbers>
#include <utility>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include "wire/ubx.hpp"

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

GpsDisturbance read_disturbance(const ConfigSection& section) {
  GpsDisturbance d;
  const std::string name = section.has("fault") ? section.text("fault") : "none";
  const auto fault = gps_fault(name);
  if (!fault) throw section.bad("fault", "none, no_pulse, no_fix or off");
  d.fault = *fault;
  d.lost_pulses = section.number("lost_pulses", 0, 1, 0);
  d.false_pulses = section.number("false_pulses", 0, 1, 0);
  d.pulse_step = microseconds(section.integer("pulse_step_us", -400'000, 400'000, 0));
  if (section.has("second_receiver_ms"))
    d.second_receiver = milliseconds(section.integer("second_receiver_ms", 1, 999, 1));
  d.time_step = seconds(section.integer("time_step_s", -1'000'000'000, 1'000'000'000, 0));
  d.week_eras = static_cast<int>(section.integer("week_eras", -2, 2, 0));
  d.bad_checksum = section.number("bad_checksum", 0, 1, 0);
  d.cut_short = section.number("cut_short", 0, 1, 0);
  d.unplugged = section.boolean("unplugged", false);
  d.leap_second = section.boolean("leap_second", false);
  return d;
}

UtcTime TrueTime::utc(MonotonicTime t) const {
  const nanoseconds elapsed = t - at_;
  const auto elapsed_ns = static_cast<double>(elapsed.count());
  // The drift swings as a sine, so the time as its integral.
  const double turn = 2 * std::numbers::pi / (static_cast<double>(wander_period_.count()) * 1e9);
  const double swing_ns = wander_ppm_ * 1e-6 * (1 - std::cos(elapsed_ns * turn)) / turn;
  return utc_ + elapsed + nanoseconds(std::llround(elapsed_ns * drift_ppm_ * 1e-6 + swing_ns));
}

MonotonicTime TrueTime::monotonic(UtcTime t) const {
  // Rates differ by less than 0.2 %: each round gains almost three digits.
  MonotonicTime guess = at_ + (t - utc_);
  for (int round = 0; round < 8; ++round) {
    const nanoseconds off = t - utc(guess);
    if (off == nanoseconds(0)) break;
    guess += off;
  }
  return guess;
}

void GpsReceiver::disturb(const GpsDisturbance& disturbance) {
  disturbance_ = disturbance;
  leap_pending_ = disturbance.leap_second;
}

bool GpsReceiver::happens(double probability) {
  return probability > 0 && std::uniform_real_distribution<double>()(random_) < probability;
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
  const double jitter_ns = settings_.jitter_us * 1000 * normal_(random_);
  const MonotonicTime edge = time.monotonic(utc) + nanoseconds(std::llround(jitter_ns));
  GpsPulse pulse{.edge = edge + disturbance_.pulse_step,
                 .utc = utc,
                 .counter = counter_,
                 .emitted = disturbance_.fault == GpsFault::none && !happens(disturbance_.lost_pulses),
                 .strays = {}};
  if (disturbance_.second_receiver) pulse.strays[0] = edge + *disturbance_.second_receiver;
  if (happens(disturbance_.false_pulses))
    pulse.strays[1] = edge + nanoseconds(static_cast<std::int64_t>(random_() % 1'000'000'000));
  return pulse;
}

Octets GpsReceiver::messages(UtcTime utc, const GpsPosition& position) {
  if (disturbance_.fault == GpsFault::off || utc.ns() % 1'000'000'000 != 0) return {};
  constexpr std::int64_t era_s = 1024 * 7 * 86'400;
  UtcTime named = utc - seconds(leaps_) + disturbance_.time_step + seconds(disturbance_.week_eras * era_s);
  const bool leap = leap_pending_ && named.since_epoch() % std::chrono::minutes(1) == nanoseconds(0);
  if (leap) {
    leap_pending_ = false;
    ++leaps_;
    named = named - seconds(1);
  }
  const bool fix = disturbance_.fault != GpsFault::no_fix;
  const auto octets = [](const std::string& text) { return Octets(text.begin(), text.end()); };
  std::vector<Octets> each;
  if (settings_.protocol != GpsProtocol::ubx) {
    each.push_back(octets(nmea_rmc(named, position, fix, leap)));
    each.push_back(octets(nmea_zda(named, fix, leap)));
  }
  if (settings_.protocol != GpsProtocol::nmea) each.push_back(ubx_timeutc(named, fix, leap));
  Octets all;
  for (Octets& message : each) {
    spoil(message);
    all.insert(all.end(), message.begin(), message.end());
  }
  return all;
}

void GpsReceiver::spoil(Octets& message) {
  const std::size_t middle = message.size() / 2;
  if (happens(disturbance_.bad_checksum)) message[middle] ^= 0x01U;
  if (happens(disturbance_.cut_short)) message.resize(middle);
}

std::string nmea_rmc(UtcTime utc, const GpsPosition& position, bool fix, bool leap) {
  if (!fix) return with_checksum("GPRMC,,V,,,,,,,,,,N");
  constexpr double knots_per_m_s = 1.9438444924406;
  std::tm t = calendar(utc);
  if (leap) t.tm_sec = 60;
  const double course = std::fmod(position.course_deg + 360, 360);
  return with_checksum(fmt::format(
      "GPRMC,{:%H%M%S}.00,A,{},{},{:.1f},{:.1f},{:%d%m%y},,,A", t, angle(position.latitude_deg, 2, 'N', 'S'),
      angle(position.longitude_deg, 3, 'E', 'W'), position.speed_m_s * knots_per_m_s, course, t));
}

std::string nmea_zda(UtcTime utc, bool fix, bool leap) {
  if (!fix) return with_checksum("GPZDA,,,,,,");
  std::tm t = calendar(utc);
  if (leap) t.tm_sec = 60;
  return with_checksum(fmt::format("GPZDA,{:%H%M%S}.00,{:%d,%m,%Y},00,00", t, t));
}

Octets ubx_timeutc(UtcTime utc, bool fix, bool leap) {
  constexpr std::uint8_t accuracy_ns = 25;
  const std::tm t = calendar(utc);
  const auto octet = [](int value) { return static_cast<std::uint8_t>(value); };
  Octets payload(wire::ubx_nav_timeutc_octets);
  payload[4] = accuracy_ns;
  const int year = t.tm_year + 1900;
  payload[12] = octet(year % 256);
  payload[13] = octet(year / 256);
  payload[14] = octet(t.tm_mon + 1);
  payload[15] = octet(t.tm_mday);
  payload[16] = octet(t.tm_hour);
  payload[17] = octet(t.tm_min);
  payload[18] = octet(leap ? 60 : t.tm_sec);
  payload[19] = fix ? 0x37 : 0x00;  // all valid, UTC by USNO
  return wire::ubx_frame(wire::ubx_class_nav, wire::ubx_nav_timeutc, payload);
}

}  // namespace srfs::sim
