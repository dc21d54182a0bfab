// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <utility>
#include <vector>

#include "base/time.hpp"
#include "nodes/ttc/command/telecommand.hpp"
#include "nodes/ttc/report/report.hpp"

namespace srfs {

struct GateCounters {
  std::uint64_t passed = 0;
  std::uint64_t passed_undurable =
      0;                      ///< the disk failed or was too slow; only recovery commands are executed
  std::uint64_t refused = 0;  ///< more waiting than the capacity
};

/// Holds telecommands back until the journal that brings them back and excludes their repetition is on disk,
/// at most for a deadline; and in the same way the reports of their ends, or a crash could make another end.
/// Reports wait longer than telecommands: a slow disk delays them, and nothing waits for them on board.
/// One write at a time; it covers everything that came before it began.
class PersistenceGate {
 public:
  static constexpr std::size_t capacity = 64;
  /// More reports than this leave unsure, the oldest first.
  static constexpr std::size_t held_capacity = 256;
  /// Reports wait for so many deadlines.
  static constexpr int report_deadlines = 5;

  /// After a failed write the next one begins no sooner.
  static constexpr milliseconds retry_period{1000};

  /// @param durable generation that is on disk already
  explicit PersistenceGate(milliseconds deadline, std::uint64_t durable = 0)
      : deadline_(deadline), durable_(durable) {}

  /// @param generation of the journal with this one. @return false: full, it is dropped (counted)
  bool enter(JudgedTelecommand judged, std::uint64_t generation, MonotonicTime now);
  void refuse() { ++counters_.refused; }
  /// A report that must not leave before it is sure: the end of a telecommand, and what is reported after it.
  /// @param generation of the journal with this end
  void hold(Report report, std::uint64_t generation, MonotonicTime now);
  [[nodiscard]] bool has_room(std::size_t packets = 1) const { return waiting_.size() + packets <= capacity; }

  /// Whether a write may begin now.
  [[nodiscard]] bool may_write() const { return !writing_ && !retry_; }
  /// Whether a write of the journal with @p generation should begin now.
  [[nodiscard]] bool wants_write(std::uint64_t generation) const {
    return may_write() && generation > durable_;
  }
  void on_write_begun(std::uint64_t generation) { writing_ = generation; }
  /// The write ended. After a failure everything that waited for it passes as not durable.
  void on_write_done(bool success, MonotonicTime now);
  /// Lets what is past their deadline go, and the next write after a failed one.
  void on_time(MonotonicTime now);
  [[nodiscard]] std::optional<MonotonicTime> next_due() const;

  [[nodiscard]] std::vector<JudgedTelecommand> take_passed() { return std::exchange(passed_, {}); }
  struct Released {
    Report report;
    bool sure = true;  ///< false: after a crash there may be another end
  };
  /// Reports that may leave now, in their order.
  [[nodiscard]] std::vector<Released> take_released() { return std::exchange(released_, {}); }
  [[nodiscard]] const GateCounters& counters() const { return counters_; }

 private:
  struct Held {
    Report report;
    std::uint64_t generation = 0;
    MonotonicTime deadline;
  };
  void pass_front(bool durable);
  void release_front(bool sure);

  milliseconds deadline_;
  std::deque<JudgedTelecommand> waiting_;
  std::vector<JudgedTelecommand> passed_;
  std::deque<Held> held_;
  std::vector<Released> released_;
  std::uint64_t durable_;                 ///< generation on disk
  std::optional<std::uint64_t> writing_;  ///< generation of the write under way
  std::optional<MonotonicTime> retry_;    ///< no write before
  GateCounters counters_;
};

}  // namespace srfs
