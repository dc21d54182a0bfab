// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/octets.hpp"

namespace srfs::wire {

/// What decides how long a classic CAN frame takes.
struct CanFrameContent {
  std::uint32_t id = 0;  ///< 29 bits if extended, else 11
  bool extended = true;
  bool remote = false;
  std::uint8_t size = 0;  ///< 0-8: the DLC
  OctetView data{};       ///< @p size octets; ignored in a remote frame
};

/// Bits the frame takes on the wire (ISO 11898-1): start of frame to the CRC sequence with its real stuff
/// bits, then CRC delimiter, acknowledgement, end of frame and the intermission of three bits.
[[nodiscard]] unsigned can_bits_on_wire(const CanFrameContent& frame);

}  // namespace srfs::wire
