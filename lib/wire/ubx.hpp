// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::wire {

// u-blox' binary protocol: B5 62, class, id, length (16 bit, little-endian), payload, two checksum octets.
inline constexpr std::uint8_t ubx_sync_1 = 0xB5;
inline constexpr std::uint8_t ubx_sync_2 = 0x62;
inline constexpr std::size_t ubx_overhead_octets = 8;
/// Longest payload a stream waits for; a header that announces more is taken for noise.
inline constexpr std::size_t ubx_payload_octets_max = 1024;
inline constexpr std::uint8_t ubx_class_nav = 0x01;
inline constexpr std::uint8_t ubx_nav_timeutc = 0x21;
inline constexpr std::size_t ubx_nav_timeutc_octets = 20;

/// What NAV-TIMEUTC says of the epoch that the pulse before it marked.
struct UbxTimeUtc {
  UtcTime utc;           ///< with its fraction: up to half a second before or after the second it names
  nanoseconds accuracy;  ///< the receiver's estimate
  bool valid = false;    ///< time of week, week number and UTC (leap seconds) are all known to the receiver
  friend bool operator==(const UbxTimeUtc&, const UbxTimeUtc&) = default;
};

enum class UbxError : std::uint8_t {
  bad_length,   ///< NAV-TIMEUTC has 20 octets
  bad_time,     ///< not a time of the day, or a fraction beyond one second
  bad_date,     ///< not a date of the calendar between 1980 and 2199
  leap_second,  ///< second 60: POSIX time cannot name it, the next message can
};
[[nodiscard]] std::string_view to_string(UbxError error);

[[nodiscard]] Result<UbxTimeUtc, UbxError> parse_nav_timeutc(OctetView payload);

/// The two checksum octets (Fletcher-8) over class, id, length and payload; the first in the low octet.
[[nodiscard]] std::uint16_t ubx_checksum(OctetView from_class_to_payload);
/// A whole frame. @param payload  at most 65535 octets
[[nodiscard]] Octets ubx_frame(std::uint8_t message_class, std::uint8_t id, OctetView payload);

}  // namespace srfs::wire
