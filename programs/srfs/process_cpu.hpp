// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <map>

#include "base/cpu_wait.hpp"

namespace srfs::tool {

/// CPU time of another process, from repeated readings of all its threads: at the start or end of a node any
/// of them may be the one that works. Nothing is known where the kernel does not report it.
class ProcessCpu {
 public:
  enum class From : std::uint8_t { start_of_the_process, first_reading };
  ProcessCpu(pid_t pid, From from) : pid_(pid), from_(from) {}

  [[nodiscard]] pid_t pid() const { return pid_; }
  /// Reads some files of /proc for each thread. @param now not before the previous call
  void read(MonotonicTime now);
  [[nodiscard]] nanoseconds ran() const;     ///< on a CPU, all threads together
  [[nodiscard]] nanoseconds waited() const;  ///< runnable without a CPU, the thread that waited longest

 private:
  struct Thread {
    ThreadCpuFiles files;
    CpuWait wait;
    ThreadCpu before;  ///< what does not count
    nanoseconds ran{0};
  };
  pid_t pid_;
  From from_;
  std::map<pid_t, Thread> threads_;  // also those that have ended
};

}  // namespace srfs::tool
