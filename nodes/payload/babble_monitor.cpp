// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/babble_monitor.hpp"

namespace srfs {

BabbleMonitor::Verdict BabbleMonitor::on_unsolicited_frame(MonotonicTime now) {
  frames_.add(now, settings_.forgiven_every);
  if (frames_.level() <= settings_.tolerated_frames) return Verdict::tolerable;

  frames_.empty();
  const bool again = judged_ && switched_on_ && now - *switched_on_ < settings_.at_once;
  in_a_row_ = again ? in_a_row_ + 1 : 0;
  judged_ = true;
  switched_on_.reset();
  return in_a_row_ >= settings_.power_cycles ? Verdict::keep_off : Verdict::power_cycle;
}

void BabbleMonitor::on_switched_on(MonotonicTime now) {
  frames_.empty();
  switched_on_ = now;
}

void BabbleMonitor::forgive() {
  frames_.empty();
  in_a_row_ = 0;
  judged_ = false;
}

}  // namespace srfs
