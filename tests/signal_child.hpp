// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>
#include <csignal>

namespace srfs::testing_support {

/// Signals one process that the test started. A failed fork or a process that never came up is -1, and
/// kill(-1) would reach everything on the machine: nobody is signalled then.
inline void signal_child(pid_t pid, int number) {
  if (pid > 0) kill(pid, number);
}

}  // namespace srfs::testing_support
