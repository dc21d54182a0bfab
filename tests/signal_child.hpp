// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>
#include <csignal>

namespace srfs::testing_support {

/// Signals one process that the test started. After a failed fork or start the pid is -1. kill(-1) would
/// signal every process on the computer, so the function then does nothing.
inline void signal_child(pid_t pid, int number) {
  if (pid > 0) kill(pid, number);
}

}  // namespace srfs::testing_support
