// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cassert>
#include <cstdint>

#include "base/octets.hpp"

namespace srfs::wire {

/// One classic CAN data frame (ISO 11898-1).
struct CanDataFrame {
  std::uint32_t id = 0;  ///< 29 bits if extended, else 11
  bool extended = true;
  std::uint8_t size = 0;  ///< 0-8
  std::array<std::uint8_t, 8> data{};

  [[nodiscard]] OctetView view() const { return {data.data(), size}; }
  friend bool operator==(const CanDataFrame&, const CanDataFrame&) = default;
};

/// @param data  at most 8 octets (assert)
[[nodiscard]] inline CanDataFrame make_data_frame(std::uint32_t id, bool extended, OctetView data) {
  CanDataFrame frame{.id = id, .extended = extended};
  assert(data.size() <= frame.data.size());
  frame.size = static_cast<std::uint8_t>(data.size());
  std::copy(data.begin(), data.end(), frame.data.begin());
  return frame;
}

/// On which identifier the computer asks, and on which the peripheral answers.
struct CanIdentifierPair {
  std::uint32_t request = 0;
  std::uint32_t answer = 0;
  bool extended = true;  ///< both
  friend bool operator==(const CanIdentifierPair&, const CanIdentifierPair&) = default;
};

/// The identifier as the bits that arbitration compares: of two frames the one with the lower value gets the
/// bus (ISO 11898-1, 10.4.2 and 10.6). Base identifier, RTR or SRR, IDE, then (extended) the 18 low bits and
/// RTR.
[[nodiscard]] constexpr std::uint32_t arbitration_value(std::uint32_t id, bool extended,
                                                        bool remote = false) {
  const std::uint32_t rtr = remote ? 1 : 0;
  if (!extended) return id << 21U | rtr << 20U;
  return (id >> 18U) << 21U | 1U << 20U | 1U << 19U | (id & 0x3FFFFU) << 1U | rtr;
}

/// What can_switcher writes behind the frames of a dead process (docs/reference/icd_can.md); every frame of
/// the computer comes before it.
inline constexpr std::uint32_t transmit_marker_id = 0x1CDA0101;
[[nodiscard]] constexpr bool comes_before_marker(std::uint32_t id, bool extended) {
  return arbitration_value(id, extended) < arbitration_value(transmit_marker_id, true);
}

}  // namespace srfs::wire
