// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/time_packet.hpp"

#include "wire/crc16.hpp"
#include "wire/cuc.hpp"
#include "wire/space_packet.hpp"

namespace srfs::wire {
namespace {

constexpr std::size_t error_control_octets = 2;
constexpr std::size_t data_octets = 1 + cuc_octets + error_control_octets;

}  // namespace

Octets make_time_packet(const TimePacket& packet) {
  OctetWriter data;
  data.u8(packet.rate);
  data.bytes(encode_cuc(packet.time));
  data.u16(0);
  Octets octets = encode_space_packet({.type = PacketType::telemetry,
                                       .has_secondary_header = false,
                                       .apid = time_apid,
                                       .sequence_count = packet.sequence_count},
                                      data.view());
  const std::uint16_t crc = crc16(OctetView(octets).first(octets.size() - error_control_octets));
  octets[octets.size() - 2] = static_cast<std::uint8_t>(crc >> 8);
  octets[octets.size() - 1] = static_cast<std::uint8_t>(crc);
  return octets;
}

std::optional<TimePacket> parse_time_packet(OctetView octets) {
  const auto packet = decode_space_packet(octets);
  if (!packet || packet->header.type != PacketType::telemetry || packet->header.apid != time_apid ||
      packet->header.has_secondary_header || packet->data.size() != data_octets)
    return std::nullopt;
  OctetReader in(packet->data);
  TimePacket time{.sequence_count = packet->header.sequence_count, .rate = in.u8(), .time = {}};
  const auto cuc = decode_cuc(in.bytes(cuc_octets));
  if (!cuc || in.u16() != crc16(octets.first(octets.size() - error_control_octets))) return std::nullopt;
  time.time = *cuc;
  return time;
}

}  // namespace srfs::wire
