// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "base/time.hpp"

namespace srfs {

/// Pulses that do not come where they are expected: do they follow each other by whole seconds? Forgives
/// some lost pulses and some false ones among them. Pure.
class PulseTrain {
 public:
  /// @return how many pulses agree by now, with this one
  int on_pulse(MonotonicTime edge, nanoseconds tolerance_per_s) {
    if (last_) {
      const nanoseconds gap = edge - *last_;
      const auto whole = (gap + milliseconds(500)) / seconds(1);
      const nanoseconds off = gap - seconds(whole);
      const nanoseconds tolerance = tolerance_per_s * whole;
      if (whole >= 1 && whole <= longest_gap_s && off <= tolerance && off >= -tolerance) {
        last_ = edge;
        strangers_ = 0;
        return ++agreeing_;
      }
      if (whole <= longest_gap_s && ++strangers_ <= strangers_max) return 0;
    }
    last_ = edge;
    agreeing_ = 1;
    strangers_ = 0;
    return agreeing_;
  }
  void forget() { *this = {}; }

 private:
  static constexpr int longest_gap_s = 5;
  static constexpr int strangers_max = 3;  // in a row; then the stranger begins a train

  std::optional<MonotonicTime> last_;
  int agreeing_ = 0;
  int strangers_ = 0;
};

}  // namespace srfs
