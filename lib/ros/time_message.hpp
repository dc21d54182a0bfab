// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <builtin_interfaces/msg/time.hpp>

#include "base/time.hpp"

namespace srfs::ros {

[[nodiscard]] inline builtin_interfaces::msg::Time to_message(UtcTime t) {
  const auto s = std::chrono::floor<seconds>(t.since_epoch());
  builtin_interfaces::msg::Time m;
  m.sec = static_cast<std::int32_t>(static_cast<std::uint32_t>(s.count()));  // from_message() undoes it
  m.nanosec = static_cast<std::uint32_t>((t.since_epoch() - s).count());
  return m;
}
/// The message's seconds have 32 bits: read without a sign they last from 1970 to 2106.
[[nodiscard]] inline UtcTime from_message(const builtin_interfaces::msg::Time& m) {
  return UtcTime(seconds(static_cast<std::uint32_t>(m.sec)) + nanoseconds(m.nanosec));
}

}  // namespace srfs::ros
