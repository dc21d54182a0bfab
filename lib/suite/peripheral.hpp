// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

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
  /// Identifiers of what it sends, where its protocol is its own: up to 7FF of 11 bits, others of 29. Empty:
  /// the ICD's.
  std::vector<std::uint32_t> answers = {};

  [[nodiscard]] bool sends(std::uint32_t id, bool extended) const {
    constexpr std::uint32_t to_computer = 0x18DA0100;  // docs/reference/icd_can.md, section 1
    constexpr std::uint32_t longest_standard = 0x7FF;
    if (answers.empty()) return extended && id == (to_computer | can_address);
    return extended == (id > longest_standard) &&
           std::find(answers.begin(), answers.end(), id) != answers.end();
  }

  friend bool operator==(const Peripheral&, const Peripheral&) = default;
};

}  // namespace srfs::suite
