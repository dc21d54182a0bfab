// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace srfs::ros {

/// States with the ids of lifecycle_msgs/msg/State: four primary states and six transition states.
enum class State : std::uint8_t {
  unknown = 0,
  unconfigured = 1,
  inactive = 2,
  active = 3,
  finalized = 4,
  configuring = 10,
  cleaning_up = 11,
  shutting_down = 12,
  activating = 13,
  deactivating = 14,
  error_processing = 15,
};

/// What makes the state change: the requests of lifecycle_msgs/msg/Transition and the outcomes of callbacks.
enum class Trigger : std::uint8_t {
  configure = 1,
  cleanup = 2,
  activate = 3,
  deactivate = 4,
  unconfigured_shutdown = 5,
  inactive_shutdown = 6,
  active_shutdown = 7,
  success = 97,
  failure = 98,
  error = 99,
};

/// What a transition's callback returns.
enum class CallbackReturn : std::uint8_t { success, failure, error };

/// One row of the state table: in @p from, @p trigger leads to @p to. Labels are ROS 2's.
struct LifecycleRow {
  State from;
  Trigger trigger;
  State to;
  std::uint8_t transition_id;  ///< lifecycle_msgs/msg/Transition
  std::string_view label;
};

/// The whole state machine (ROS 2 design "Managed nodes"; rcl_lifecycle's default_state_machine): every pair
/// that is not here is refused.
[[nodiscard]] std::span<const LifecycleRow> lifecycle_table();
/// @return the row for this pair, nullptr when the pair is refused
[[nodiscard]] const LifecycleRow* find_row(State from, Trigger trigger);
/// From where a node goes to error processing by itself, because a callback failed (the design's RaiseError,
/// https://design.ros2.org/articles/node_lifecycle.html). ROS 2's table lacks these rows, so they are none
/// that a request could name. @return nullptr for Finalized and the transition states
[[nodiscard]] const LifecycleRow* find_error_row(State from);
/// A request by label when one is given, else by id: rclcpp_lifecycle's rule, since a call that fills only
/// the label sends id 0. `ros2 lifecycle set` sends both.
[[nodiscard]] const LifecycleRow* find_request(State from, std::uint8_t id, std::string_view label);
[[nodiscard]] std::string_view label(State state);
[[nodiscard]] bool is_primary(State state);
[[nodiscard]] Trigger to_trigger(CallbackReturn outcome);
/// "active" -> State::active; primary states only.
[[nodiscard]] std::optional<State> primary_state(std::string_view label);

}  // namespace srfs::ros
