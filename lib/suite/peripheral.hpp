// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace srfs::suite {

/// Where a payload's peripheral is, as the deployment says (docs/reference/icd_can.md, sections 1 and 6).
struct Peripheral {
  static constexpr std::uint8_t lowest_can_address = 0x02;  ///< 0x01 is the computer
  static constexpr std::uint8_t highest_can_address = 0xFE;
  static constexpr std::uint8_t power_lines = 8;  ///< GPIO lines 0 to 7

  std::string payload;  ///< the node that owns it
  std::uint8_t can_address = 0;
  std::uint8_t power_line = 0;
  std::string bus = "can";  ///< that it is on

  friend bool operator==(const Peripheral&, const Peripheral&) = default;
};

}  // namespace srfs::suite
