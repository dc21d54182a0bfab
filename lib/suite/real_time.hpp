// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/resource.h>

#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "base/time.hpp"
#include "suite/deployment.hpp"

namespace srfs::suite {

/// Whether a process may lock memory without bound, which locking what comes later needs: under a limit every
/// allocation beyond it would fail. Pure.
/// @param privileged  CAP_IPC_LOCK
/// @param limit       RLIMIT_MEMLOCK, in octets
/// @return why not, and the command that fixes it, ready to print
[[nodiscard]] std::optional<std::string> refusal_to_lock(bool privileged, rlim_t limit,
                                                         const std::string& user);

/// The command, for root, that gives a user's next login another limit (limits.conf(5)).
[[nodiscard]] std::string limit_command(const std::string& user, const std::string& item,
                                        const std::string& value);

/// Holds the memory of this process: what is loaded (program, libraries) is read in whole and stays; what
/// comes later (heap, stacks of threads) stays from its first use on, so that untouched stacks cost nothing.
/// Children do not inherit it. Blocks on the disk. @return why not, ready to print; then nothing is held
[[nodiscard]] Result<void, std::string> lock_memory();

/// Uses @p octets of the calling thread's stack once, at most half of what RLIMIT_STACK allows, so that the
/// kernel has given them when they are needed.
void touch_stack(std::size_t octets);

/// What of a scheduling this process was not given, each ready to print.
[[nodiscard]] std::vector<std::string> missing_of(const Scheduling& wanted);

/// How long a thread under SCHED_FIFO may compute without a pause before the kernel ends the process, which
/// would keep its CPU from all others (RLIMIT_RTTIME, SIGXCPU): at work; and while a node starts or changes
/// its state, when it reads dictionaries and keys, and the ring counts the time.
inline constexpr milliseconds real_time_at_work{500};
inline constexpr milliseconds real_time_in_transition{30'000};

/// Sets that bound for this process, whose launcher set one; without one, nothing. What the calling thread
/// computed before does not count.
void bound_real_time(milliseconds longest);

/// For the thread that works, before it does: arranges NodeEntry::memory. Without a permission the node runs
/// all the same; what it was not given is logged once.
void arrange_real_time(const NodeEntry& entry);

}  // namespace srfs::suite
