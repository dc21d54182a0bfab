// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/octets.hpp"
#include "base/time.hpp"

namespace srfs::wire {

/// APID of spacecraft time packets (ECSS-E-ST-70-41C 6.9.4, 7.4.1).
inline constexpr std::uint16_t time_apid = 0;

/// The report of service 9,2: a packet without secondary header (8.9.3.2), with error control as all packets
/// here.
struct TimePacket {
  std::uint16_t sequence_count = 0;  ///< 0 to 0x3FFF
  std::uint8_t rate = 0;             ///< a report every 2^rate frames of virtual channel 0
  TaiTime time;                      ///< when such a frame was made
  friend bool operator==(const TimePacket&, const TimePacket&) = default;
};
[[nodiscard]] Octets make_time_packet(const TimePacket& packet);
/// nullopt: another packet, or a damaged one.
[[nodiscard]] std::optional<TimePacket> parse_time_packet(OctetView octets);

}  // namespace srfs::wire
