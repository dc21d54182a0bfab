// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "hw/gpio.hpp"

namespace srfs::hw {

/// Where a payload's peripheral is (docs/reference/icd_can.md).
struct Peripheral {
  std::string_view payload;  ///< the node that owns it
  std::uint8_t can_address;
  std::uint8_t power_line;
};
inline constexpr Peripheral adcs{"payload_adcs", 0x11, gpio_power_adcs};
inline constexpr Peripheral eps{"payload_eps", 0x12, gpio_power_eps};
inline constexpr Peripheral thermal{"payload_thermal", 0x13, gpio_power_thermal};
/// Flies from the start, its node does not: that one is added (examples/payload_impact).
inline constexpr Peripheral impact{"payload_impact", 0x14, gpio_power_impact};
inline constexpr std::array peripherals{adcs, eps, thermal, impact};

}  // namespace srfs::hw
