// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string_view>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "wire/sdls.hpp"
#include "wire/tc_frame.hpp"

namespace srfs::wire {

/// What all transmissions of one TC virtual channel have in common.
struct TcUplinkChannel {
  std::uint16_t spacecraft_id = 0;  ///< 0 to 0x3FF
  std::uint8_t vc = 0;              ///< 0 to 63
  bool randomize = false;           ///< TC randomizer (the whole link's setting)
  bool whole_header = false;        ///< the MAC covers the whole primary header, else the virtual channel
};

enum class TcUplinkError : std::uint8_t {
  empty,          ///< no packet
  too_long,       ///< the packet does not fit into one frame (there is no segmentation)
  cipher_failed,  ///< the cipher library refused to work
};
[[nodiscard]] std::string_view to_string(TcUplinkError error);

/// One packet as the octets for the line: frame data field (secured if @p seal), AD or BD frame, CLTU. Pure:
/// the caller keeps V(S) and the security counter, and uses no counter twice (also not for a retransmission).
/// @param type      ad or bd
/// @param sequence  N(S) of an AD frame; a BD frame carries 0
/// @param seal      nullptr on a channel without security
[[nodiscard]] Result<Octets, TcUplinkError> make_uplink_cltu(const TcUplinkChannel& channel, TcFrameType type,
                                                             std::uint8_t sequence, const SdlsSeal* seal,
                                                             OctetView packet);

/// A control command (unlock, set V(R)) as the octets for the line, without security, as CCSDS 355.0-B-2 has
/// it: frames without data of users are outside its scope.
[[nodiscard]] Octets make_control_cltu(const TcUplinkChannel& channel, ControlCommand command);
/// The same for a spacecraft that executes authentic control commands only: the data field is secured as that
/// of a BD frame, segment header included.
[[nodiscard]] Result<Octets, TcUplinkError> make_secured_control_cltu(const TcUplinkChannel& channel,
                                                                      ControlCommand command,
                                                                      const SdlsSeal& seal);

}  // namespace srfs::wire
