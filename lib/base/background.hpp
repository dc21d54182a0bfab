// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <map>
#include <optional>

#include "base/time.hpp"

namespace srfs {

/// Niceness of the session of a process that gives way, and of its threads where SCHED_IDLE could not be
/// taken back.
inline constexpr int background_niceness = 10;
/// Niceness of the session of a node that does not give way: the spacecraft's computer serves other programs
/// after it. Where the kernel permits it; it means nothing to threads with a real-time priority.
inline constexpr int flight_niceness = -8;
/// Niceness of the session of a node that starts, until its first transitions are done: a start needs a
/// quarter of a second of CPU time, and the suite lacks the node meanwhile.
inline constexpr int starting_niceness = -10;

// Of ioprio_set(2): the C library has no names for them, and linux/ioprio.h is no C++ in some versions of
// Debian 12's kernel headers.
inline constexpr int io_priority_of_one = 1;       ///< IOPRIO_WHO_PROCESS: of one thread
inline constexpr int io_priority_by_niceness = 0;  ///< IOPRIO_CLASS_NONE
inline constexpr int idle_io_priority = 3 << 13;   ///< IOPRIO_CLASS_IDLE

/// Puts the calling thread behind all others: SCHED_IDLE (sched(7)) and the idle I/O class (ioprio_set(2)),
/// which needs no permission. A thread that holds a lock there keeps it for as long as others want the CPUs,
/// so another thread must be able to lend it a CPU (CpuLoan). Without the permission for that
/// (RLIMIT_NICE of 20, or CAP_SYS_NICE) the thread takes background_niceness instead of SCHED_IDLE.
void enter_background();

/// It has put itself behind others: SCHED_IDLE, or a positive niceness. @param tid of a thread; false for one
/// that has ended
[[nodiscard]] bool is_behind_others(pid_t tid);

/// Gives the calling thread's turns this length (sched_setattr(2), sched_runtime; from Linux 6.12 on, without
/// effect before). On a busy CPU a thread that wakes up interrupts one with a longer turn at once, and any
/// other at the end of that one's turn. A thread with little to do asks for short turns to be early, one that
/// computes asks for them to hold no other up. Threads to come inherit it. Without effect on real-time
/// threads. Async-signal-safe.
/// @param turn  shortest_turn to 100 ms
void set_turn(nanoseconds turn);
inline constexpr microseconds shortest_turn{100};

/// A CPU for a process that has put itself, or some of its threads, behind others: while the loan lives, its
/// threads run under SCHED_OTHER with the loan's niceness, and so does its session. Needs the same user, and
/// RLIMIT_NICE of the other process or CAP_SYS_NICE; what is not permitted stays as it is.
class CpuLoan {
 public:
  /// Lends nothing yet. @param niceness of the lent CPU time, -20 to 0; 0 where that is not permitted
  explicit CpuLoan(pid_t pid, int niceness = 0);
  /// Gives back what it lent, when the process still lives. What its lender's end leaves lent, a background
  /// worker gives back at its next job.
  ~CpuLoan();
  CpuLoan(const CpuLoan&) = delete;
  CpuLoan& operator=(const CpuLoan&) = delete;

  /// Lends to all threads that are behind now, also to those that put themselves there since the last call.
  /// Some 5 us a thread. Blocks as /proc does.
  void lend();

 private:
  struct Thread {
    int policy;
    int niceness;
  };
  void lend_to(pid_t tid);

  pid_t pid_;
  int niceness_;
  std::optional<std::uint64_t> started_ticks_;
  std::map<pid_t, Thread> threads_;  ///< as they were; bounded
  std::optional<int> session_;       ///< its niceness before
};

}  // namespace srfs
