// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/gnss_time.hpp"

#include <algorithm>
#include <chrono>
#include <ratio>

#include "base/text.hpp"
#include "wire/nmea.hpp"
#include "wire/ubx.hpp"

namespace srfs::wire {
namespace {

using Weeks = std::chrono::duration<std::int64_t, std::ratio<7 * 86'400>>;

constexpr UtcTime gps_epoch{seconds(315'964'800)};  // 1980-01-06
constexpr Weeks era{1024};
// NAV-TIMEUTC names the instant of the solution, which is off the second by the receiver's clock error.
constexpr nanoseconds solution_off_second_max = milliseconds(5);

constexpr bool is_printable(std::uint8_t octet) {
  return octet >= ' ' && octet <= '~';
}

UtcTime on_second(UtcTime t) {
  const auto nearest = std::chrono::round<seconds>(t.since_epoch());
  const nanoseconds off = t.since_epoch() - nearest;
  return off <= solution_off_second_max && off >= -solution_off_second_max ? UtcTime(nearest) : t;
}

}  // namespace

std::optional<UtcTime> in_era_of(UtcTime named, UtcTime not_before) {
  if (named < gps_epoch + Weeks(1)) return std::nullopt;
  const nanoseconds ahead = named - not_before;
  std::int64_t eras = ahead / era;
  if (ahead < eras * era) --eras;  // towards the past
  return named + -(eras * era);
}

GnssTimeStream::GnssTimeStream() {
  held_.reserve(ubx_payload_octets_max + ubx_overhead_octets);
}

std::vector<GnssTime> GnssTimeStream::push(OctetView octets) {
  std::vector<GnssTime> times;
  for (const std::uint8_t octet : octets) {
    held_.push_back(octet);
    while (!held_.empty()) {
      const std::size_t done = examine(times);
      if (done == 0) break;
      held_.erase(held_.begin(), held_.begin() + static_cast<std::ptrdiff_t>(done));
    }
  }
  return times;
}

void GnssTimeStream::discard_partial() {
  if (!held_.empty()) ++counters_.cut_short;
  held_.clear();
}

/// @return octets at the front that are done with; 0: more are needed
std::size_t GnssTimeStream::examine(std::vector<GnssTime>& times) {
  const std::uint8_t first = held_.front();
  if (first == '$') return examine_nmea(times);
  if (first == ubx_sync_1) return examine_ubx(times);
  if (first != '\r' && first != '\n') ++counters_.noise_octets;
  return 1;
}

std::size_t GnssTimeStream::examine_nmea(std::vector<GnssTime>& times) {
  const auto end = std::find_if(held_.begin() + 1, held_.end(),
                                [](std::uint8_t octet) { return octet == '$' || !is_printable(octet); });
  const auto length = static_cast<std::size_t>(end - held_.begin());
  if (length > nmea_sentence_characters_max) {
    ++counters_.too_long;
    return length;
  }
  if (end == held_.end()) return 0;
  if (*end != '\r' && *end != '\n') {
    ++counters_.cut_short;
    return length;
  }
  take_sentence(as_text(held_).substr(0, length), times);
  return length;
}

void GnssTimeStream::take_sentence(std::string_view sentence, std::vector<GnssTime>& times) {
  const auto time = parse_nmea(sentence);
  if (time) {
    ++counters_.times;
    times.push_back({.fix_valid = time->fix_valid, .utc = time->utc});
    return;
  }
  switch (time.error()) {
    case NmeaError::other_sentence:
      ++counters_.others;
      break;
    case NmeaError::bad_checksum:
      ++counters_.bad_checksum;
      break;
    case NmeaError::leap_second:
      ++counters_.leap_seconds;
      break;
    default:
      ++counters_.malformed;
      break;
  }
}

std::size_t GnssTimeStream::examine_ubx(std::vector<GnssTime>& times) {
  if (held_.size() < 2) return 0;
  if (held_[1] != ubx_sync_2) {
    ++counters_.noise_octets;
    return 1;
  }
  if (held_.size() < 6) return 0;
  const std::size_t payload = held_[4] | std::size_t{held_[5]} << 8U;
  if (payload > ubx_payload_octets_max) {
    ++counters_.too_long;
    return 2;
  }
  if (held_.size() < payload + ubx_overhead_octets) return 0;
  const std::uint16_t sum = ubx_checksum(OctetView(held_).subspan(2, payload + 4));
  if ((held_[payload + 6] | held_[payload + 7] << 8) != sum) {
    ++counters_.bad_checksum;
    return 2;  // a message may have begun inside
  }
  take_frame(held_[2], held_[3], OctetView(held_).subspan(6, payload), times);
  return payload + ubx_overhead_octets;
}

void GnssTimeStream::take_frame(std::uint8_t message_class, std::uint8_t id, OctetView payload,
                                std::vector<GnssTime>& times) {
  if (message_class != ubx_class_nav || id != ubx_nav_timeutc) {
    ++counters_.others;
    return;
  }
  const auto time = parse_nav_timeutc(payload);
  if (!time) {
    ++(time.error() == UbxError::leap_second ? counters_.leap_seconds : counters_.malformed);
    return;
  }
  ++counters_.times;
  times.push_back({.fix_valid = time->valid, .utc = on_second(time->utc)});
}

}  // namespace srfs::wire
