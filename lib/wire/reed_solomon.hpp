// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs::wire {

/// RS(255,223) of CCSDS 131.0-B-3, clause 4: E = 16, dual basis representation, interleaving depth I.
inline constexpr std::size_t rs_codeword_octets = 255;
inline constexpr std::size_t rs_data_octets = 223;
inline constexpr std::size_t rs_parity_octets = 32;
inline constexpr unsigned rs_correctable_octets = 16;
inline constexpr unsigned rs_interleave_max = 8;

/// True if @p data_octets can be coded with depth @p interleave (1 to 8): a multiple of it, and not over 223
/// a codeword. Less than 223 a codeword is virtual fill (4.3.7).
[[nodiscard]] constexpr bool rs_fits(std::size_t data_octets, unsigned interleave) {
  return interleave >= 1 && interleave <= rs_interleave_max && data_octets > 0 &&
         data_octets % interleave == 0 && data_octets / interleave <= rs_data_octets;
}

/// The data followed by 32 x @p interleave parity octets: octet k of data and of parity belongs to codeword k
/// mod I (4.3.5).
/// @param data  rs_fits(data.size(), interleave) holds
[[nodiscard]] Octets rs_encode(OctetView data, unsigned interleave);

/// A codeblock whose every codeword was right or could be corrected.
struct RsDecoded {
  Octets data;                    ///< without parity
  unsigned corrected_octets = 0;  ///< in all codewords, parity included
};

enum class RsError : std::uint8_t {
  uncorrectable,  ///< some codeword has more than 16 wrong octets
};
[[nodiscard]] std::string_view to_string(RsError error);

/// Corrects up to 16 wrong octets in each codeword. Beyond that the answer is `uncorrectable`, save for the
/// code's own residual risk (below 1e-13 for a random word).
/// @param codeblock  rs_fits(codeblock.size() - 32 x interleave, interleave) holds
[[nodiscard]] Result<RsDecoded, RsError> rs_decode(OctetView codeblock, unsigned interleave);

}  // namespace srfs::wire
