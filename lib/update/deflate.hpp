// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs::update {

/// Why a stream cannot be expanded.
enum class DeflateError : std::uint8_t {
  damaged,   ///< no DEFLATE, or cut off
  too_long,  ///< it gives more than it should: a bomb, and no more than a part of it was expanded
  too_short,
  trailing,  ///< octets behind its end
};

/// @p data as one raw DEFLATE stream (RFC 1951), as small as zlib makes it. The same input gives the same
/// octets with the same zlib.
[[nodiscard]] Octets shrink(OctetView data);

/// What @p stream holds, if that is exactly @p octets. Takes octets + 1 of memory and some 40 KiB of zlib's,
/// whatever stands in the stream.
[[nodiscard]] Result<Octets, DeflateError> expand(OctetView stream, std::size_t octets);

}  // namespace srfs::update
