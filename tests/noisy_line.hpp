// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

#include "base/octets.hpp"

namespace srfs::testing_support {

/// What noise, jammers and a carrier that drops out do to the octets of a line. The same seed does the same.
class NoisyLine {
 public:
  explicit NoisyLine(std::uint64_t seed) : random_(seed) {}

  /// Each bit is wrong with probability @p rate.
  void spoil_bits(Octets& octets, double rate) {
    if (rate <= 0) return;
    // Gaps between wrong bits are geometric: most octets are never looked at.
    const double scale = 1 / std::log1p(-rate);
    const double bits = 8 * static_cast<double>(octets.size());
    for (double bit = gap(scale); bit < bits; bit += 1 + gap(scale)) {
      const auto at = static_cast<std::size_t>(bit);
      octets[at / 8] ^= static_cast<std::uint8_t>(0x80 >> at % 8);
    }
  }
  /// What comes while somebody else transmits.
  [[nodiscard]] Octets jam(std::size_t octets) {
    Octets noise(octets);
    for (std::uint8_t& octet : noise) octet = static_cast<std::uint8_t>(random_());
    return noise;
  }
  /// 0 to @p below - 1.
  [[nodiscard]] std::size_t number(std::size_t below) { return random_() % below; }

 private:
  [[nodiscard]] double gap(double scale) {
    const double chance = (static_cast<double>(random_() >> 11) + 1) / 9007199254740993.0;  // above 0, to 1
    return std::floor(std::log(chance) * scale);
  }

  std::mt19937_64 random_;
};

}  // namespace srfs::testing_support
