// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/tc_frame.hpp"

#include <cassert>

#include "wire/crc16.hpp"

namespace srfs::wire {
namespace {

constexpr unsigned bypass_flag = 0x2000;
constexpr unsigned control_flag = 0x1000;
constexpr unsigned spare_bits = 0x0C00;

}  // namespace

std::string_view to_string(TcFrameError error) {
  switch (error) {
    case TcFrameError::too_short:
      return "shorter than a frame";
    case TcFrameError::too_long:
      return "longer than a frame may be";
    case TcFrameError::bad_version:
      return "frame version is not 0";
    case TcFrameError::wrong_length:
      return "length field and octets differ";
    case TcFrameError::bad_crc:
      return "frame error control is wrong";
    case TcFrameError::reserved_bits:
      return "spare bits are set";
    case TcFrameError::reserved_type:
      return "sequence-controlled control frame";
    case TcFrameError::wrong_spacecraft:
      return "for another spacecraft";
  }
  return "?";
}

std::string_view to_string(SegmentError error) {
  switch (error) {
    case SegmentError::no_payload:
      return "nothing after the segment header";
    case SegmentError::segmented:
      return "segmented";
    case SegmentError::wrong_map:
      return "MAP is not 0";
  }
  return "?";
}

TcFrameHeader encode_tc_header(TcFrameType type, std::uint16_t spacecraft_id, std::uint8_t vc,
                               std::uint8_t sequence, std::size_t data_octets) {
  assert(data_octets > 0 && data_octets <= tc_data_octets_max);
  assert(spacecraft_id <= tc_spacecraft_id_max && vc <= tc_vc_max);
  const std::size_t length = tc_frame_header_octets + data_octets + tc_fecf_octets;
  const unsigned flags = type == TcFrameType::ad   ? 0
                         : type == TcFrameType::bd ? bypass_flag
                                                   : bypass_flag | control_flag;
  const unsigned first = flags | spacecraft_id;
  const std::size_t second = static_cast<std::size_t>(vc) << 10 | (length - 1);
  return {static_cast<std::uint8_t>(first >> 8), static_cast<std::uint8_t>(first),
          static_cast<std::uint8_t>(second >> 8), static_cast<std::uint8_t>(second), sequence};
}

Octets encode_tc_frame(const TcFrame& frame) {
  OctetWriter out(tc_frame_octets_max);
  out.bytes(encode_tc_header(frame.type, frame.spacecraft_id, frame.vc, frame.sequence, frame.data.size()));
  out.bytes(frame.data);
  out.u16(crc16(out.view()));
  return out.take();
}

std::size_t tc_frame_octets(OctetView octets) {
  assert(octets.size() >= 4);
  return ((static_cast<std::size_t>(octets[2]) << 8 | octets[3]) & 0x3FF) + 1;
}

Result<TcFrame, TcFrameError> decode_tc_frame(OctetView octets, std::uint16_t spacecraft_id) {
  using Error = TcFrameError;
  if (octets.size() < tc_frame_octets_min) return Err(Error::too_short);
  if (octets.size() > tc_frame_octets_max) return Err(Error::too_long);
  if (octets[0] >> 6 != 0) return Err(Error::bad_version);
  if (tc_frame_octets(octets) != octets.size()) return Err(Error::wrong_length);
  if (crc16(octets) != 0) return Err(Error::bad_crc);

  OctetReader in(octets.first(octets.size() - tc_fecf_octets));
  const unsigned identification = in.u16();
  if ((identification & spare_bits) != 0) return Err(Error::reserved_bits);
  const bool bypass = (identification & bypass_flag) != 0;
  const bool control = (identification & control_flag) != 0;
  if (control && !bypass) return Err(Error::reserved_type);
  TcFrame frame;
  frame.type = control ? TcFrameType::bc : bypass ? TcFrameType::bd : TcFrameType::ad;
  frame.spacecraft_id = static_cast<std::uint16_t>(identification & tc_spacecraft_id_max);
  if (frame.spacecraft_id != spacecraft_id) return Err(Error::wrong_spacecraft);
  frame.vc = static_cast<std::uint8_t>(in.u16() >> 10);
  frame.sequence = in.u8();
  const OctetView data = in.rest();
  frame.data.assign(data.begin(), data.end());
  return frame;
}

Result<OctetView, SegmentError> segment_payload(OctetView data) {
  if (data.size() < 2) return Err(SegmentError::no_payload);
  if (data[0] >> 6 != 3) return Err(SegmentError::segmented);
  if ((data[0] & 0x3F) != 0) return Err(SegmentError::wrong_map);
  return data.subspan(1);
}

Octets encode_control_command(ControlCommand command) {
  if (command.kind == ControlCommand::Kind::unlock) return {0x00};
  return {0x82, 0x00, command.vr};
}

Result<ControlCommand, ControlCommandError> decode_control_command(OctetView data) {
  if (data.size() == 1 && data[0] == 0x00) return ControlCommand{.kind = ControlCommand::Kind::unlock};
  if (data.size() == 3 && data[0] == 0x82 && data[1] == 0x00) {
    return ControlCommand{.kind = ControlCommand::Kind::set_vr, .vr = data[2]};
  }
  return Err(ControlCommandError::unknown);
}

}  // namespace srfs::wire
