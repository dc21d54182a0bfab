// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"
#include "ros/goal_state.hpp"

namespace srfs::ros {

/// Why a goal ended at its client without a result.
enum class GoalError : std::uint8_t {
  no_server,     ///< no server of the action within the deadline; the goal was not sent
  unanswered,    ///< sent, but the server did not answer whether it accepts
  refused,       ///< the goal breaks a bound of its type, or too many goals are under way here
  rejected,      ///< by the server
  server_lost,   ///< the server that accepted it is gone; how far it came is not known
  unknown_goal,  ///< the server does not know it: it started anew, or the result expired
  result_late,   ///< no result within its deadline
  result_lost,   ///< the server reports the end of the goal but does not hand out the result
};
[[nodiscard]] const char* to_text(GoalError error);

struct GoalDeadlines {
  nanoseconds response = seconds(1);  ///< for one attempt to send the goal, and for one to cancel it
  int attempts = 3;                   ///< our servers take a repeated goal for what it is; rclcpp's need 1
  nanoseconds result = seconds(60);   ///< from acceptance to the result
  bool cancel_when_late = true;       ///< a goal past its result deadline gets a cancel request
};

/// What a client knows of one goal: a pure state machine. Every on_... returns what has to be done now.
/// Never reads a clock.
class GoalTracker {
 public:
  struct Step {
    bool request_result = false;  ///< ask for the result (again)
    bool request_cancel = false;
    std::optional<GoalError> failed;    ///< the goal is over for this client
    std::optional<GoalState> finished;  ///< it ended with the result just given to on_result
  };
  /// How long a lost server's last words are waited for: they may be queued behind the news of its end.
  static constexpr milliseconds farewell{200};
  /// How long after the status topic says that a goal ended its result is waited for before it is asked for
  /// again.
  static constexpr seconds result_patience{1};
  static constexpr int most_result_requests = 4;

  explicit GoalTracker(const GoalDeadlines& deadlines) : deadlines_(deadlines) {}

  Step on_send_failed(GoalError error);
  Step on_response(bool accepted, MonotonicTime now);
  /// News from the status topic.
  Step on_status(GoalState state, MonotonicTime now);
  /// The server's answer to a request for the result.
  Step on_result(GoalState state);
  /// The server that accepted the goal is matched, or is not.
  Step on_server(bool present, MonotonicTime now);
  /// The user wants it canceled; sent when the server has accepted the goal.
  Step on_cancel_wanted();
  /// Call at or after next_deadline().
  Step on_time(MonotonicTime now);
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const;

  [[nodiscard]] GoalState state() const { return state_; }
  [[nodiscard]] bool is_over() const { return phase_ == Phase::over; }
  [[nodiscard]] bool is_accepted() const { return phase_ == Phase::accepted; }

 private:
  enum class Phase : std::uint8_t { sending, accepted, over };
  Step fail(GoalError error);

  GoalDeadlines deadlines_;
  Phase phase_ = Phase::sending;
  GoalState state_ = GoalState::unknown;
  bool cancel_wanted_ = false;
  int result_requests_ = 0;
  MonotonicTime result_due_;
  std::optional<MonotonicTime> ask_again_at_;  // the status topic reported its end
  std::optional<MonotonicTime> give_up_at_;    // the server is gone
};

}  // namespace srfs::ros
