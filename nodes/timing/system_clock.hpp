// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "hw/kernel_clock.hpp"
#include "nodes/timing/disciplined_clock.hpp"

namespace srfs {

/// Slews CLOCK_REALTIME by its frequency, so that it serves every process of the computer. CLOCK_MONOTONIC
/// runs at the same rate and comes to tick true seconds. What is left of a slew when calls cease goes on.
class SystemClockDiscipline : public DisciplinedClock {
 public:
  explicit SystemClockDiscipline(hw::KernelClock& kernel) : kernel_(&kernel) {}

  [[nodiscard]] UtcTime utc_at(MonotonicTime t) const override { return kernel_->utc_at(t); }
  double follow(const ReferenceTime& reference, MonotonicTime now) override;
  void step_to(UtcTime utc, MonotonicTime now) override;
  /// Settings the kernel did not take.
  [[nodiscard]] std::uint64_t refused() const { return refused_; }

 private:
  hw::KernelClock* kernel_;
  std::uint64_t refused_ = 0;
};

}  // namespace srfs
