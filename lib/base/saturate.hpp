// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "base/time.hpp"

namespace srfs {

/// For 32-bit fields of telemetry and messages: the nearest value that fits.

[[nodiscard]] constexpr std::uint32_t as_u32(std::uint64_t value) {
  return static_cast<std::uint32_t>(
      std::min<std::uint64_t>(value, std::numeric_limits<std::uint32_t>::max()));
}
/// Whole microseconds.
[[nodiscard]] constexpr std::uint32_t as_us(nanoseconds d) {
  return as_u32(static_cast<std::uint64_t>(std::max<std::int64_t>(d / microseconds(1), 0)));
}
/// Whole milliseconds.
[[nodiscard]] constexpr std::uint32_t as_ms(nanoseconds d) {
  return as_u32(static_cast<std::uint64_t>(std::max<std::int64_t>(d / milliseconds(1), 0)));
}

}  // namespace srfs
