// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "base/fd.hpp"
#include "base/time.hpp"

namespace srfs {

/// CPU time of one thread as the kernel counts it (proc(5), schedstat; needs CONFIG_SCHED_INFO).
struct ThreadCpu {
  nanoseconds ran{0};        ///< on a CPU
  nanoseconds waited{0};     ///< runnable without a CPU, up to its last arrival on one
  std::uint64_t stints = 0;  ///< arrivals on a CPU

  friend bool operator==(const ThreadCpu&, const ThreadCpu&) = default;
};

/// Parses the text of a schedstat file. nullopt: not of that form. Pure.
[[nodiscard]] std::optional<ThreadCpu> parse_schedstat(std::string_view text);

/// False: the kernel has the file and does not count (some builds without CONFIG_SCHEDSTATS write zeros).
/// Pure.
/// @param running  reading of a thread that has run: its own
[[nodiscard]] inline bool is_counted(const ThreadCpu& running) {
  return running.ran > nanoseconds(0) && running.stints > 0;
}

/// CPU accounting of one thread. The kernel ties the open files to the thread, so a later thread with the
/// same number is never read. Each reading costs about 1 us; no allocation after open().
class ThreadCpuFiles {
 public:
  /// @param tid  thread of @p pid; pid itself is its first thread. nullopt: no such thread, or a kernel
  /// without schedstat, or one that does not count (is_counted).
  [[nodiscard]] static std::optional<ThreadCpuFiles> open(pid_t pid, pid_t tid);
  /// Of the calling thread, which may be read by any thread afterwards.
  [[nodiscard]] static std::optional<ThreadCpuFiles> open_own();

  /// nullopt: the thread has ended.
  [[nodiscard]] std::optional<ThreadCpu> read() const;
  /// Letter of proc(5): 'R' runnable, on a CPU or waiting for one; 'S', 'D', 'T'... nullopt: it has ended.
  [[nodiscard]] std::optional<char> state() const;

 private:
  ThreadCpuFiles(Fd schedstat, Fd stat) : schedstat_(std::move(schedstat)), stat_(std::move(stat)) {}
  Fd schedstat_;
  Fd stat_;
};

/// Time that one thread spent runnable without a CPU, from repeated readings by another thread. The kernel
/// adds a wait only when it ends; one that goes on is recognised by a runnable thread, and counts from the
/// reading before, less what it ran since: what it slept in between is counted, too. A thread that sleeps,
/// is stopped, blocks in the kernel or runs at both readings does not wait. Pure.
class CpuWait {
 public:
  /// @param runnable  state 'R', read after @p cpu. Left false where @p cpu has changed, a wait that began
  ///                  since then counts from the next reading on.
  /// @param now       not before the previous call. Readings less than 20 ms apart that show no change are
  ///                  ignored: the time of a running thread grows only at the kernel's own ticks.
  void on_reading(const ThreadCpu& cpu, bool runnable, MonotonicTime now);

  /// Goes on from here: what was waited since the last reading, which may be long ago, is left out.
  void skip_to(const ThreadCpu& cpu, MonotonicTime now);

  /// All time waited since the first reading, as known at the last one. Never falls.
  [[nodiscard]] nanoseconds total() const { return total_; }
  /// False: the state need not be read for this one.
  [[nodiscard]] bool equals_last(const ThreadCpu& cpu) const { return last_ && cpu == *last_; }

 private:
  std::optional<ThreadCpu> last_;
  MonotonicTime last_at_;
  nanoseconds counted_{0};  ///< of the wait that goes on
  nanoseconds total_{0};
};

/// What a process has had of the CPU up to some time; each never falls.
struct CpuTotals {
  nanoseconds waited{0};      ///< its work thread: runnable without a CPU
  nanoseconds ran{0};         ///< its work thread: on a CPU
  nanoseconds any_waited{0};  ///< the same, and threads beside it that an answer may need
};

/// The totals at earlier times, for ages that shall not count what was waited. Pure; bounded: at most 128
/// points, the older ones farther apart.
class CpuHistory {
 public:
  /// @param now  not before the previous call
  void add(MonotonicTime now, const CpuTotals& totals);
  void clear() { points_.clear(); }
  /// What was added between @p since and the last point; of waits never more than that distance. Exact to the
  /// distance of two points: waits are rounded up, `ran` down.
  [[nodiscard]] CpuTotals since(MonotonicTime since) const;

 private:
  static constexpr std::size_t most_points = 128;
  struct Point {
    MonotonicTime at;
    CpuTotals totals{};
  };
  std::vector<Point> points_;
};

/// CPU time that the host of a virtual machine took, of the CPU it took most from; which thread lost it is
/// not known. Pure: takes the text of /proc/stat, in which CPUs that are offline are missing.
class StolenTime {
 public:
  /// @return the sum so far; ticks of 10 ms
  nanoseconds on_reading(std::string_view proc_stat);
  [[nodiscard]] nanoseconds total() const { return total_; }

 private:
  static constexpr std::size_t most_cpus = 1024;
  std::vector<std::optional<std::uint64_t>> last_;  // ticks, by the number of the CPU
  nanoseconds total_{0};
};

}  // namespace srfs
