// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs::wire {

/// Telemetry or telecommand (CCSDS 133.0-B-2, 4.1.3.3.2).
enum class PacketType : std::uint8_t { telemetry = 0, telecommand = 1 };

/// Place of the packet in a group (CCSDS 133.0-B-2, 4.1.3.4.2).
enum class PacketGrouping : std::uint8_t { continuation = 0, first = 1, last = 2, unsegmented = 3 };

/// Octets of the primary header.
inline constexpr std::size_t packet_header_octets = 6;
/// The packet data field holds 1 to 65536 octets (4.1.3.5), so the longest packet has this many.
inline constexpr std::size_t packet_octets_max = packet_header_octets + 65536;
/// APID of idle packets (4.1.3.3.4.4). Also the largest APID.
inline constexpr std::uint16_t idle_apid = 0x7FF;
/// The shortest idle packet: a header and one octet.
inline constexpr std::size_t idle_packet_octets_min = packet_header_octets + 1;

/// The primary header without its length field; the length follows from the data field.
struct PacketHeader {
  PacketType type = PacketType::telemetry;
  bool has_secondary_header = false;
  std::uint16_t apid = 0;  ///< 0 to 0x7FF
  PacketGrouping grouping = PacketGrouping::unsegmented;
  std::uint16_t sequence_count = 0;  ///< 0 to 0x3FFF
  friend bool operator==(const PacketHeader&, const PacketHeader&) = default;
};

/// A packet seen through octets that are owned elsewhere.
struct SpacePacketView {
  PacketHeader header;
  OctetView data;  ///< packet data field, 1 to 65536 octets
};

enum class SpacePacketError : std::uint8_t {
  too_short,      ///< fewer than the 7 octets of the shortest packet
  bad_version,    ///< packet version number is not 0
  length_differs  ///< the octets are not exactly as many as the header says
};
[[nodiscard]] std::string_view to_string(SpacePacketError error);

/// Packs one Space Packet (CCSDS 133.0-B-2, 4.1).
/// @param data 1 to 65536 octets; another size, an APID over 0x7FF or a count over 0x3FFF is a bug of the
/// caller
[[nodiscard]] Octets encode_space_packet(const PacketHeader& header, OctetView data);

/// Reads exactly one packet: no octet may be missing, none may be left over. The view points into @p octets.
[[nodiscard]] Result<SpacePacketView, SpacePacketError> decode_space_packet(OctetView octets);

/// Length in octets of the packet whose header stands at the beginning of @p octets, 7 to packet_octets_max.
/// @param octets at least packet_header_octets
[[nodiscard]] std::size_t packet_octets(OctetView octets);

/// An idle packet of @p octets (7 to packet_octets_max) in all (4.1.3.3.4.4), its data field filled with @p
/// fill.
[[nodiscard]] Octets make_idle_packet(std::size_t octets, std::uint8_t fill = 0);

}  // namespace srfs::wire
