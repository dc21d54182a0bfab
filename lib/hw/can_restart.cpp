// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw/can_restart.hpp"

#include <algorithm>

namespace srfs::hw {

void CanRestart::on_bus_off(MonotonicTime now) {
  if (next_) return;
  if (recovered_ && now - *recovered_ >= healthy_after) wait_ = first_wait;
  schedule(now);
}

void CanRestart::on_recovered(MonotonicTime now) {
  if (!next_) return;
  next_.reset();
  recovered_ = now;
}

void CanRestart::on_attempt(MonotonicTime now) {
  if (next_) schedule(now);
}

void CanRestart::schedule(MonotonicTime now) {
  next_ = now + wait_;
  wait_ = std::min(2 * wait_, longest_wait);
}

}  // namespace srfs::hw
