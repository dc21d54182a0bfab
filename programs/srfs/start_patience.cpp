// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/start_patience.hpp"

#include <algorithm>

#include "base/cpu_users.hpp"

namespace srfs::tool {
namespace {

using ros::State;

/// On the way to Active; -1: on no such way.
int rank(State state) {
  switch (state) {
    case State::unknown:
      return 0;
    case State::unconfigured:
      return 1;
    case State::configuring:
      return 2;
    case State::inactive:
      return 3;
    case State::activating:
      return 4;
    case State::active:
      return 5;
    default:
      return -1;
  }
}

bool is_starting(State state) {
  return state == State::unknown || state == State::configuring || state == State::activating;
}

}  // namespace

nanoseconds patience_with_gone(bool ring, std::optional<double> pressure, nanoseconds deadline) {
  if (!ring) return nanoseconds(0);
  if (pressure.value_or(0) < busy_cpu_pressure) return patience_with_a_restart;
  return std::max<nanoseconds>(deadline, patience_with_a_restart);
}

bool StartPatience::makes_progress(const StartReading& reading) {
  if (reading.pid == 0) return false;
  Node& node = nodes_[reading.node];
  if (node.pid != reading.pid) {
    node.pid = reading.pid;
    node.cpu = node.waited = nanoseconds(0);
    if (++node.processes <= most_processes) node.furthest = -1;
  }
  const bool used = reading.cpu > node.cpu;
  node.cpu = std::max(node.cpu, reading.cpu);
  const int now = rank(reading.state);
  const bool further = now > node.furthest;
  node.furthest = std::max(node.furthest, now);
  return further || (used && now == node.furthest && is_starting(reading.state));
}

/// Call after makes_progress().
nanoseconds StartPatience::newly_waited(const StartReading& reading) {
  if (reading.pid == 0) return nanoseconds(0);
  Node& node = nodes_[reading.node];
  const nanoseconds before = node.waited;
  node.waited = std::max(node.waited, reading.waited);
  return node.waited - before;
}

void StartPatience::on_readings(const std::vector<StartReading>& awaited, MonotonicTime now) {
  bool progress = false;
  nanoseconds waited{0};
  for (const StartReading& reading : awaited) {
    progress = makes_progress(reading) || progress;
    waited = std::max(waited, newly_waited(reading));
  }
  const nanoseconds step = std::min<nanoseconds>(now - last_, longest_step);
  idle_ = progress ? nanoseconds(0) : idle_ + step - std::min(waited, step);
  last_ = now;
}

bool StartPatience::is_over() const {
  return idle_ >= deadline_ || last_ - begin_ >= most_deadlines * deadline_;
}

}  // namespace srfs::tool
