// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

// Definitions of action_client.hpp's templates; include that.

#include <exception>
#include <utility>

#include "ros/action_client.hpp"

namespace srfs::ros {

template <class A>
ActionClient<A>::Links::Links(Executor& executor_in, Participant& participant, const std::string& action,
                              Priority priority)
    : executor(executor_in),
      send_goal(executor_in, participant, action + "/_action/send_goal", Qos{}, priority),
      get_result(executor_in, participant, action + "/_action/get_result", Qos{}, priority),
      cancel(executor_in, participant, action + "/_action/cancel_goal", Qos{}, priority),
      feedback(TypedReader<FeedbackMessage>::create(
          executor_in, participant, topic_dds_name(action + "/_action/feedback"), Qos{}, priority,
          [this](const FeedbackMessage& message, const MessageInfo&) {
            if (const auto goal = find(message.goal_id.uuid)) goal->on_feedback(message.feedback);
          })),
      status(TypedReader<StatusArray>::create(
          executor_in, participant, topic_dds_name(action + "/_action/status"), action_status_qos, priority,
          [this](const StatusArray& message, const MessageInfo&) { on_status(message); })) {}

template <class A>
ActionClient<A>::Links::~Links() {
  feedback->close();
  status->close();
}

// A goal is sent when everything is matched, not only its own service: else its first feedback could be lost.
template <class A>
void ActionClient<A>::Links::connect() {
  send_goal.set_condition([this] { return is_ready(); });
  const auto changed = [self = this->weak_from_this()] {
    const auto links = self.lock();
    if (!links) return;
    links->send_goal.server_changed();
    const auto goals_now = links->goals;  // a callback may add or drop goals
    for (const auto& [id, goal] : goals_now) {
      if (const auto alive = goal.lock()) alive->on_server_change();
    }
  };
  send_goal.on_server_change(changed);
  get_result.on_server_change(changed);
  cancel.on_server_change(changed);
  const auto post = [&executor_of = executor, changed] { executor_of.post(changed); };
  feedback->on_match_change(post);
  status->on_match_change(post);
}

template <class A>
bool ActionClient<A>::Links::is_ready() const {
  return send_goal.is_ready() && get_result.is_ready() && cancel.is_ready() &&
         feedback->matched_count() > 0 && status->matched_count() > 0;
}

template <class A>
std::shared_ptr<ClientGoal<A>> ActionClient<A>::Links::find(const GoalId& id) const {
  const auto found = goals.find(id);
  return found != goals.end() ? found->second.lock() : nullptr;
}

template <class A>
void ActionClient<A>::Links::on_status(const StatusArray& message) {
  for (const auto& status_of : message.status_list) {
    if (const auto goal = find(status_of.goal_info.goal_id.uuid))
      goal->perform(goal->tracker_.on_status(goal_state(status_of.status), executor.now()));
  }
}

template <class A>
ClientGoal<A>::~ClientGoal() {
  const auto links = links_.lock();
  if (!links) return;
  links->goals.erase(id_);
  links->send_goal.forget(send_call_);
  links->cancel.forget(cancel_call_);
  for (const CallId call : result_calls_) links->get_result.forget(call);
}

template <class A>
void ClientGoal<A>::send(const typename A::Goal& goal) {
  const auto links = links_.lock();
  typename A::SendGoal::Request request;
  request.goal_id.uuid = id_;
  request.goal = goal;
  send_call_ = links->send_goal.call(request, deadlines_.response, deadlines_.attempts,
                                     [this](const auto& response, const GUID_t& server) {
                                       const auto alive = this->shared_from_this();
                                       on_response(response, server);
                                     });
}

template <class A>
void ClientGoal<A>::on_response(const Result<typename A::SendGoal::Response, CallError>& response,
                                const GUID_t& server) {
  if (!response) {
    const GoalError why = response.error() == CallError::no_server ? GoalError::no_server
                          : response.error() == CallError::timeout ? GoalError::unanswered
                                                                   : GoalError::refused;
    perform(tracker_.on_send_failed(why));
    return;
  }
  const auto links = links_.lock();
  if (!links) return;
  server_ = server;
  const auto step = tracker_.on_response(response->accepted, links->executor.now());
  if (response->accepted && callbacks_.accepted) callbacks_.accepted(from_message(response->stamp));
  perform(step);
  on_server_change();  // it may have gone since
}

template <class A>
void ClientGoal<A>::on_feedback(const typename A::Feedback& feedback) {
  if (!tracker_.is_over() && callbacks_.feedback) callbacks_.feedback(feedback);
}

template <class A>
void ClientGoal<A>::on_server_change() {
  const auto links = links_.lock();
  if (!links || !tracker_.is_accepted()) return;
  perform(tracker_.on_server(links->send_goal.is_served_by(server_), links->executor.now()));
}

template <class A>
void ClientGoal<A>::request_result() {
  const auto links = links_.lock();
  if (!links || result_call_count_ == result_calls_.size()) return;
  typename A::GetResult::Request request;
  request.goal_id.uuid = id_;
  // A call may outlast the goal's deadline a little; the goal's end forgets it.
  const nanoseconds deadline = deadlines_.result + GoalTracker::result_patience;
  const CallId call =
      links->get_result.call(request, deadline, 1, [this](const auto& response, const GUID_t&) {
        const auto alive = this->shared_from_this();
        std::exception_ptr thrown;  // by a callback of feedback: no reason to lose the result
        try {
          take_waiting_feedback();
        } catch (...) {
          thrown = std::current_exception();
        }
        if (response) perform(tracker_.on_result(goal_state(response->status)), &response->result);
        if (thrown) std::rethrow_exception(thrown);
      });
  result_calls_[result_call_count_++] = call;
}

// Feedback sent before the result is delivered before it, whichever input the executor takes first.
template <class A>
void ClientGoal<A>::take_waiting_feedback() {
  const auto links = links_.lock();
  if (!links) return;
  for (std::size_t most = Qos{}.depth; most > 0 && links->feedback->dispatch_one(links->executor.now());
       --most) {
  }
}

template <class A>
void ClientGoal<A>::cancel(CancelCallback callback) {
  const auto alive = this->shared_from_this();
  if (tracker_.is_over()) {
    if (callback) callback(CancelOutcome::unanswered);
    return;
  }
  if (callback) canceler_ = std::move(callback);
  perform(tracker_.on_cancel_wanted());
}

template <class A>
void ClientGoal<A>::request_cancel() {
  const auto links = links_.lock();
  if (!links) return;
  action_msgs::srv::CancelGoal::Request request;
  request.goal_info.goal_id.uuid = id_;
  if (tracker_.is_over()) {  // the answer is not needed any more
    links->cancel.call(request, deadlines_.response, deadlines_.attempts, [](const auto&) {});
    return;
  }
  cancel_call_ =
      links->cancel.call(request, deadlines_.response, deadlines_.attempts, [this](const auto& response) {
        const auto alive = this->shared_from_this();
        tell_canceler(response ? cancel_outcome(response->return_code) : CancelOutcome::unanswered);
      });
}

template <class A>
void ClientGoal<A>::tell_canceler(CancelOutcome outcome) {
  if (const CancelCallback told = std::exchange(canceler_, {})) told(outcome);
}

template <class A>
void ClientGoal<A>::perform(const GoalTracker::Step& step, const typename A::Result* result) {
  const auto alive = this->shared_from_this();
  if (step.request_result) request_result();
  if (step.request_cancel) request_cancel();
  if (step.failed) {
    end(Err(*step.failed));
    return;
  }
  if (step.finished) {
    end(GoalResult<A>{*step.finished, *result});
    return;
  }
  const auto links = links_.lock();
  const auto next = tracker_.next_deadline();
  timer_.reset();
  if (links && next) {
    timer_ = links->executor.add_timer(
        *next, nanoseconds(0),
        [this] {
          const auto held = this->shared_from_this();
          if (const auto there = links_.lock()) perform(tracker_.on_time(there->executor.now()));
        },
        "goal deadline");
  }
}

template <class A>
void ClientGoal<A>::end(const GoalOutcome<A>& outcome) {
  timer_.reset();
  if (const auto links = links_.lock()) {
    links->goals.erase(id_);
    links->send_goal.forget(send_call_);
    for (const CallId call : result_calls_) links->get_result.forget(call);
  }
  if (callbacks_.ended) callbacks_.ended(outcome);
}

}  // namespace srfs::ros
