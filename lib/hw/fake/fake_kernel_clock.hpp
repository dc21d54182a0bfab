// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "hw/kernel_clock.hpp"

namespace srfs::hw {

/// A kernel's clocks over an oscillator that the test turns: hardware time goes in, CLOCK_MONOTONIC comes
/// out.
class FakeKernelClock : public KernelClock {
 public:
  explicit FakeKernelClock(UtcTime realtime) : offset_(realtime.since_epoch()) {}

  /// Lets the oscillator count so many of its own nanoseconds.
  void advance(nanoseconds by) {
    monotonic_ += by + nanoseconds(std::llround(static_cast<double>(by.count()) * frequency_ppm_ * 1e-6));
  }
  [[nodiscard]] MonotonicTime monotonic() const { return monotonic_; }

  [[nodiscard]] UtcTime utc_at(MonotonicTime t) const override { return UtcTime(t.since_epoch() + offset_); }
  [[nodiscard]] double frequency_ppm() const override { return frequency_ppm_; }
  [[nodiscard]] Result<void, KernelClockError> set_frequency(double ppm) override {
    if (!permitted) return Err(KernelClockError::not_permitted);
    if (std::abs(ppm) > frequency_limit_ppm) return Err(KernelClockError::refused);
    frequency_ppm_ = ppm;
    return {};
  }
  [[nodiscard]] Result<void, KernelClockError> step(nanoseconds by) override {
    if (!permitted) return Err(KernelClockError::not_permitted);
    offset_ += by;
    ++steps;
    return {};
  }
  bool permitted = true;
  int steps = 0;

 private:
  MonotonicTime monotonic_;
  nanoseconds offset_;
  double frequency_ppm_ = 0;
};

}  // namespace srfs::hw
