// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/time.hpp"

namespace srfs::bench {

using Json = nlohmann::ordered_json;

/// p50, p90, p99, max and the number of values; null without values.
[[nodiscard]] Json summary(std::vector<double> values);
/// Ratio of our value to the peer's for each quantile, and the spread (min, median, max) of the same ratio
/// over ten consecutive parts of the run. The spread shows the influence of the machine alone.
[[nodiscard]] Json ratio(const std::vector<double>& ours, const std::vector<double>& peer);

/// A child program. The destructor kills it if it still runs. Its output goes to @p log.
class Child {
 public:
  /// @throws std::runtime_error when it cannot be started
  Child(std::vector<std::string> command, const std::filesystem::path& log);
  ~Child();
  Child(Child&& other) noexcept;
  Child& operator=(Child&& other) noexcept;

  [[nodiscard]] pid_t pid() const { return pid_; }
  [[nodiscard]] MonotonicTime started() const { return started_; }
  /// Sends the signal and waits for the child's end; kills it after @p patience.
  void end(int signal, milliseconds patience = seconds(5));

 private:
  pid_t pid_ = -1;
  MonotonicTime started_;
};

/// Memory of a process in kB: private memory, and its share of memory that other processes map too.
struct Memory {
  double pss_kb = 0;
  double private_dirty_kb = 0;
};
[[nodiscard]] Memory memory_of(pid_t pid);
/// CPU time of all threads since the start, as counted by the scheduler.
[[nodiscard]] nanoseconds cpu_time_of(pid_t pid);
[[nodiscard]] std::size_t descriptors_of(pid_t pid);
[[nodiscard]] std::size_t threads_of(pid_t pid);
/// Paths below @p folder; only the direct entries if @p deep is false.
[[nodiscard]] std::vector<std::string> files_below(const std::filesystem::path& folder, bool deep);

/// Sets SCHED_FIFO for this process and all its new threads, like the launcher for a node.
/// @return the reason for failure; empty: done
[[nodiscard]] std::string set_fifo(int priority);
/// Pins all threads to one CPU, as a deployment does for a time-critical node.
void pin(int cpu);

}  // namespace srfs::bench
