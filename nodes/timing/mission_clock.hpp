// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include "nodes/timing/disciplined_clock.hpp"

namespace srfs {

/// A clock beside the system clock: continuous pieces of straight lines over CLOCK_MONOTONIC, each at a rate
/// between 1 - 0.0055 and 1 + 0.0055. Left alone it ends its slew and goes on at the reference's rate.
class MissionClock : public DisciplinedClock {
 public:
  static constexpr double slew_limit_ppm = 5000;  ///< one second is slewed in 200 s
  static constexpr double rate_limit_ppm = 500;   ///< of a reference

  MissionClock(UtcTime utc, MonotonicTime now);

  /// In the pieces of the past that are still held (the last eight): the time it gave then.
  [[nodiscard]] UtcTime utc_at(MonotonicTime t) const override;
  double follow(const ReferenceTime& reference, MonotonicTime now) override;
  void step_to(UtcTime utc, MonotonicTime now) override;

 private:
  struct Piece {
    MonotonicTime start;
    UtcTime utc;
    double rate_ppm = 0;
    double slew_ppm = 0;  ///< on top, for...
    nanoseconds slew_time{0};
    [[nodiscard]] UtcTime utc_at(MonotonicTime t) const;
  };
  static constexpr std::size_t pieces_held = 8;

  std::array<Piece, pieces_held> pieces_;  // the newest first
  std::size_t count_ = 1;
};

}  // namespace srfs
