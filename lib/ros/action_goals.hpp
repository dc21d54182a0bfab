// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "base/time.hpp"
#include "ros/goal_state.hpp"

namespace srfs::ros {

/// The client that sent a goal, as the middleware names it (a GUID).
using GoalClient = std::array<std::uint8_t, 16>;

struct GoalLimits {
  std::size_t active = 8;    ///< goals at a time; further ones are rejected
  std::size_t results = 32;  ///< results kept, at least 1; the oldest makes room before its time
  nanoseconds result_timeout = std::chrono::minutes(15);  ///< how long a result is kept; rcl_action's default
};

/// Counts since the server was made.
struct GoalCounters {
  std::uint64_t accepted = 0;
  std::uint64_t rejected_full = 0;       ///< too many goals at a time
  std::uint64_t rejected_duplicate = 0;  ///< the id names a goal of now or before
  std::uint64_t rejected_by_server = 0;  ///< the server's own decision
  std::uint64_t refused_events = 0;      ///< events the goal's state does not allow
  std::uint64_t expired = 0;             ///< results dropped at the end of their time
  std::uint64_t evicted = 0;             ///< results dropped before, to make room
};

/// An action server's memory of its goals: states, the waiters for each result, results with their expiry.
/// Pure: never reads a clock. Not thread-safe. Semantics are rcl_action's (action_server.c).
class ActionGoals {
 public:
  /// Names a request that waits for a goal's end; what it means is the caller's business.
  using Waiter = std::uint64_t;
  using ResultPointer = std::shared_ptr<const void>;

  struct Goal {
    GoalId id;
    UtcTime stamp;  ///< of acceptance
    GoalState state;
  };
  enum class Admission : std::uint8_t { open, duplicate, full };
  /// Which goals a request to cancel means.
  struct CancelScope {
    std::int8_t return_code;  ///< action_msgs/srv/CancelGoal
    std::vector<Goal> goals;
  };

  explicit ActionGoals(const GoalLimits& limits) : limits_(limits) {}

  /// May a goal of this id be accepted? Counts a refusal.
  [[nodiscard]] Admission admit(const GoalId& id);
  /// Enters a goal in state accepted. @pre admit() said open
  void accept(const GoalId& id, const GoalClient& client, UtcTime stamp);
  void count_rejection() { ++counters_.rejected_by_server; }
  /// @param result kept when the event ends the goal; may be null
  /// @return whether the goal is known and its state allows the event; a refusal is counted
  bool apply(const GoalId& id, GoalEvent event, MonotonicTime now, ResultPointer result = nullptr);
  /// unknown for a goal that never was, or whose result expired.
  [[nodiscard]] GoalState state(const GoalId& id) const;
  [[nodiscard]] ResultPointer result(const GoalId& id) const;

  /// Which goals to cancel: all (id and stamp zero), one (stamp zero), or those accepted at or before the
  /// stamp and the one of the id (action_msgs/srv/CancelGoal).
  [[nodiscard]] CancelScope cancel_scope(const GoalId& id, UtcTime stamp) const;

  /// Remembers a waiter for the result of a goal that runs. @return false when it does not run
  bool await_result(const GoalId& id, Waiter waiter);
  /// The waiters of a goal, which are forgotten.
  [[nodiscard]] std::vector<Waiter> take_waiters(const GoalId& id);
  void forget_waiter(Waiter waiter);

  /// Drops results whose time is over. @return how many
  std::size_t expire(MonotonicTime now);
  /// When expire() has work next; nullopt while no result is kept.
  [[nodiscard]] std::optional<MonotonicTime> next_expiry() const;

  /// All goals and kept results in order of acceptance, for the status topic.
  [[nodiscard]] std::vector<Goal> goals() const;
  /// Running goals whose client was within reach and is not any more; each is named once.
  [[nodiscard]] std::vector<GoalId> orphans(const std::function<bool(const GoalClient&)>& within_reach);
  [[nodiscard]] const GoalCounters& counters() const { return counters_; }

 private:
  struct Entry {
    Goal goal;
    GoalClient client;
    bool client_seen = false;
    bool orphaned = false;
    MonotonicTime ended_at;  // when terminal
    ResultPointer result;
    std::vector<Waiter> waiters;
  };
  [[nodiscard]] const Entry* find(const GoalId& id) const;
  [[nodiscard]] Entry* find(const GoalId& id);
  void make_room_for_results(const GoalId& just_ended);

  GoalLimits limits_;
  std::vector<Entry> entries_;  // in order of acceptance; at most active + results
  GoalCounters counters_;
};

}  // namespace srfs::ros
