// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/octets.hpp"

namespace srfs {

/// CRC-32C (Castagnoli, reflected polynomial 0x82F63B78, as in RFC 3720): the check of records and state
/// slots on disk. "123456789" gives 0xE3069283.
/// @param preset result of the octets before, to go on piece by piece
[[nodiscard]] std::uint32_t crc32c(OctetView data, std::uint32_t preset = 0);

}  // namespace srfs
