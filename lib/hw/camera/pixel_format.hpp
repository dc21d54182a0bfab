// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "base/octets.hpp"
#include "image/frame.hpp"

namespace srfs::hw {

/// How the octets of a V4L2 frame hold its pixels.
enum class PixelPacking : std::uint8_t {
  octets,     ///< one octet a pixel
  words,      ///< two octets a pixel, little-endian, right-justified
  packed_10,  ///< MIPI RAW10: four pixels in five octets, the low bits in the fifth
  packed_12,  ///< MIPI RAW12: two pixels in three octets, the low bits in the third
};

/// A monochrome format, or a Bayer mosaic, which is taken as it is.
struct PixelFormat {
  std::uint32_t fourcc;
  std::string_view name;
  int bits;
  PixelPacking packing;
  bool bayer;
};

/// All that are known: best first (more bits, monochrome before Bayer, one pixel a word before packed).
[[nodiscard]] std::span<const PixelFormat> pixel_formats();
/// @return nullptr when it is not one of them
[[nodiscard]] const PixelFormat* find_pixel_format(std::uint32_t fourcc);
[[nodiscard]] const PixelFormat* find_pixel_format(std::string_view name);

/// Octets of one row without padding.
[[nodiscard]] std::size_t row_octets(const PixelFormat& format, int width);

/// Unpacks a frame. @param row_step octets from row to row; what is above the format's bits is cut off
/// @return false when @p octets are too few or the row step is shorter than a row: pixels are then unset
[[nodiscard]] bool unpack_pixels(const PixelFormat& format, OctetView octets, std::size_t row_step,
                                 image::Grid<std::uint16_t>& pixels);

}  // namespace srfs::hw
