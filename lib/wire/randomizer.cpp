// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/randomizer.hpp"

#include <bit>

namespace srfs::wire {
namespace {

using Sequence = std::array<std::uint8_t, randomizer_period_octets>;

/// @param taps bit n set: the n-th oldest of the last eight bits takes part in the next one
constexpr Sequence make_sequence(unsigned taps) {
  Sequence sequence{};
  unsigned last_eight = 0xFF;  // bit 0 is the oldest
  for (std::uint8_t& octet : sequence) {
    for (int bit = 0; bit < 8; ++bit) {
      octet = static_cast<std::uint8_t>(octet << 1 | (last_eight & 1));
      const unsigned next = static_cast<unsigned>(std::popcount(last_eight & taps)) & 1;
      last_eight = last_eight >> 1 | next << 7;
    }
  }
  return sequence;
}

constexpr Sequence tc_sequence = make_sequence(0b0101'1111);
constexpr Sequence tm_sequence = make_sequence(0b1010'1001);

void apply(const Sequence& sequence, std::span<std::uint8_t> octets, std::size_t offset) {
  std::size_t at = offset % sequence.size();
  for (std::uint8_t& octet : octets) {
    octet ^= sequence[at];
    at = at + 1 == sequence.size() ? 0 : at + 1;
  }
}

}  // namespace

const Sequence& tc_random_sequence() {
  return tc_sequence;
}
const Sequence& tm_random_sequence() {
  return tm_sequence;
}
void randomize_tc(std::span<std::uint8_t> octets, std::size_t offset) {
  apply(tc_sequence, octets, offset);
}
void randomize_tm(std::span<std::uint8_t> octets, std::size_t offset) {
  apply(tm_sequence, octets, offset);
}

}  // namespace srfs::wire
