// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/space_packet.hpp"

#include <cassert>

namespace srfs::wire {

std::string_view to_string(SpacePacketError error) {
  switch (error) {
    case SpacePacketError::too_short:
      return "shorter than a packet";
    case SpacePacketError::bad_version:
      return "packet version is not 0";
    case SpacePacketError::length_differs:
      return "length field and octets differ";
  }
  return "?";
}

Octets encode_space_packet(const PacketHeader& header, OctetView data) {
  assert(!data.empty() && data.size() <= 65536);
  assert(header.apid <= idle_apid && header.sequence_count <= 0x3FFF);
  OctetWriter out(packet_octets_max);
  out.u16(static_cast<std::uint16_t>(static_cast<unsigned>(header.type) << 12 |
                                     (header.has_secondary_header ? 0x0800U : 0U) | (header.apid & 0x7FFU)));
  out.u16(static_cast<std::uint16_t>(static_cast<unsigned>(header.grouping) << 14 |
                                     (header.sequence_count & 0x3FFFU)));
  out.u16(static_cast<std::uint16_t>(data.size() - 1));
  out.bytes(data);
  return out.take();
}

Result<SpacePacketView, SpacePacketError> decode_space_packet(OctetView octets) {
  if (octets.size() < packet_header_octets + 1) return Err(SpacePacketError::too_short);
  OctetReader in(octets);
  const unsigned identification = in.u16();
  const unsigned sequence = in.u16();
  if (identification >> 13 != 0) return Err(SpacePacketError::bad_version);
  if (packet_octets(octets) != octets.size()) return Err(SpacePacketError::length_differs);
  SpacePacketView packet;
  packet.header.type = static_cast<PacketType>(identification >> 12 & 1);
  packet.header.has_secondary_header = (identification >> 11 & 1) != 0;
  packet.header.apid = static_cast<std::uint16_t>(identification & 0x7FF);
  packet.header.grouping = static_cast<PacketGrouping>(sequence >> 14);
  packet.header.sequence_count = static_cast<std::uint16_t>(sequence & 0x3FFF);
  packet.data = octets.subspan(packet_header_octets);
  return packet;
}

std::size_t packet_octets(OctetView octets) {
  assert(octets.size() >= packet_header_octets);
  return packet_header_octets + (static_cast<std::size_t>(octets[4]) << 8 | octets[5]) + 1;
}

Octets make_idle_packet(std::size_t octets, std::uint8_t fill) {
  assert(octets >= idle_packet_octets_min && octets <= packet_octets_max);
  const Octets data(octets - packet_header_octets, fill);
  return encode_space_packet({.apid = idle_apid}, data);
}

}  // namespace srfs::wire
