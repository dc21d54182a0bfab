// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "base/fd.hpp"
#include "base/time.hpp"

namespace srfs {

/// One process, by a pidfd: a later process that got the same number is never meant.
class Process {
 public:
  /// nullopt: there is no such process (any more).
  [[nodiscard]] static std::optional<Process> open(pid_t pid);

  [[nodiscard]] pid_t pid() const { return pid_; }
  /// Readable once the process has ended.
  [[nodiscard]] int fd() const { return fd_.get(); }
  /// @return 0 or errno
  int signal(int number) const;
  /// Blocks for at most @p patience. @return whether it has ended; a zombie has
  [[nodiscard]] bool wait_for_exit(nanoseconds patience) const;

 private:
  Process(pid_t pid, Fd fd) : pid_(pid), fd_(std::move(fd)) {}
  pid_t pid_;
  Fd fd_;
};

/// The kernel's id of this boot, 36 characters: monotonic times and pids of another one mean nothing.
/// nullopt: it cannot be read. Blocks for a moment.
[[nodiscard]] std::optional<std::string> kernel_boot_id();

/// What the kernel reports of a process' first thread: the letter of proc(5), 'R', 'S', 'D', 'T' (stopped),
/// 't' (held by a debugger), 'Z'...; nullopt: there is no such process.
[[nodiscard]] std::optional<char> process_state(pid_t pid);

/// Calls @p visit with the number of each thread that a process has now, until it returns false. Not at all
/// for a process that does not exist. Blocks as /proc does.
void for_each_thread(pid_t pid, const std::function<bool(pid_t tid)>& visit);

/// When it was started, in clock ticks since boot: with its number a name that no other process of this boot
/// has. nullopt: there is no such process.
[[nodiscard]] std::optional<std::uint64_t> process_start_ticks(pid_t pid);

/// Gives the session of this process a weight against others where the kernel groups tasks by session
/// (sched(7), "The autogroup feature"; Debian's does): there a thread's niceness and SCHED_IDLE count within
/// its session alone. For a process that leads its session. Async-signal-safe. @param nice -20 to 19
/// @param pid of the process, 0: the calling one. @return 0 or errno; 0 too where the kernel has no such
/// groups; EAGAIN: set without CAP_SYS_ADMIN within the last 100 ms
int set_session_niceness(int nice, pid_t pid = 0);
/// What was set. nullopt: no such process, or no such groups.
[[nodiscard]] std::optional<int> session_niceness(pid_t pid);

}  // namespace srfs
