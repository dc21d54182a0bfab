// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "base/cpu_wait.hpp"
#include "base/time.hpp"

namespace srfs::sim {

struct RunningScale {};
/// Time in which hw_sim could do its work: time-outs against others are measured in it.
using RunningTime = TimePoint<RunningScale>;

/// CLOCK_MONOTONIC without the time in which one thread should have run and did not: it waited for a CPU, was
/// stopped, or the machine stood still. Time asleep with nothing to do counts. Never goes back. Pure.
class RunningClock {
 public:
  /// A later wake-up than this after its time is late; below it is the kernel's timer.
  static constexpr milliseconds tolerance{1};

  /// @param own  of the thread; its `ran` to the present (CLOCK_THREAD_CPUTIME_ID)
  RunningClock(MonotonicTime now, const ThreadCpu& own)
      : at_(now), counted_(own), waited_at_start_(own.waited) {}

  /// At each wake-up.
  /// @param now  not before the previous call
  /// @param own  read after @p now
  /// @param due  when the thread wanted to be woken at the latest; nullopt: whenever something comes
  void advance(MonotonicTime now, const ThreadCpu& own, std::optional<MonotonicTime> due);

  [[nodiscard]] RunningTime now() const { return RunningTime(at_.since_epoch() - lost_); }
  /// When this clock shows @p t, unless more is lost until then.
  [[nodiscard]] MonotonicTime earliest(RunningTime t) const { return MonotonicTime(t.since_epoch() + lost_); }
  /// All that the clock left out.
  [[nodiscard]] nanoseconds lost() const { return lost_; }
  /// The part of it that the kernel calls waiting for a CPU.
  [[nodiscard]] nanoseconds waited() const { return counted_.waited - waited_at_start_; }

 private:
  MonotonicTime at_;
  ThreadCpu counted_;
  nanoseconds waited_at_start_;
  nanoseconds lost_{0};
};

}  // namespace srfs::sim
