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

/// p50, p90, p99, max and the number of values; null where there are none.
[[nodiscard]] Json summary(std::vector<double> values);
/// ours over the peer's for each of the quantiles, and the spread of the same ratio over ten parts of the
/// run, in order (min, median, max): how far the machine alone moves it.
[[nodiscard]] Json ratio(const std::vector<double>& ours, const std::vector<double>& peer);

/// A program that was started here; killed at the end if it still runs. Output goes to @p log.
class Child {
 public:
  /// @throws std::runtime_error when it cannot be started
  Child(std::vector<std::string> command, const std::filesystem::path& log);
  ~Child();
  Child(Child&& other) noexcept;
  Child& operator=(Child&& other) noexcept;

  [[nodiscard]] pid_t pid() const { return pid_; }
  [[nodiscard]] MonotonicTime started() const { return started_; }
  /// Sends the signal and waits for the end; after @p patience it is killed.
  void end(int signal, milliseconds patience = seconds(5));

 private:
  pid_t pid_ = -1;
  MonotonicTime started_;
};

/// Memory of a process, kB: what is its own and its share of what others map too.
struct Memory {
  double pss_kb = 0;
  double private_dirty_kb = 0;
};
[[nodiscard]] Memory memory_of(pid_t pid);
/// Time on a CPU of all threads since the start, as the scheduler counts it.
[[nodiscard]] nanoseconds cpu_time_of(pid_t pid);
[[nodiscard]] std::size_t descriptors_of(pid_t pid);
[[nodiscard]] std::size_t threads_of(pid_t pid);
/// Paths below @p folder; its own entries only where @p deep is false.
[[nodiscard]] std::vector<std::string> files_below(const std::filesystem::path& folder, bool deep);

/// This process and all threads it makes from now on, as the launcher does it for a node. @return why not
[[nodiscard]] std::string set_fifo(int priority);
/// All threads on one CPU, as a deployment pins a time-critical node.
void pin(int cpu);

}  // namespace srfs::bench
