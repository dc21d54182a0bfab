// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "wire/space_packet.hpp"

namespace srfs::wire {

/// PUS version number of issue C (ECSS-E-ST-70-41C, 7.4.3.1 and 7.4.4.1).
inline constexpr std::uint8_t pus_version = 2;
/// TC secondary header: version and ack flags, service, subtype, source id.
inline constexpr std::size_t tc_secondary_header_octets = 5;
/// TM secondary header: version and time status, service, subtype, type counter, destination id, CUC 4+3 with
/// P-field.
inline constexpr std::size_t tm_secondary_header_octets = 7 + 8;
/// Packet error control, CRC-16 (annex B.1).
inline constexpr std::size_t packet_error_control_octets = 2;
/// Shortest TC packet: headers and error control.
inline constexpr std::size_t tc_packet_octets_min =
    packet_header_octets + tc_secondary_header_octets + packet_error_control_octets;
/// Longest application data of a TM packet.
inline constexpr std::size_t tm_source_octets_max =
    65536 - tm_secondary_header_octets - packet_error_control_octets;
/// Longest application data of a TC packet (the TC frame sets a lower bound).
inline constexpr std::size_t tc_application_octets_max =
    65536 - tc_secondary_header_octets - packet_error_control_octets;

/// Which successful steps the sender wants reported (7.4.4.1 c; failures are always reported).
namespace ack {
inline constexpr std::uint8_t acceptance = 0b0001;
inline constexpr std::uint8_t start = 0b0010;
inline constexpr std::uint8_t progress = 0b0100;
inline constexpr std::uint8_t completion = 0b1000;
inline constexpr std::uint8_t all = 0b1111;
}  // namespace ack

/// The first four octets of a TC packet, by which a verification report names it (6.1.3.3, request id).
struct RequestId {
  std::uint16_t packet_identification = 0;    ///< version, type, secondary header flag, APID
  std::uint16_t packet_sequence_control = 0;  ///< grouping flags, sequence count
  friend bool operator==(const RequestId&, const RequestId&) = default;
  friend auto operator<=>(const RequestId&, const RequestId&) = default;
};

/// One telecommand packet.
struct TcPacket {
  std::uint16_t apid = 0;            ///< destination, 0 to 0x7FE
  std::uint16_t sequence_count = 0;  ///< of the source, 0 to 0x3FFF
  std::uint8_t ack_flags = ack::all;
  std::uint8_t service = 0;
  std::uint8_t subtype = 0;
  std::uint16_t source_id = 0;
  Octets application = {};  ///< application data, up to tc_application_octets_max
  friend bool operator==(const TcPacket&, const TcPacket&) = default;
};
[[nodiscard]] RequestId request_id(const TcPacket& packet);

/// One telemetry packet.
struct TmPacket {
  std::uint16_t apid = 0;            ///< source, 0 to 0x7FE
  std::uint16_t sequence_count = 0;  ///< per APID, 0 to 0x3FFF
  std::uint8_t time_reference = 0;   ///< spacecraft time reference status, 0 to 15 (7.4.3.1 d)
  std::uint8_t service = 0;
  std::uint8_t subtype = 0;
  std::uint16_t type_counter = 0;  ///< message type counter, per destination, service and subtype
  std::uint16_t destination_id = 0;
  TaiTime time = {};
  Octets source = {};  ///< source data, up to tm_source_octets_max
  friend bool operator==(const TmPacket&, const TmPacket&) = default;
};

/// Why a TC packet is refused. The values are the failure codes of the reports 1,2 (6.1.4.2.2; the standard
/// leaves the numbers to the mission). Codes 1 to 15 belong to this codec; 16 and on to the telecommand
/// router.
enum class TcPacketError : std::uint16_t {
  too_short = 1,        ///< does not hold the headers and the error control
  bad_packet_version,   ///< CCSDS packet version is not 0
  length_differs,       ///< length field and octets differ
  bad_checksum,         ///< packet error control
  not_a_telecommand,    ///< packet type says telemetry
  no_secondary_header,  ///< every TC packet here has one
  segmented,            ///< grouping flags other than unsegmented
  idle_packet,          ///< APID 0x7FF
  bad_pus_version,      ///< PUS version is not 2
};
[[nodiscard]] std::string_view to_string(TcPacketError error);
/// Failure code of the report 1,2.
[[nodiscard]] constexpr std::uint16_t failure_code(TcPacketError error) {
  return static_cast<std::uint16_t>(error);
}

/// Why a TM packet is refused.
enum class TmPacketError : std::uint8_t {
  too_short,
  bad_packet_version,
  length_differs,
  bad_checksum,
  not_telemetry,
  no_secondary_header,
  segmented,
  idle_packet,
  bad_pus_version,
  bad_time_code,
};
[[nodiscard]] std::string_view to_string(TmPacketError error);

/// Packs a TC packet with PUS-C secondary header (7.4.4) and error control. Values out of the stated ranges
/// or too much application data are bugs of the caller.
[[nodiscard]] Octets make_tc_packet(const TcPacket& packet);

/// Reads exactly one TC packet. The checksum is tested before any field it protects is judged, so a damaged
/// packet is always `bad_checksum` or a length error.
[[nodiscard]] Result<TcPacket, TcPacketError> parse_tc_packet(OctetView octets);

/// The request id of octets that parse_tc_packet refused, for the report 1,2; nullopt if not even that is
/// there.
[[nodiscard]] std::optional<RequestId> peek_request_id(OctetView octets);

/// Packs a TM packet with PUS-C secondary header (7.4.3), CUC time and error control.
[[nodiscard]] Octets make_tm_packet(const TmPacket& packet);

/// Reads exactly one TM packet.
[[nodiscard]] Result<TmPacket, TmPacketError> parse_tm_packet(OctetView octets);

}  // namespace srfs::wire
