// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/cpu_priority.hpp"

#include <cerrno>

#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include "base/background.hpp"
#include "base/process.hpp"

namespace srfs::sim {

int put_before_the_tested() {
  if (sched_getscheduler(0) != SCHED_OTHER)
    return 0;  // started with a better policy, or a worse one on purpose
  const sched_param none{};
  // The flag first: the watchdog's restart command must never inherit the niceness.
  const bool raised = sched_setscheduler(0, SCHED_OTHER | SCHED_RESET_ON_FORK, &none) == 0 &&
                      setpriority(PRIO_PROCESS, 0, hardware_niceness) == 0;
  const int error = raised ? 0 : errno;
  set_turn(shortest_turn);
  if (!raised) return error;
  return getsid(0) == getpid() ? set_session_niceness(hardware_niceness) : 0;
}

}  // namespace srfs::sim
