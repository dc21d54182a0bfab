// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs::wire {

/// Space Packets that carry one CFDP PDU each, in both directions.
inline constexpr std::uint16_t cfdp_apid = 2045;

/// Fixed part of the header, without ids and sequence number (CCSDS 727.0-B-5, 5.1).
inline constexpr std::size_t cfdp_fixed_header_octets = 4;
/// Names in a Metadata PDU are LV fields of one length octet.
inline constexpr std::size_t cfdp_name_octets_max = 255;

/// Condition codes (table 5-5).
enum class CfdpCondition : std::uint8_t {
  no_error = 0,
  positive_ack_limit = 1,
  keep_alive_limit = 2,
  invalid_transmission_mode = 3,
  filestore_rejection = 4,
  file_checksum_failure = 5,
  file_size_error = 6,
  nak_limit = 7,
  inactivity = 8,
  invalid_file_structure = 9,
  check_limit = 10,
  unsupported_checksum_type = 11,
  suspend_request = 14,
  cancel_request = 15,
};
[[nodiscard]] std::string_view to_string(CfdpCondition condition);

/// Checksum identifiers of the SANA registry; 1 (Proximity-1) has no codec here.
enum class CfdpChecksumType : std::uint8_t { modular = 0, crc32c = 2, crc32 = 3, null = 15 };

/// What every PDU of a transaction says in front (5.1). Length, PDU type and direction follow from the
/// contents.
struct CfdpHeader {
  bool unacknowledged = false;              ///< class 1
  bool crc = false;                         ///< CRC-16 behind the PDU
  bool large_file = false;                  ///< offsets and sizes have 8 octets, not 4
  std::uint8_t entity_id_octets = 2;        ///< 1, 2, 4 or 8
  std::uint8_t sequence_number_octets = 4;  ///< 1, 2, 4 or 8
  std::uint64_t source_entity = 0;
  std::uint64_t sequence_number = 0;
  std::uint64_t destination_entity = 0;
  friend bool operator==(const CfdpHeader&, const CfdpHeader&) = default;
};

/// An option of a Metadata PDU. Filestore requests (type 0) are refused by the decoder.
struct CfdpTlv {
  static constexpr std::uint8_t filestore_request = 0;
  static constexpr std::uint8_t filestore_response = 1;
  static constexpr std::uint8_t message_to_user = 2;
  static constexpr std::uint8_t fault_handler_override = 4;
  static constexpr std::uint8_t flow_label = 5;
  static constexpr std::uint8_t fault_location = 6;

  std::uint8_t type = message_to_user;
  Octets value = {};  ///< at most 255 octets
  friend bool operator==(const CfdpTlv&, const CfdpTlv&) = default;
};

struct CfdpMetadata {
  bool closure_requested = false;
  std::uint8_t checksum_type = 0;  ///< of CfdpChecksumType, or one that is not known here
  std::uint64_t file_size = 0;     ///< octets; 0: not known yet (5.2.5)
  std::string source_file = {};
  std::string destination_file = {};
  std::vector<CfdpTlv> options = {};
  friend bool operator==(const CfdpMetadata&, const CfdpMetadata&) = default;
};

struct CfdpFileData {
  std::uint64_t offset = 0;
  OctetView data = {};  ///< at least one octet; decoded: points into the PDU
};

struct CfdpEof {
  CfdpCondition condition = CfdpCondition::no_error;
  std::uint32_t checksum = 0;
  std::uint64_t file_size = 0;
  std::optional<std::uint64_t> fault_location = {};  ///< entity id
  friend bool operator==(const CfdpEof&, const CfdpEof&) = default;
};

/// Table 5-7.
enum class CfdpFileStatus : std::uint8_t { discarded = 0, rejected = 1, retained = 2, unreported = 3 };

struct CfdpFinished {
  CfdpCondition condition = CfdpCondition::no_error;
  bool incomplete = false;
  CfdpFileStatus file_status = CfdpFileStatus::retained;
  std::optional<std::uint64_t> fault_location = {};
  friend bool operator==(const CfdpFinished&, const CfdpFinished&) = default;
};

/// Table 5-8.
enum class CfdpTransactionStatus : std::uint8_t {
  undefined = 0,
  active = 1,
  terminated = 2,
  unrecognized = 3,
};

struct CfdpAck {
  bool of_finished = false;  ///< else of EOF
  CfdpCondition condition = CfdpCondition::no_error;
  CfdpTransactionStatus status = CfdpTransactionStatus::active;
  friend bool operator==(const CfdpAck&, const CfdpAck&) = default;
};

/// A part of the file, [start, end). In a NAK (0, 0) asks for the Metadata PDU.
struct CfdpSegment {
  std::uint64_t start = 0;
  std::uint64_t end = 0;
  friend bool operator==(const CfdpSegment&, const CfdpSegment&) = default;
};

struct CfdpNak {
  CfdpSegment scope;
  std::vector<CfdpSegment> segments = {};
  friend bool operator==(const CfdpNak&, const CfdpNak&) = default;
};

struct CfdpPrompt {
  bool keep_alive = false;  ///< else NAK
  friend bool operator==(const CfdpPrompt&, const CfdpPrompt&) = default;
};

struct CfdpKeepAlive {
  std::uint64_t progress = 0;  ///< octets of the file
  friend bool operator==(const CfdpKeepAlive&, const CfdpKeepAlive&) = default;
};

using CfdpBody = std::variant<CfdpMetadata, CfdpFileData, CfdpEof, CfdpFinished, CfdpAck, CfdpNak, CfdpPrompt,
                              CfdpKeepAlive>;

struct CfdpPdu {
  CfdpHeader header;
  CfdpBody body;
};

enum class CfdpPduError : std::uint8_t {
  too_short,          ///< ends within the header
  bad_version,        ///< not version 1 (binary 001)
  length_differs,     ///< the octets are not exactly as many as the header says
  bad_id_length,      ///< ids or sequence number of 3, 5, 6 or 7 octets
  bad_crc,            ///< PDU CRC
  record_structure,   ///< file data that respects record boundaries
  segment_metadata,   ///< file data with segment metadata
  empty_file_data,    ///< file data without any
  unknown_directive,  ///< reserved directive code
  wrong_direction,    ///< this PDU does not travel that way
  reserved_value,     ///< spare bits, or a value the standard reserves
  truncated,          ///< a field ends behind the PDU
  trailing_octets,    ///< something follows the last field
  bad_option,         ///< TLV that does not belong there, or with a wrong length
  filestore_request,  ///< not offered here: files are commanded by PUS 23
  bad_segment,        ///< a segment or scope that ends before it starts, or data beyond the last offset
};
inline constexpr std::size_t cfdp_pdu_error_count = 16;
[[nodiscard]] std::string_view to_string(CfdpPduError error);

/// Octets of the header of every PDU of this transaction.
[[nodiscard]] constexpr std::size_t cfdp_header_octets(const CfdpHeader& header) {
  return cfdp_fixed_header_octets + 2U * header.entity_id_octets + header.sequence_number_octets;
}
/// Octets around the file data of a File Data PDU: header, offset, CRC.
[[nodiscard]] constexpr std::size_t cfdp_file_data_overhead(const CfdpHeader& header) {
  return cfdp_header_octets(header) + (header.large_file ? 8 : 4) + (header.crc ? 2 : 0);
}
/// The most segments a NAK PDU of @p octets in all has room for.
[[nodiscard]] std::size_t cfdp_nak_segments_max(const CfdpHeader& header, std::size_t octets);

/// Packs one PDU. Values that their fields cannot hold are bugs of the caller.
[[nodiscard]] Octets encode_cfdp_pdu(const CfdpHeader& header, const CfdpBody& body);

/// Reads exactly one PDU. File data points into @p octets.
[[nodiscard]] Result<CfdpPdu, CfdpPduError> decode_cfdp_pdu(OctetView octets);

/// Travels from the receiving to the sending entity: Finished, NAK, Keep Alive and the ACK of EOF.
[[nodiscard]] bool is_toward_sender(const CfdpBody& body);

}  // namespace srfs::wire
