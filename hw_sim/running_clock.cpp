// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/running_clock.hpp"

#include <algorithm>

namespace srfs::sim {

void RunningClock::advance(MonotonicTime now, const ThreadCpu& own, std::optional<MonotonicTime> due) {
  // Below zero: the kernel's account could not be read this time.
  const nanoseconds waited = std::max(own.waited - counted_.waited, nanoseconds(0));
  nanoseconds lost = waited;
  if (due) {
    // Work that lasts beyond the time of the next wake-up is no lateness, as long as it has a CPU.
    const MonotonicTime expected = std::max(*due, at_ + (own.ran - counted_.ran));
    if (now - expected > tolerance) lost = std::max(lost, now - expected);
  }
  lost = std::min(lost, now - at_);  // a wait between the readings counts the next time
  lost_ += lost;
  at_ = now;
  counted_.ran = own.ran;
  counted_.waited += std::min(waited, lost);
}

}  // namespace srfs::sim
