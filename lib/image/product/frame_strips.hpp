// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "base/octets.hpp"
#include "image/frame.hpp"

/// A frame without loss in strips of rows, each of which stands alone: what is lost or damaged on the way to
/// the ground spoils the strips it touches and nothing else. The file is its strips one after the other and
/// has no header that could be lost. A strip, big-endian:
///
///     octets
///      8  "SRFSTRIP"
///      1  version, 1
///      1  bits of a sample, 1 to 16
///      1  low bits of every pixel that are zero and left away
///      1  zero
///      4  width of the frame
///      4  height of the frame
///      4  rows of a strip; the last one may have fewer
///      4  index of the strip, from 0
///      8  when the exposure began, s, IEEE 754; NaN: unknown
///      4  from where pixels are saturated, ADU, IEEE 754; NaN: unknown
///      4  length of the samples, octets
///      4  CRC-32C of the 44 octets before
///      n  samples: CCSDS 121.0-B without reference samples, blocks of 64, segments of 64 of them
///      4  CRC-32C of the samples
///
/// What is coded is the standard's mapped difference of each pixel from the rounded mean of its left, upper
/// left, upper and upper right neighbours; in the first row of a strip from the left one, at the begin of a
/// row from the upper one, at its end the upper one stands for the upper right one. Four neighbours instead
/// of the standard's one save a third of a bit a pixel where there is noise.
namespace srfs::image {

inline constexpr std::size_t strip_header_octets = 48;
inline constexpr std::size_t strip_overhead_octets = strip_header_octets + 4;

/// @return the strips, or why there are none: pixels that are not whole numbers from 0 to 65535
[[nodiscard]] Result<Octets, Refusal> encode_strips(const Frame& frame);

/// What a file of strips holds.
struct StripsFound {
  Frame frame;                         ///< pixels of missing strips are NaN
  std::uint32_t strips = 0;            ///< that belong to the frame
  std::uint32_t rows = 0;              ///< of a strip
  std::vector<std::uint32_t> missing;  ///< their indices, ascending
  std::uint32_t damaged = 0;           ///< strips whose header is sound and whose samples are not
  std::uint64_t octets_skipped = 0;    ///< that belong to no sound strip
};

/// Takes every sound strip there is, in whatever order; those of another frame than the first sound one are
/// skipped.
/// @return why there is no frame: no sound strip, or a size that is refused
[[nodiscard]] Result<StripsFound, Refusal> decode_strips(OctetView content);

}  // namespace srfs::image
