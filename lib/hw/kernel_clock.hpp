// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::hw {

enum class KernelClockError : std::uint8_t {
  not_permitted,  ///< CAP_SYS_TIME is missing
  refused,        ///< a value out of the kernel's range
};
[[nodiscard]] const char* to_string(KernelClockError error);

/// CLOCK_REALTIME and the rate at which it and CLOCK_MONOTONIC run. Calls do not block.
class KernelClock {
 public:
  static constexpr double frequency_limit_ppm = 500;
  virtual ~KernelClock() = default;

  /// CLOCK_REALTIME at @p t of CLOCK_MONOTONIC, as it is set now.
  [[nodiscard]] virtual UtcTime utc_at(MonotonicTime t) const = 0;
  /// The correction in force; positive: both clocks run faster than the hardware's. As set, or as found
  /// at the start.
  [[nodiscard]] virtual double frequency_ppm() const = 0;
  /// @param ppm  within frequency_limit_ppm
  [[nodiscard]] virtual Result<void, KernelClockError> set_frequency(double ppm) = 0;
  /// Steps CLOCK_REALTIME; CLOCK_MONOTONIC stays.
  [[nodiscard]] virtual Result<void, KernelClockError> step(nanoseconds by) = 0;
};

}  // namespace srfs::hw
