// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace srfs::ros {

/// Names one goal of an action: a random UUID that the client chooses.
using GoalId = std::array<std::uint8_t, 16>;

/// States with the values of action_msgs/msg/GoalStatus. unknown is no state: there is no such goal.
enum class GoalState : std::int8_t {
  unknown = 0,
  accepted = 1,
  executing = 2,
  canceling = 3,
  succeeded = 4,
  canceled = 5,
  aborted = 6,
};

/// What makes a goal's state change.
enum class GoalEvent : std::uint8_t {
  execute,      ///< the server begins
  cancel_goal,  ///< the server granted a request to cancel; the work may still end any way
  succeed,
  abort,
  canceled,  ///< the work stopped because of the request
};

/// One row of the state table: in @p from, @p event leads to @p to.
struct GoalRow {
  GoalState from;
  GoalEvent event;
  GoalState to;
};

/// The whole state machine (rcl_action, goal_state_machine.c): every pair that is not here is refused.
[[nodiscard]] std::span<const GoalRow> goal_table();
/// @return the state this event leads to, nullopt when the pair is refused
[[nodiscard]] std::optional<GoalState> next_state(GoalState from, GoalEvent event);
/// succeeded, canceled, aborted.
[[nodiscard]] bool is_terminal(GoalState state);
/// accepted, executing, canceling.
[[nodiscard]] bool is_active(GoalState state);
/// accepted, executing: a goal that is being canceled cannot be canceled once more.
[[nodiscard]] bool is_cancelable(GoalState state);
[[nodiscard]] std::string_view label(GoalState state);
/// A status from the wire; unknown for a value that names no state.
[[nodiscard]] GoalState goal_state(std::int8_t status);

}  // namespace srfs::ros
