// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/time.hpp"

namespace srfs {

/// What is known of true time: at `at` it is `utc`, and it runs on by `rate_ppm` faster than CLOCK_MONOTONIC.
struct ReferenceTime {
  MonotonicTime at;
  UtcTime utc;
  double rate_ppm = 0;
  [[nodiscard]] UtcTime utc_at(MonotonicTime t) const;
};

/// The time the mission is given. There are two of it: MissionClock beside the system clock, and
/// SystemClockDiscipline, which slews that. One thread.
class DisciplinedClock {
 public:
  virtual ~DisciplinedClock() = default;

  [[nodiscard]] virtual UtcTime utc_at(MonotonicTime t) const = 0;
  /// Slews towards @p reference, never steps: whatever it is called with, the time goes on, at a rate that
  /// stays near one. To call once a second and at each correction, with a @p now that no utc_at() went
  /// beyond.
  /// @return by how many ppm CLOCK_MONOTONIC itself runs faster than before this call
  virtual double follow(const ReferenceTime& reference, MonotonicTime now) = 0;
  /// The only step, forward or back: at the first setting, and by command.
  virtual void step_to(UtcTime utc, MonotonicTime now) = 0;
};

}  // namespace srfs
