// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <map>
#include <optional>

#include "base/cpu_wait.hpp"
#include "base/time.hpp"

namespace srfs::suite {

/// What a node's process has had of the CPU, read from outside or by itself: its work thread (the first one),
/// and in doubt the threads of the middleware, which carry its program's name, too. Workers have names of
/// their own and do not count: what they wait for keeps no answer. One thread at a time.
class ProcessCpu {
 public:
  /// nullopt: no such process, or a kernel that does not tell.
  [[nodiscard]] static std::optional<ProcessCpu> open(pid_t pid);

  /// @param doubt  read the threads of the middleware, too: some 10 us more
  /// @return totals since the first call; nullopt: the process has ended
  [[nodiscard]] std::optional<CpuTotals> read(bool doubt, MonotonicTime now);
  /// How many of its threads compute: used a CPU or waited for one all the time since the call before, and
  /// ran for 10 ms or more without a pause; without those that have put themselves behind others. To be
  /// called each second or so; some 50 us. Blocks as /proc does.
  [[nodiscard]] std::size_t count_busy_threads(MonotonicTime now);
  /// Its work thread, or one of the middleware that a read() in doubt has found, runs now or waits for a CPU.
  [[nodiscard]] bool is_runnable() const;

 private:
  struct Counted {
    ThreadCpu cpu;
    nanoseconds waited;
  };
  /// Since the thread last gave its CPU back of its own will, as far as it was seen.
  struct Stint {
    std::uint64_t yields;
    nanoseconds begin;  ///< CPU time of the thread then
  };
  struct Thread {
    ThreadCpuFiles files;
    CpuWait wait;
    bool of_middleware = true;
    // Of count_busy_threads() alone: a doubt begins and ends, and leaves out what was waited before it.
    CpuWait counted_wait{};
    std::optional<Counted> counted{};  ///< at the last one
    std::optional<Stint> stint{};      ///< unless it was idle
  };
  ProcessCpu(pid_t pid, ThreadCpuFiles first) : pid_(pid), first_{std::move(first), {}, false} {}
  static std::optional<ThreadCpu> read_thread(const ThreadCpuFiles& files, CpuWait& wait, bool doubt,
                                              MonotonicTime now);
  static std::optional<ThreadCpu> skip(Thread& thread, MonotonicTime now);
  nanoseconds read_middleware(MonotonicTime now);
  void find_threads(MonotonicTime now);
  [[nodiscard]] bool computes(pid_t tid, Thread& thread, const ThreadCpu& cpu, nanoseconds elapsed) const;
  [[nodiscard]] std::optional<std::uint64_t> count_yields(pid_t tid) const;

  pid_t pid_;
  Thread first_;
  std::map<pid_t, Thread> others_;
  MonotonicTime found_;
  MonotonicTime doubted_;
  std::optional<MonotonicTime> counted_at_;
  nanoseconds middleware_waited_{0};
};

}  // namespace srfs::suite
