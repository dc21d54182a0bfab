// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <deque>
#include <optional>
#include <string>
#include <string_view>

#include "base/latency_histogram.hpp"
#include "base/time.hpp"

namespace srfs::ros {

/// What calls a callback; values of srfs_msgs/msg/CallbackStatistics.
enum class CallbackKind : std::uint8_t {
  timer = 1,
  subscription = 2,
  service = 3,
  client = 4,
  descriptor = 5,
  posted = 6,
  transition = 7,
  other = 8,
};
/// "timer", "subscription"...
[[nodiscard]] std::string_view to_text(CallbackKind kind);

/// What is known of one callback by its name.
struct CallbackRecord {
  CallbackKind kind;
  std::string name;                   ///< topic, service, or the name given to a timer or descriptor
  std::optional<nanoseconds> budget;  ///< its own; else that of its kind
  LatencyHistogram run_time;
  nanoseconds total{0};
  std::uint64_t over_budget = 0;
  std::uint64_t failed = 0;          ///< ended by an exception
  std::uint64_t missed_periods = 0;  ///< of a timer
  MonotonicTime next_report;         ///< not before this is it reported over budget again
};

/// Run times of the callbacks of one work thread. Pure: time passed in; of the work thread alone. Memory:
/// 0.8 KiB a name, at most 128 names; later ones are counted together as "(others)". Counting takes no memory
/// and no clock.
class CallbackStatistics {
 public:
  static constexpr std::size_t most_names = 128;
  static constexpr nanoseconds report_period = seconds(10);  ///< of one callback over budget

  /// The record of this name, made when new. Valid as long as the statistics.
  CallbackRecord& record(CallbackKind kind, std::string_view name);

  /// Budget of all records of a kind that have none of their own. 20 ms unless set.
  void set_budget(CallbackKind kind, nanoseconds budget);
  [[nodiscard]] nanoseconds budget(const CallbackRecord& record) const;

  /// Counts one run that ended at @p now.
  /// @return true when it was over its budget and this was not reported in the last 10 s
  bool add(CallbackRecord& record, nanoseconds took, MonotonicTime now);

  [[nodiscard]] const std::deque<CallbackRecord>& records() const { return records_; }
  /// All callbacks together, without transitions, which are parts of others.
  [[nodiscard]] const LatencyHistogram& all() const { return all_; }
  [[nodiscard]] nanoseconds busy() const { return busy_; }
  [[nodiscard]] std::uint64_t over_budget() const { return over_budget_; }

  /// The longest run since the last call, with its name; nullptr when nothing ran.
  struct Longest {
    const CallbackRecord* record = nullptr;
    nanoseconds took{0};
  };
  Longest take_longest();

  /// Run times and counters start anew; names, budgets and all() stay.
  void reset();

 private:
  std::deque<CallbackRecord> records_;  // never shrinks, so that records keep their place
  std::array<nanoseconds, 9> budgets_{milliseconds(20), milliseconds(20), milliseconds(20),
                                      milliseconds(20), milliseconds(20), milliseconds(20),
                                      milliseconds(20), milliseconds(20), milliseconds(20)};
  LatencyHistogram all_;
  nanoseconds busy_{0};
  std::uint64_t over_budget_ = 0;
  Longest longest_;
};

}  // namespace srfs::ros
