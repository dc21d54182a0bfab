// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mission/structures.hpp>

#include "nodes/ttc/command/telecommand.hpp"
#include "wire/pus.hpp"

namespace srfs {

/// Why octets that came up are no telecommand packet.
[[nodiscard]] inline Refusal packet_refusal(wire::TcPacketError error) {
  switch (error) {
    case wire::TcPacketError::bad_checksum:
      return {.code = mission::failure::bad_checksum};
    case wire::TcPacketError::idle_packet:
      return {.code = mission::failure::unknown_apid, .stage = Stage::routing};
    case wire::TcPacketError::bad_pus_version:
    case wire::TcPacketError::no_secondary_header:
      return {.code = mission::failure::unknown_service};
    default:
      return {.code = mission::failure::bad_length};
  }
}

}  // namespace srfs
