// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "base/time.hpp"

namespace srfs::hw {

/// When to try to bring a controller back that is bus-off. The first try waits for the interface's own
/// restart; then ever longer up to a bound, never giving up. A controller that goes bus-off again soon after
/// it came back goes on where the waiting was. Pure.
class CanRestart {
 public:
  static constexpr nanoseconds first_wait = milliseconds(100);
  static constexpr nanoseconds longest_wait = seconds(5);
  static constexpr nanoseconds healthy_after = seconds(10);  ///< then the next bus-off begins anew

  /// Repeated calls change nothing.
  void on_bus_off(MonotonicTime now);
  void on_recovered(MonotonicTime now);
  /// A try was made, whatever came of it.
  void on_attempt(MonotonicTime now);
  /// nullopt: not bus-off.
  [[nodiscard]] std::optional<MonotonicTime> next_attempt() const { return next_; }
  [[nodiscard]] bool due(MonotonicTime now) const { return next_ && now >= *next_; }

 private:
  void schedule(MonotonicTime now);

  nanoseconds wait_ = first_wait;
  std::optional<MonotonicTime> next_;
  std::optional<MonotonicTime> recovered_;
};

}  // namespace srfs::hw
