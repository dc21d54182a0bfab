// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include <ctime>

#include "base/time.hpp"

namespace srfs::hw {

/// Places a stamp of CLOCK_REALTIME that was taken a moment ago on CLOCK_MONOTONIC. nullopt when it lies more
/// than @p limit in the past, or in the future: the clock was stepped in between.
[[nodiscard]] inline std::optional<MonotonicTime> place_on_monotonic(UtcTime stamp,
                                                                     nanoseconds limit = seconds(1)) {
  const MonotonicTime before = monotonic_now();
  const UtcTime now = system_utc_now();
  const MonotonicTime after = monotonic_now();
  const nanoseconds age = now - stamp;
  if (age < nanoseconds(0) || age > limit) return std::nullopt;
  return before + (after - before) / 2 - age;
}

[[nodiscard]] inline UtcTime to_utc_time(const timespec& t) {
  return UtcTime(seconds(t.tv_sec) + nanoseconds(t.tv_nsec));
}

}  // namespace srfs::hw
