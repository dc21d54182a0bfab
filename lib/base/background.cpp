// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/background.hpp"

#include <cstdint>

#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "base/process.hpp"

namespace srfs {
namespace {

constexpr std::size_t most_threads = 64;
constexpr int calling_thread = 0;

/// sched_setattr(2); the C library of Debian 12 has no name for it.
struct SchedulingAttributes {
  std::uint32_t size = sizeof(SchedulingAttributes);
  std::uint32_t policy = 0;
  std::uint64_t flags = 0;
  std::int32_t nice = 0;
  std::uint32_t priority = 0;
  std::uint64_t runtime_ns = 0;
  std::uint64_t deadline_ns = 0;
  std::uint64_t period_ns = 0;
};

/// The kernel asks for it when a thread leaves SCHED_IDLE (sched(7), "SCHED_IDLE").
bool can_leave_background() {
  constexpr rlim_t niceness_0 = 20;
  rlimit limit{};
  return geteuid() == 0 || (getrlimit(RLIMIT_NICE, &limit) == 0 && limit.rlim_cur >= niceness_0);
}

int policy_of(pid_t tid) {
  return sched_getscheduler(tid) & ~SCHED_RESET_ON_FORK;
}

/// Keeps its niceness and the length of its turns, unless @p turn says another. Nothing for a real-time
/// thread.
void change(pid_t tid, std::optional<int> policy, std::optional<nanoseconds> turn) {
  SchedulingAttributes now;
  if (syscall(SYS_sched_getattr, tid, &now, sizeof now, 0) != 0) return;
  if (now.policy != SCHED_OTHER && now.policy != SCHED_BATCH && now.policy != SCHED_IDLE) return;
  now.size = sizeof now;
  if (policy) now.policy = static_cast<std::uint32_t>(*policy);
  if (turn) now.runtime_ns = static_cast<std::uint64_t>(turn->count());
  (void)syscall(SYS_sched_setattr, tid, &now, 0);
}

bool set_niceness(pid_t tid, int niceness) {
  return setpriority(PRIO_PROCESS, static_cast<id_t>(tid), niceness) == 0;
}

int niceness_of(pid_t tid) {
  return getpriority(PRIO_PROCESS, static_cast<id_t>(tid));  // -1 too for a thread that has ended
}

}  // namespace

void enter_background() {
  if (policy_of(calling_thread) == SCHED_IDLE) return;
  (void)syscall(SYS_ioprio_set, io_priority_of_one, calling_thread, idle_io_priority);
  const bool idle = can_leave_background();
  if (!idle) (void)set_niceness(calling_thread, background_niceness);
  change(calling_thread, idle ? std::optional(SCHED_IDLE) : std::nullopt, shortest_turn);
}

bool is_behind_others(pid_t tid) {
  return policy_of(tid) == SCHED_IDLE || niceness_of(tid) > 0;
}

void set_turn(nanoseconds turn) {
  change(calling_thread, std::nullopt, turn);
}

CpuLoan::CpuLoan(pid_t pid, int niceness)
    : pid_(pid), niceness_(niceness), started_ticks_(process_start_ticks(pid)) {}

void CpuLoan::lend() {
  if (!started_ticks_ || process_start_ticks(pid_) != started_ticks_) return;  // or a stranger has its number
  for_each_thread(pid_, [this](pid_t tid) {
    lend_to(tid);
    return true;
  });
  const auto niceness = session_niceness(pid_);
  if (!niceness || *niceness <= niceness_) return;
  const bool lent = set_session_niceness(niceness_, pid_) == 0 ||
                    (niceness_ < 0 && *niceness > 0 && set_session_niceness(0, pid_) == 0);
  if (lent && !session_) session_ = niceness;
}

void CpuLoan::lend_to(pid_t tid) {
  const int policy = policy_of(tid);
  if (policy != SCHED_OTHER && policy != SCHED_BATCH && policy != SCHED_IDLE) return;  // or it has ended
  const int niceness = niceness_of(tid);
  if (policy != SCHED_IDLE && niceness <= niceness_) return;
  if (!threads_.contains(tid) && threads_.size() < most_threads) threads_[tid] = {policy, niceness};
  if (!set_niceness(tid, niceness_) && niceness > 0) (void)set_niceness(tid, 0);
  if (policy == SCHED_IDLE) change(tid, SCHED_OTHER, std::nullopt);
}

CpuLoan::~CpuLoan() {
  if (!started_ticks_ || process_start_ticks(pid_) != started_ticks_) return;
  for (const auto& [tid, before] : threads_) {
    (void)set_niceness(tid, before.niceness);
    if (before.policy == SCHED_IDLE) change(tid, SCHED_IDLE, std::nullopt);
  }
  if (session_) (void)set_session_niceness(*session_, pid_);
}

}  // namespace srfs
