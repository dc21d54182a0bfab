// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "hw_sim/running_clock.hpp"

namespace srfs::sim {

/// When a watchdog bites: armed by the first feed, disarmed by the sign 'V', and disarmed after it has bitten
/// until the restarted computer feeds it. Pure.
class StarvationTimer {
 public:
  explicit StarvationTimer(milliseconds timeout) : timeout_(timeout) {}

  void feed(RunningTime now) {
    ++feeds_;
    deadline_ = now + timeout_;
  }
  /// Bites after another time-out unless fed: the computer did not come up.
  void rearm(RunningTime now) { deadline_ = now + timeout_; }
  void disarm() { deadline_.reset(); }
  /// @return true once, when it has starved
  [[nodiscard]] bool bites(RunningTime now) {
    if (!deadline_ || now < *deadline_) return false;
    deadline_.reset();
    ++bites_;
    return true;
  }
  [[nodiscard]] std::optional<RunningTime> deadline() const { return deadline_; }
  [[nodiscard]] milliseconds timeout() const { return timeout_; }
  [[nodiscard]] std::uint64_t feeds() const { return feeds_; }
  [[nodiscard]] std::uint64_t bite_count() const { return bites_; }

 private:
  milliseconds timeout_;
  std::optional<RunningTime> deadline_;
  std::uint64_t feeds_ = 0;
  std::uint64_t bites_ = 0;
};

}  // namespace srfs::sim
