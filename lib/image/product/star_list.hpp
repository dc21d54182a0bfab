// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "base/octets.hpp"
#include "image/detections.hpp"

/// Stars of a task for the ground, in few octets: 12 each behind a header of 16, big-endian, so that what has
/// no room can be cut off.
///
///     octets                                    octets
///      8  "SRFSTARS"                             2  frame, from 0
///      1  version, 1                             3  x, 1/1024 px      signed
///      3  zero                                   3  y, 1/1024 px      signed
///      4  CRC-32C of the stars                   2  flux, 256 log2(ADU)
///                                                2  SNR, 1/16
namespace srfs::image {

inline constexpr std::size_t star_list_header_octets = 16;
inline constexpr std::size_t listed_star_octets = 12;

struct ListedStar {
  std::uint16_t frame = 0;
  double x = 0;
  double y = 0;
  double flux = 0;
  double snr = 0;
};

[[nodiscard]] Octets encode_star_list(const std::vector<ListedStar>& stars);

/// @return the stars, or why this is no list of them
[[nodiscard]] Result<std::vector<ListedStar>, Refusal> decode_star_list(OctetView content);

/// The brightest stars of many frames: at most as many as requested, in memory for that many.
class BrightestStars {
 public:
  explicit BrightestStars(std::size_t most) : most_(most) {}
  void add(std::uint16_t frame, const std::vector<Star>& stars);
  /// Brightest first. How many did not find room: dropped().
  [[nodiscard]] const std::vector<ListedStar>& sorted();
  [[nodiscard]] std::uint64_t dropped() const { return dropped_; }

 private:
  void cut();
  std::size_t most_;
  std::uint64_t dropped_ = 0;
  std::vector<ListedStar> stars_;
};

}  // namespace srfs::image
