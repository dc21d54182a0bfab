// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs::wire {

/// Frame type: sequence-controlled data, expedited data, expedited control (CCSDS 232.0-B-3, 4.1.2.3).
enum class TcFrameType : std::uint8_t { ad, bd, bc };

inline constexpr std::size_t tc_frame_header_octets = 5;
inline constexpr std::size_t tc_fecf_octets = 2;
/// The length field has ten bits and counts one less (4.1.2.7).
inline constexpr std::size_t tc_frame_octets_max = 1024;
/// Header, one octet of data and FECF.
inline constexpr std::size_t tc_frame_octets_min = tc_frame_header_octets + 1 + tc_fecf_octets;
/// Longest frame data field, segment header included.
inline constexpr std::size_t tc_data_octets_max =
    tc_frame_octets_max - tc_frame_header_octets - tc_fecf_octets;
inline constexpr std::uint16_t tc_spacecraft_id_max = 0x3FF;
inline constexpr std::uint8_t tc_vc_max = 63;

/// One TC transfer frame without its FECF, which is made and tested on the way.
struct TcFrame {
  TcFrameType type = TcFrameType::bd;
  std::uint16_t spacecraft_id = 0;  ///< 0 to 0x3FF
  std::uint8_t vc = 0;              ///< 0 to 63
  std::uint8_t sequence = 0;        ///< N(S); 0 in BD and BC frames (4.1.2.8.3)
  Octets data = {};  ///< frame data field, 1 to tc_data_octets_max octets; AD and BD: segment header first
  friend bool operator==(const TcFrame&, const TcFrame&) = default;
};

enum class TcFrameError : std::uint8_t {
  too_short,         ///< shorter than header, one octet and FECF
  too_long,          ///< longer than tc_frame_octets_max
  bad_version,       ///< transfer frame version number is not 0
  wrong_length,      ///< length field and octets differ
  bad_crc,           ///< FECF
  reserved_bits,     ///< the two spare bits are not 0
  reserved_type,     ///< control command with the bypass flag clear (table 4-1)
  wrong_spacecraft,  ///< for another spacecraft
};
[[nodiscard]] std::string_view to_string(TcFrameError error);

using TcFrameHeader = std::array<std::uint8_t, tc_frame_header_octets>;
/// The primary header of a frame (4.1.2). @param data_octets of its data field: 1 to tc_data_octets_max
[[nodiscard]] TcFrameHeader encode_tc_header(TcFrameType type, std::uint16_t spacecraft_id, std::uint8_t vc,
                                             std::uint8_t sequence, std::size_t data_octets);

/// Packs a transfer frame with FECF (CCSDS 232.0-B-3, 4.1). Values out of the stated ranges are bugs of the
/// caller.
[[nodiscard]] Octets encode_tc_frame(const TcFrame& frame);

/// Reads exactly one frame: the frame validation check of 232.0-B-3, 4.4, before COP-1.
/// N(S) of a BD or BC frame is not judged: COP-1 gives it no meaning.
[[nodiscard]] Result<TcFrame, TcFrameError> decode_tc_frame(OctetView octets, std::uint16_t spacecraft_id);

/// Octets of the frame whose header stands at the beginning of @p octets: its length field plus one, 1 to
/// 1024.
/// @param octets at least 4
[[nodiscard]] std::size_t tc_frame_octets(OctetView octets);

/// The segment header of every AD and BD frame here: unsegmented, MAP 0 (4.1.3.2.2).
inline constexpr std::uint8_t segment_header_unsegmented = 0xC0;

enum class SegmentError : std::uint8_t {
  no_payload,  ///< nothing after the segment header
  segmented,   ///< sequence flags are not "no segmentation": one packet a frame
  wrong_map,   ///< MAP is not 0
};
[[nodiscard]] std::string_view to_string(SegmentError error);

/// What follows the segment header of an AD or BD frame: a view into @p data.
[[nodiscard]] Result<OctetView, SegmentError> segment_payload(OctetView data);

/// What a BC frame commands (4.1.3.3).
struct ControlCommand {
  enum class Kind : std::uint8_t { unlock, set_vr };
  Kind kind = Kind::unlock;
  std::uint8_t vr = 0;  ///< set_vr: V*(R)
  friend bool operator==(const ControlCommand&, const ControlCommand&) = default;
};
/// Data field of a BC frame: 00 for unlock, 82 00 V*(R) for set V(R).
[[nodiscard]] Octets encode_control_command(ControlCommand command);

enum class ControlCommandError : std::uint8_t { unknown };
/// Reads what encode_control_command writes, nothing else.
[[nodiscard]] Result<ControlCommand, ControlCommandError> decode_control_command(OctetView data);

}  // namespace srfs::wire
