// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace srfs::wire {

/// The sequence repeats after 255 octets (255 bits, 8 of them an octet).
inline constexpr std::size_t randomizer_period_octets = 255;

/// Sequence of the TC randomizer: x^8+x^6+x^4+x^3+x^2+x+1, preset all ones (CCSDS 231.0-B-4, 6.2).
[[nodiscard]] const std::array<std::uint8_t, randomizer_period_octets>& tc_random_sequence();
/// Sequence of the TM randomizer: x^8+x^7+x^5+x^3+1, preset all ones (CCSDS 131.0-B-3, 10.4).
[[nodiscard]] const std::array<std::uint8_t, randomizer_period_octets>& tm_random_sequence();

/// Randomizes in place; a second time undoes it.
/// @param offset place of the first octet in the frame, for work piece by piece
void randomize_tc(std::span<std::uint8_t> octets, std::size_t offset = 0);
/// Randomizes in place; a second time undoes it. Octet 0 is the first after the ASM.
void randomize_tm(std::span<std::uint8_t> octets, std::size_t offset = 0);

}  // namespace srfs::wire
