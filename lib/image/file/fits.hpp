// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <variant>

#include "base/octets.hpp"
#include "image/frame.hpp"

/// FITS files as they are written and read on board: one image of 16-bit numbers, plain or with each row
/// packed without loss (Rice, FITS 4.0 section 10.4.1). Other kinds of FITS are read on the ground
/// (image/photograph).
namespace srfs::image {

/// One line of a FITS header. Key: up to 8 of A-Z, 0-9, - and _. Texts and comments are printable ASCII; what
/// is longer than the line is cut off. A number that is not finite is written as "no value".
struct FitsCard {
  std::string key;
  std::variant<bool, std::int64_t, double, std::string> value;
  std::string comment = {};
};

/// CCD-TEMP is in degrees Celsius.
inline constexpr double ice_point_k = 273.15;

/// UTC for DATE-OBS, to the microsecond. FITS has no Z behind it.
[[nodiscard]] std::string fits_date(UtcTime time);

/// @return the frame, or why there is none; never throws. Header, size and length are judged before memory is
/// taken.
[[nodiscard]] Result<Frame, Refusal> decode_fits(OctetView content);

/// A plain file with these cards behind those that describe the image. Values are rounded and cut off at 0
/// and 65535; NaN becomes 0.
[[nodiscard]] Octets encode_fits(const Plane& pixels, std::span<const FitsCard> cards = {});

/// A packed file with these cards in the image's header.
/// @return the file, or why there is none; never throws
[[nodiscard]] Result<Octets, Refusal> encode_packed_fits(const Grid<std::uint16_t>& pixels,
                                                         std::span<const FitsCard> cards);

}  // namespace srfs::image
