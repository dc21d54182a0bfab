// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "ros/lifecycle.hpp"

namespace srfs::tool {

/// What one node looks like at one moment of its start.
struct StartReading {
  std::string node;
  pid_t pid = 0;                           ///< 0: it does not run
  ros::State state = ros::State::unknown;  ///< by its heartbeat page; unknown: it has made no turn yet
  nanoseconds cpu{0};     ///< that it used or waited for since its start; never falls while the pid stays
  nanoseconds waited{0};  ///< of it: waited for; never falls while the pid stays
};

/// For a restart by a neighbour, of a node that ended a moment ago.
inline constexpr seconds patience_with_a_restart{4};

/// For how long an awaited node may be gone before its start has failed. Without a ring it is not restarted.
/// With a ring its neighbours restart it, at once on a calm machine. Under pressure starts are spaced, and
/// the starter itself waits for a CPU. Pure.
/// @param pressure  cpu_pressure(); nullopt: the kernel does not report it
/// @param deadline  of the start, without progress
[[nodiscard]] nanoseconds patience_with_gone(bool ring, std::optional<double> pressure, nanoseconds deadline);

/// How long `srfs up` waits: as long as one of the awaited nodes makes progress. That is a lifecycle state
/// further than any before; or CPU time used or waited for while the node loads (no turn yet) or a transition
/// towards Active runs, in the furthest state so far. So a node that fails to configure and tries again makes
/// none; a process that replaces another begins anew, twice. Time that an awaited node waits for a CPU is not
/// idle either. Pure.
class StartPatience {
 public:
  /// @param deadline  without any progress; ten times as long with it
  StartPatience(nanoseconds deadline, MonotonicTime now) : deadline_(deadline), begin_(now), last_(now) {}

  /// @param awaited  nodes that are not there yet
  /// @param now      not before the previous call
  void on_readings(const std::vector<StartReading>& awaited, MonotonicTime now);
  [[nodiscard]] bool is_over() const;
  /// Time in which no node made progress, since one did.
  [[nodiscard]] nanoseconds idle() const { return idle_; }

 private:
  static constexpr int most_deadlines = 10;
  static constexpr int most_processes = 3;
  /// A longer time between two readings is this program's own wait for a CPU.
  static constexpr milliseconds longest_step{1000};
  struct Node {
    pid_t pid = 0;
    int processes = 0;
    int furthest = -1;
    nanoseconds cpu{0};
    nanoseconds waited{0};
  };
  bool makes_progress(const StartReading& reading);
  nanoseconds newly_waited(const StartReading& reading);

  nanoseconds deadline_;
  MonotonicTime begin_;
  MonotonicTime last_;
  nanoseconds idle_{0};
  std::map<std::string, Node> nodes_;
};

}  // namespace srfs::tool
