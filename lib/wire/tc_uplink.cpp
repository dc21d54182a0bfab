// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/tc_uplink.hpp"

#include <cassert>

#include "wire/cltu.hpp"

namespace srfs::wire {

std::string_view to_string(TcUplinkError error) {
  switch (error) {
    case TcUplinkError::empty:
      return "no packet";
    case TcUplinkError::too_long:
      return "packet too long for one frame";
    case TcUplinkError::cipher_failed:
      return "cipher failed";
  }
  return "?";
}

Result<Octets, TcUplinkError> make_uplink_cltu(const TcUplinkChannel& channel, TcFrameType type,
                                               std::uint8_t sequence, const SdlsSeal* seal,
                                               OctetView packet) {
  assert(type != TcFrameType::bc);
  if (packet.empty()) return Err(TcUplinkError::empty);
  const std::size_t overhead = 1 + (seal != nullptr ? sdls_overhead_octets : 0);
  if (packet.size() + overhead > tc_data_octets_max) return Err(TcUplinkError::too_long);

  TcFrame frame{.type = type,
                .spacecraft_id = channel.spacecraft_id,
                .vc = channel.vc,
                .sequence = type == TcFrameType::ad ? sequence : std::uint8_t{0},
                .data = {}};
  if (seal != nullptr) {
    auto secured = sdls_apply(*seal, channel.vc, segment_header_unsegmented, packet);
    if (!secured) return Err(TcUplinkError::cipher_failed);
    frame.data = std::move(*secured);
  } else {
    frame.data.reserve(1 + packet.size());
    frame.data.push_back(segment_header_unsegmented);
    frame.data.insert(frame.data.end(), packet.begin(), packet.end());
  }
  return encode_cltu(encode_tc_frame(frame), channel.randomize);
}

Octets make_control_cltu(const TcUplinkChannel& channel, ControlCommand command) {
  const TcFrame frame{.type = TcFrameType::bc,
                      .spacecraft_id = channel.spacecraft_id,
                      .vc = channel.vc,
                      .sequence = 0,
                      .data = encode_control_command(command)};
  return encode_cltu(encode_tc_frame(frame), channel.randomize);
}

}  // namespace srfs::wire
