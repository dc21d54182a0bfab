// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/octets.hpp"

namespace srfs::wire {

/// CRC-16 of CCSDS 232.0-B / 132.0-B (FECF) and of the PUS packet error control: polynomial 0x1021, preset
/// 0xFFFF, not reflected, no final inversion. Over data followed by its own CRC it gives 0.
/// @param preset result of the octets before, to go on piece by piece
[[nodiscard]] std::uint16_t crc16(OctetView data, std::uint16_t preset = 0xFFFF);

}  // namespace srfs::wire
