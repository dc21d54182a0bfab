// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/action_client.hpp"

#include <random>

namespace srfs::ros {

GoalId make_goal_id() {
  std::random_device source;  // getentropy or the like: two nodes that start together must not agree
  GoalId id;
  for (std::size_t i = 0; i < id.size(); i += 4) {
    const std::uint32_t word = source();
    for (std::size_t k = 0; k < 4; ++k) id[i + k] = static_cast<std::uint8_t>(word >> (8 * k));
  }
  id[6] = static_cast<std::uint8_t>((id[6] & 0x0fU) | 0x40U);
  id[8] = static_cast<std::uint8_t>((id[8] & 0x3fU) | 0x80U);
  return id;
}

CancelOutcome cancel_outcome(std::int8_t return_code) {
  using Code = action_msgs::srv::CancelGoal_Response;
  switch (return_code) {
    case Code::ERROR_NONE:
      return CancelOutcome::canceling;
    case Code::ERROR_UNKNOWN_GOAL_ID:
      return CancelOutcome::unknown_goal;
    case Code::ERROR_GOAL_TERMINATED:
      return CancelOutcome::terminated;
    default:
      return CancelOutcome::rejected;
  }
}

const char* to_text(CancelOutcome outcome) {
  switch (outcome) {
    case CancelOutcome::canceling:
      return "canceling";
    case CancelOutcome::rejected:
      return "rejected by the server";
    case CancelOutcome::unknown_goal:
      return "the server does not know the goal";
    case CancelOutcome::terminated:
      return "the goal has ended or is being canceled";
    case CancelOutcome::unanswered:
      return "no answer in time";
  }
  return "?";
}

}  // namespace srfs::ros
