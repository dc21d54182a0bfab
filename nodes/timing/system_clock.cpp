// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/system_clock.hpp"

#include <algorithm>
#include <cmath>

namespace srfs {
namespace {

constexpr double slew_limit_ppm = 400;  // leaves room for the oscillator's own error
constexpr double resolution_ppm = 1e-4;

}  // namespace

double SystemClockDiscipline::follow(const ReferenceTime& reference, MonotonicTime now) {
  // Off by n nanoseconds, n ppb make good for it in a second, which is when the next call comes.
  const auto behind_ns = static_cast<double>((reference.utc_at(now) - kernel_->utc_at(now)).count());
  const double slew_ppm = std::clamp(behind_ns * 1e-3, -slew_limit_ppm, slew_limit_ppm);
  // The reference's rate is against the clock as it runs, the present correction included.
  const double present = kernel_->frequency_ppm();
  const double wanted =
      std::clamp(present + reference.rate_ppm + slew_ppm, -hw::KernelClock::frequency_limit_ppm,
                 hw::KernelClock::frequency_limit_ppm);
  if (std::abs(wanted - present) < resolution_ppm) return 0;
  if (!kernel_->set_frequency(wanted)) {
    ++refused_;
    return 0;
  }
  return wanted - present;
}

void SystemClockDiscipline::step_to(UtcTime utc, MonotonicTime now) {
  if (!kernel_->step(utc - kernel_->utc_at(now))) ++refused_;
}

}  // namespace srfs
