// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/goal_tracker.hpp"

#include <algorithm>

namespace srfs::ros {

const char* to_text(GoalError error) {
  switch (error) {
    case GoalError::no_server:
      return "no server";
    case GoalError::unanswered:
      return "the server did not answer";
    case GoalError::refused:
      return "goal refused here";
    case GoalError::rejected:
      return "goal rejected by the server";
    case GoalError::server_lost:
      return "server lost";
    case GoalError::unknown_goal:
      return "the server does not know the goal";
    case GoalError::result_late:
      return "no result in time";
    case GoalError::result_lost:
      return "the goal ended but its result is not available";
  }
  return "?";
}

GoalTracker::Step GoalTracker::fail(GoalError error) {
  phase_ = Phase::over;
  Step step;
  step.failed = error;
  return step;
}

GoalTracker::Step GoalTracker::on_send_failed(GoalError error) {
  if (phase_ != Phase::sending) return {};
  return fail(error);
}

GoalTracker::Step GoalTracker::on_response(bool accepted, MonotonicTime now) {
  if (phase_ != Phase::sending) return {};
  if (!accepted) return fail(GoalError::rejected);
  phase_ = Phase::accepted;
  if (state_ == GoalState::unknown) state_ = GoalState::accepted;
  result_due_ = now + deadlines_.result;
  if (is_terminal(state_)) ask_again_at_ = now + result_patience;
  ++result_requests_;
  Step step;
  step.request_result = true;
  step.request_cancel = cancel_wanted_;
  return step;
}

GoalTracker::Step GoalTracker::on_status(GoalState state, MonotonicTime now) {
  if (phase_ == Phase::over || state == GoalState::unknown) return {};
  const bool news = state > state_ || is_terminal(state);  // a late sample of an earlier state is none
  if (!news || is_terminal(state_)) return {};
  state_ = state;
  if (phase_ == Phase::accepted && is_terminal(state)) ask_again_at_ = now + result_patience;
  return {};
}

GoalTracker::Step GoalTracker::on_result(GoalState state) {
  if (phase_ != Phase::accepted) return {};
  if (!is_terminal(state)) return fail(GoalError::unknown_goal);
  phase_ = Phase::over;
  state_ = state;
  Step step;
  step.finished = state;
  return step;
}

GoalTracker::Step GoalTracker::on_server(bool present, MonotonicTime now) {
  if (phase_ != Phase::accepted) return {};
  if (present) {
    give_up_at_.reset();
  } else if (!give_up_at_) {
    give_up_at_ = now + farewell;
  }
  return {};
}

GoalTracker::Step GoalTracker::on_cancel_wanted() {
  if (phase_ == Phase::over || cancel_wanted_) return {};
  cancel_wanted_ = true;
  Step step;
  step.request_cancel = phase_ == Phase::accepted;
  return step;
}

GoalTracker::Step GoalTracker::on_time(MonotonicTime now) {
  if (phase_ != Phase::accepted) return {};
  if (give_up_at_ && now >= *give_up_at_) return fail(GoalError::server_lost);
  if (now >= result_due_) {
    Step step = fail(GoalError::result_late);
    step.request_cancel = deadlines_.cancel_when_late && !cancel_wanted_ && !is_terminal(state_);
    return step;
  }
  if (!ask_again_at_ || now < *ask_again_at_) return {};
  if (result_requests_ == most_result_requests) return fail(GoalError::result_lost);
  ++result_requests_;
  ask_again_at_ = now + result_patience;
  Step step;
  step.request_result = true;
  return step;
}

std::optional<MonotonicTime> GoalTracker::next_deadline() const {
  if (phase_ != Phase::accepted) return std::nullopt;
  MonotonicTime next = result_due_;
  if (ask_again_at_) next = std::min(next, *ask_again_at_);
  if (give_up_at_) next = std::min(next, *give_up_at_);
  return next;
}

}  // namespace srfs::ros
