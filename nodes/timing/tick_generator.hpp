// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"

namespace srfs {

/// The seconds of the time reference as the monotonic clock sees them: second number `index` began at `edge`
/// and one second of the reference lasts `second_ns` nanoseconds of the monotonic clock (1e9 plus its drift).
struct SecondGrid {
  MonotonicTime edge;
  std::int64_t index =
      0;  ///< UTC second where it is known, else a running number: only its remainder matters
  double second_ns = 1e9;
};

/// One due tick.
struct Tick {
  MissionCycle cycle = 0;
  MonotonicTime due;
  nanoseconds late{0};  ///< wake-up minus due
  std::uint64_t skipped =
      0;  ///< ticks that fell due before this one and were not published; the cycle counts them
  nanoseconds phase_error{0};  ///< due minus the nearest point of the grid; zero while no grid is known
};

/// True for a period that divides the second or is a whole number of seconds, from 1 ms to 60 s.
[[nodiscard]] bool is_tick_period(nanoseconds period);

/// Says when the next tick is due. Ticks follow each other by the period, measured in seconds of the grid,
/// and are pulled to the grid's points by at most 1 % of the period a tick: while it corrects, and in any
/// other case but a missed wake-up, two due times lie 99 % to 101 % of the period apart (DESIGN: phase-locked
/// to the pulse). Without a grid, or with one that is no longer renewed, ticks go on at the last known rate.
/// Pure; one thread.
class TickGenerator {
 public:
  /// @param period       is_tick_period(period)
  /// @param first_cycle  number of the first tick
  /// @param first_due    when that is due
  TickGenerator(nanoseconds period, MissionCycle first_cycle, MonotonicTime first_due);

  /// The reference to follow from the next tick on.
  void follow(const SecondGrid& grid) { grid_ = grid; }

  /// @return the tick that is due, or nullopt when woken too early. However late the wake-up, one tick at
  /// most: the latest due; those before it are skipped and the cycle number jumps by them.
  [[nodiscard]] std::optional<Tick> on_wakeup(MonotonicTime now);

  [[nodiscard]] MonotonicTime next_due() const { return next_due_; }
  [[nodiscard]] MissionCycle next_cycle() const { return next_cycle_; }
  [[nodiscard]] nanoseconds period() const { return period_; }
  [[nodiscard]] std::uint64_t skipped_total() const { return skipped_total_; }

 private:
  [[nodiscard]] nanoseconds local_period() const;
  [[nodiscard]] nanoseconds phase_error(MonotonicTime due) const;
  [[nodiscard]] nanoseconds interval_after(MonotonicTime due) const;

  nanoseconds period_;
  MissionCycle next_cycle_;
  MonotonicTime next_due_;
  std::optional<SecondGrid> grid_;
  std::uint64_t skipped_total_ = 0;
};

}  // namespace srfs
