// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::wire {

/// P-field of CUC level 1: TAI epoch 1958, 4 octets of seconds, 3 of fraction, no extension (CCSDS
/// 301.0-B-4, 3.2.2).
inline constexpr std::uint8_t cuc_p_field = 0x1F;
/// P-field, 4 octets of seconds, 3 octets of 2^-24 s.
inline constexpr std::size_t cuc_octets = 8;

enum class CucError : std::uint8_t {
  wrong_length,  ///< not exactly cuc_octets
  wrong_p_field  ///< another epoch, resolution or an extension octet
};
[[nodiscard]] std::string_view to_string(CucError error);

/// CUC 4+3 with its P-field (CCSDS 301.0-B-4, 3.2). The fraction is rounded to the nearest 2^-24 s (59.6 ns),
/// so decoding and encoding again gives the same octets. Times the format cannot hold (before 1958, after
/// 2094-02) become the nearest one it can.
[[nodiscard]] std::array<std::uint8_t, cuc_octets> encode_cuc(TaiTime time);

/// Reads what encode_cuc writes, rounded to the nearest nanosecond.
[[nodiscard]] Result<TaiTime, CucError> decode_cuc(OctetView octets);

}  // namespace srfs::wire
