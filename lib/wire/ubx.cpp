// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/ubx.hpp"

#include <cassert>
#include <chrono>

namespace srfs::wire {
namespace {

std::uint32_t u32_at(OctetView octets, std::size_t at) {
  return std::uint32_t{octets[at]} | std::uint32_t{octets[at + 1]} << 8U |
         std::uint32_t{octets[at + 2]} << 16U | std::uint32_t{octets[at + 3]} << 24U;
}

constexpr std::uint8_t time_of_week_valid = 0x01;
constexpr std::uint8_t week_number_valid = 0x02;
constexpr std::uint8_t utc_valid = 0x04;
constexpr std::uint8_t all_valid = time_of_week_valid | week_number_valid | utc_valid;

}  // namespace

std::string_view to_string(UbxError error) {
  switch (error) {
    case UbxError::bad_length:
      return "not 20 octets";
    case UbxError::bad_time:
      return "not a time";
    case UbxError::bad_date:
      return "not a date";
    case UbxError::leap_second:
      return "leap second";
  }
  return "?";
}

Result<UbxTimeUtc, UbxError> parse_nav_timeutc(OctetView payload) {
  if (payload.size() != ubx_nav_timeutc_octets) return Err(UbxError::bad_length);
  const nanoseconds accuracy(u32_at(payload, 4));
  const nanoseconds fraction(static_cast<std::int32_t>(u32_at(payload, 8)));
  const int year = payload[12] | payload[13] << 8;
  const unsigned hour = payload[16];
  const unsigned minute = payload[17];
  const unsigned second = payload[18];
  const bool valid = (payload[19] & all_valid) == all_valid;
  if (hour > 23 || minute > 59 || second > 60 || fraction > seconds(1) || fraction < -seconds(1))
    return Err(UbxError::bad_time);
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(payload[14]),
                                         std::chrono::day(payload[15])};
  if (!date.ok() || year < 1980 || year > 2199) return Err(UbxError::bad_date);
  if (second == 60) return Err(UbxError::leap_second);
  const UtcTime utc(std::chrono::sys_days(date).time_since_epoch() + std::chrono::hours(hour) +
                    std::chrono::minutes(minute) + seconds(second) + fraction);
  return UbxTimeUtc{.utc = utc, .accuracy = accuracy, .valid = valid};
}

std::uint16_t ubx_checksum(OctetView from_class_to_payload) {
  std::uint8_t a = 0;
  std::uint8_t b = 0;
  for (const std::uint8_t octet : from_class_to_payload) {
    a = static_cast<std::uint8_t>(a + octet);
    b = static_cast<std::uint8_t>(b + a);
  }
  return static_cast<std::uint16_t>(a | b << 8);
}

Octets ubx_frame(std::uint8_t message_class, std::uint8_t id, OctetView payload) {
  assert(payload.size() <= 0xFFFF);
  Octets frame{ubx_sync_1,
               ubx_sync_2,
               message_class,
               id,
               static_cast<std::uint8_t>(payload.size() & 0xFFU),
               static_cast<std::uint8_t>(payload.size() >> 8U)};
  frame.insert(frame.end(), payload.begin(), payload.end());
  const std::uint16_t sum = ubx_checksum(OctetView(frame).subspan(2));
  frame.push_back(static_cast<std::uint8_t>(sum & 0xFFU));
  frame.push_back(static_cast<std::uint8_t>(sum >> 8U));
  return frame;
}

}  // namespace srfs::wire
