// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/pus.hpp"

#include <cassert>

#include "wire/crc16.hpp"
#include "wire/cuc.hpp"

namespace srfs::wire {
namespace {

Octets with_error_control(const PacketHeader& header, OctetWriter& fields) {
  assert(fields.ok());
  // The error control stands at the end of the data field, so the length must count it before it is known.
  fields.u16(0);
  Octets packet = encode_space_packet(header, fields.view());
  const std::uint16_t crc = crc16(OctetView(packet).first(packet.size() - packet_error_control_octets));
  packet[packet.size() - 2] = static_cast<std::uint8_t>(crc >> 8);
  packet[packet.size() - 1] = static_cast<std::uint8_t>(crc & 0xFF);
  return packet;
}

}  // namespace

std::string_view to_string(TcPacketError error) {
  switch (error) {
    case TcPacketError::too_short:
      return "shorter than a telecommand packet";
    case TcPacketError::bad_packet_version:
      return "packet version is not 0";
    case TcPacketError::length_differs:
      return "length field and octets differ";
    case TcPacketError::bad_checksum:
      return "packet error control is wrong";
    case TcPacketError::not_a_telecommand:
      return "packet is not a telecommand";
    case TcPacketError::no_secondary_header:
      return "packet has no secondary header";
    case TcPacketError::segmented:
      return "packet is part of a group";
    case TcPacketError::idle_packet:
      return "packet is an idle packet";
    case TcPacketError::bad_pus_version:
      return "PUS version is not 2";
  }
  return "?";
}

std::string_view to_string(TmPacketError error) {
  switch (error) {
    case TmPacketError::too_short:
      return "shorter than a telemetry packet";
    case TmPacketError::bad_packet_version:
      return "packet version is not 0";
    case TmPacketError::length_differs:
      return "length field and octets differ";
    case TmPacketError::bad_checksum:
      return "packet error control is wrong";
    case TmPacketError::not_telemetry:
      return "packet is not telemetry";
    case TmPacketError::no_secondary_header:
      return "packet has no secondary header";
    case TmPacketError::segmented:
      return "packet is part of a group";
    case TmPacketError::idle_packet:
      return "packet is an idle packet";
    case TmPacketError::bad_pus_version:
      return "PUS version is not 2";
    case TmPacketError::bad_time_code:
      return "time is not CUC 4+3 of epoch 1958";
  }
  return "?";
}

RequestId request_id(const TcPacket& packet) {
  return {.packet_identification = static_cast<std::uint16_t>(0x1800U | packet.apid),
          .packet_sequence_control = static_cast<std::uint16_t>(0xC000U | packet.sequence_count)};
}

Octets make_tc_packet(const TcPacket& packet) {
  assert(packet.apid < idle_apid && packet.ack_flags <= ack::all);
  assert(packet.application.size() <= tc_application_octets_max);
  OctetWriter fields;
  fields.u8(static_cast<std::uint8_t>(pus_version << 4 | packet.ack_flags));
  fields.u8(packet.service);
  fields.u8(packet.subtype);
  fields.u16(packet.source_id);
  fields.bytes(packet.application);
  return with_error_control({.type = PacketType::telecommand,
                             .has_secondary_header = true,
                             .apid = packet.apid,
                             .sequence_count = packet.sequence_count},
                            fields);
}

Result<TcPacket, TcPacketError> parse_tc_packet(OctetView octets) {
  using Error = TcPacketError;
  const auto packet = decode_space_packet(octets);
  if (!packet) {
    if (packet.error() == SpacePacketError::too_short) return Err(Error::too_short);
    if (packet.error() == SpacePacketError::bad_version) return Err(Error::bad_packet_version);
    return Err(Error::length_differs);
  }
  if (octets.size() < tc_packet_octets_min) return Err(Error::too_short);
  if (crc16(octets) != 0) return Err(Error::bad_checksum);
  const PacketHeader& header = packet->header;
  if (header.type != PacketType::telecommand) return Err(Error::not_a_telecommand);
  if (!header.has_secondary_header) return Err(Error::no_secondary_header);
  if (header.grouping != PacketGrouping::unsegmented) return Err(Error::segmented);
  if (header.apid == idle_apid) return Err(Error::idle_packet);

  OctetReader in(packet->data.first(packet->data.size() - packet_error_control_octets));
  const std::uint8_t version_and_ack = in.u8();
  if (version_and_ack >> 4 != pus_version) return Err(Error::bad_pus_version);
  TcPacket tc;
  tc.apid = header.apid;
  tc.sequence_count = header.sequence_count;
  tc.ack_flags = version_and_ack & 0x0F;
  tc.service = in.u8();
  tc.subtype = in.u8();
  tc.source_id = in.u16();
  const OctetView application = in.rest();
  tc.application.assign(application.begin(), application.end());
  return tc;
}

std::optional<RequestId> peek_request_id(OctetView octets) {
  if (octets.size() < 4) return std::nullopt;
  OctetReader in(octets);
  RequestId id;
  id.packet_identification = in.u16();
  id.packet_sequence_control = in.u16();
  return id;
}

Octets make_tm_packet(const TmPacket& packet) {
  assert(packet.apid < idle_apid && packet.time_reference <= 0x0F);
  assert(packet.source.size() <= tm_source_octets_max);
  OctetWriter fields;
  fields.u8(static_cast<std::uint8_t>(pus_version << 4 | packet.time_reference));
  fields.u8(packet.service);
  fields.u8(packet.subtype);
  fields.u16(packet.type_counter);
  fields.u16(packet.destination_id);
  fields.bytes(encode_cuc(packet.time));
  fields.bytes(packet.source);
  return with_error_control({.type = PacketType::telemetry,
                             .has_secondary_header = true,
                             .apid = packet.apid,
                             .sequence_count = packet.sequence_count},
                            fields);
}

Result<TmPacket, TmPacketError> parse_tm_packet(OctetView octets) {
  using Error = TmPacketError;
  const auto packet = decode_space_packet(octets);
  if (!packet) {
    if (packet.error() == SpacePacketError::too_short) return Err(Error::too_short);
    if (packet.error() == SpacePacketError::bad_version) return Err(Error::bad_packet_version);
    return Err(Error::length_differs);
  }
  if (packet->data.size() < tm_secondary_header_octets + packet_error_control_octets)
    return Err(Error::too_short);
  if (crc16(octets) != 0) return Err(Error::bad_checksum);
  const PacketHeader& header = packet->header;
  if (header.type != PacketType::telemetry) return Err(Error::not_telemetry);
  if (!header.has_secondary_header) return Err(Error::no_secondary_header);
  if (header.grouping != PacketGrouping::unsegmented) return Err(Error::segmented);
  if (header.apid == idle_apid) return Err(Error::idle_packet);

  OctetReader in(packet->data.first(packet->data.size() - packet_error_control_octets));
  const std::uint8_t version_and_time = in.u8();
  if (version_and_time >> 4 != pus_version) return Err(Error::bad_pus_version);
  TmPacket tm;
  tm.apid = header.apid;
  tm.sequence_count = header.sequence_count;
  tm.time_reference = version_and_time & 0x0F;
  tm.service = in.u8();
  tm.subtype = in.u8();
  tm.type_counter = in.u16();
  tm.destination_id = in.u16();
  const auto time = decode_cuc(in.bytes(cuc_octets));
  if (!time) return Err(Error::bad_time_code);
  tm.time = *time;
  const OctetView source = in.rest();
  tm.source.assign(source.begin(), source.end());
  return tm;
}

}  // namespace srfs::wire
