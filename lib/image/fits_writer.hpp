// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <variant>

#include "base/octets.hpp"
#include "image/frame.hpp"

namespace srfs::image {

/// One line of a FITS header. Key: up to 8 of A-Z, 0-9, - and _. A text may have up to 68 characters.
struct FitsCard {
  std::string key;
  std::variant<bool, std::int64_t, double, std::string> value;
  std::string comment = {};
};

/// A FITS file of one 16-bit image, tile-compressed by rows without loss (Rice, FITS 4.0 section 10), with
/// these cards in the image's header. Loads cfitsio, about 60 ms for two million pixels.
/// @return the file, or why there is none; never throws
[[nodiscard]] Result<Octets, Refusal> encode_packed_fits(const Grid<std::uint16_t>& pixels,
                                                         std::span<const FitsCard> cards);

}  // namespace srfs::image
