// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/tc_uplink.hpp"

#include <cassert>

#include "wire/cltu.hpp"

namespace srfs::wire {

namespace {

/// The frame around @p content, secured.
Result<TcFrame, TcUplinkError> secure(const TcUplinkChannel& channel, TcFrameType type, std::uint8_t sequence,
                                      const SdlsSeal& seal, OctetView content) {
  const std::size_t data_octets = 1 + sdls_overhead_octets + content.size();
  const SdlsHeader header =
      channel.whole_header
          ? SdlsHeader(encode_tc_header(type, channel.spacecraft_id, channel.vc, sequence, data_octets))
          : SdlsHeader(channel.vc);
  auto secured = sdls_apply(seal, header, segment_header_unsegmented, content);
  if (!secured) return Err(TcUplinkError::cipher_failed);
  return TcFrame{.type = type,
                 .spacecraft_id = channel.spacecraft_id,
                 .vc = channel.vc,
                 .sequence = sequence,
                 .data = std::move(*secured)};
}

}  // namespace

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

  const std::uint8_t number = type == TcFrameType::ad ? sequence : std::uint8_t{0};
  if (seal != nullptr) {
    const auto frame = secure(channel, type, number, *seal, packet);
    if (!frame) return Err(frame.error());
    return encode_cltu(encode_tc_frame(*frame), channel.randomize);
  }
  TcFrame frame{
      .type = type, .spacecraft_id = channel.spacecraft_id, .vc = channel.vc, .sequence = number, .data = {}};
  frame.data.reserve(1 + packet.size());
  frame.data.push_back(segment_header_unsegmented);
  frame.data.insert(frame.data.end(), packet.begin(), packet.end());
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

Result<Octets, TcUplinkError> make_secured_control_cltu(const TcUplinkChannel& channel,
                                                        ControlCommand command, const SdlsSeal& seal) {
  const auto frame = secure(channel, TcFrameType::bc, 0, seal, encode_control_command(command));
  if (!frame) return Err(frame.error());
  return encode_cltu(encode_tc_frame(*frame), channel.randomize);
}

}  // namespace srfs::wire
