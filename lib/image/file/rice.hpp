// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "base/octets.hpp"

namespace srfs::image {

/// Neighbours that are coded together: BLOCKSIZE of the FITS header.
inline constexpr std::size_t rice_block = 32;

/// Appends a row of 16-bit numbers, packed as FITS 4.0 section 10.4.1 says (RICE_1, BYTEPIX 2). @pre not
/// empty
void pack_rice(std::span<const std::uint16_t> row, Octets& out);

/// @return false where @p packed is too short for the row; the row's values are then of no use
[[nodiscard]] bool unpack_rice(OctetView packed, std::span<std::uint16_t> row);

}  // namespace srfs::image
