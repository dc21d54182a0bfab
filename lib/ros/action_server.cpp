// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/action_server.hpp"

#include <algorithm>

namespace srfs::ros {
namespace {

GoalClient goal_client(const GUID_t& guid) {
  GoalClient client;
  std::copy_n(guid.guidPrefix.value, 12, client.begin());
  std::copy_n(guid.entityId.value, 4, client.begin() + 12);
  return client;
}

action_msgs::msg::GoalInfo goal_info(const ActionGoals::Goal& goal) {
  action_msgs::msg::GoalInfo info;
  info.goal_id.uuid = goal.id;
  info.stamp = to_message(goal.stamp);
  return info;
}

}  // namespace

void GoalMailbox::post(Item item) {
  {
    const std::lock_guard lock(mutex_);
    if (closed_) return;
    if (item.kind == Kind::feedback) {
      const auto of_this_goal = [&](const Item& i) {
        return i.goal == item.goal && i.kind == Kind::feedback;
      };
      if (static_cast<std::size_t>(std::count_if(items_.begin(), items_.end(), of_this_goal)) >=
          most_feedback) {
        items_.erase(std::find_if(items_.begin(), items_.end(), of_this_goal));
        ++dropped_feedback_;
      }
    }
    items_.push_back(std::move(item));
    // Inside the lock: after close() the executor may be gone.
    executor_.notify(shared_from_this(), priority_);
  }
}

void GoalMailbox::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  items_.clear();
}

bool GoalMailbox::dispatch_one(MonotonicTime) {
  Item item;
  {
    const std::lock_guard lock(mutex_);
    if (items_.empty()) return false;
    item = std::move(items_.front());
    items_.pop_front();
  }
  handle_(item);
  return true;
}

ActionServerCore::ActionServerCore(Typed& typed, Executor& executor, Participant& participant,
                                   const std::string& action, const ActionServerOptions& options)
    : typed_(typed),
      executor_(executor),
      orphan_policy_(options.orphans),
      goals_(options.limits),
      mailbox_(std::make_shared<GoalMailbox>(executor, options.priority,
                                             [this](const GoalMailbox::Item& item) { on_item(item); })),
      status_(participant, {action + "/_action/status", action_status_qos}),
      cancel_goal_(executor, participant, action + "/_action/cancel_goal", Qos{}, options.priority,
                   [this](const CancelGoal::Request& request, CancelGoal::Response& response) {
                     on_cancel(request, response);
                   }) {
  executor.name_source(mailbox_, CallbackKind::other, action + " (goals)");
}

ActionServerCore::~ActionServerCore() {
  mailbox_->close();
}

void ActionServerCore::shut_down() {
  mailbox_->close();
  for (const ActionGoals::Goal& goal : goals_.goals()) {
    if (is_active(goal.state)) finish(goal.id, GoalEvent::abort, nullptr);
  }
  expiry_.reset();
}

void ActionServerCore::accept(const GoalId& id, const GUID_t& client, UtcTime stamp, bool execute) {
  goals_.accept(id, goal_client(client), stamp);
  if (execute) goals_.apply(id, GoalEvent::execute, executor_.now());
  publish_status();
  clients_changed({});  // notes that this client is there, so that its end can be seen
}

void ActionServerCore::result_wanted(const GoalId& id, Ticket ticket) {
  if (goals_.await_result(id, static_cast<ActionGoals::Waiter>(ticket))) return;
  typed_.reply_result(ticket, goals_.state(id), goals_.result(id).get());
}

void ActionServerCore::clients_changed(std::span<const Ticket> dropped) {
  for (const Ticket ticket : dropped) goals_.forget_waiter(static_cast<ActionGoals::Waiter>(ticket));
  const auto orphans =
      goals_.orphans([this](const GoalClient& client) { return typed_.within_reach(client); });
  orphans_ += orphans.size();
  if (orphan_policy_ != OrphanPolicy::cancel) return;
  bool changed = false;
  for (const GoalId& id : orphans) {
    if (is_cancelable(goals_.state(id))) changed = cancel(id) || changed;
  }
  if (changed) publish_status();
}

// @pre the goal is cancelable
bool ActionServerCore::cancel(const GoalId& id) {
  if (typed_.cancel_wanted(id) == CancelResponse::reject) return false;
  goals_.apply(id, GoalEvent::cancel_goal, executor_.now());
  return true;
}

void ActionServerCore::on_cancel(const CancelGoal::Request& request, CancelGoal::Response& response) {
  const auto scope =
      goals_.cancel_scope(request.goal_info.goal_id.uuid, from_message(request.goal_info.stamp));
  response.return_code = scope.return_code;
  for (const ActionGoals::Goal& goal : scope.goals) {
    if (cancel(goal.id)) response.goals_canceling.push_back(goal_info(goal));
  }
  // rclcpp_action: when every single goal refuses, the request as a whole is rejected.
  if (!scope.goals.empty() && response.goals_canceling.empty())
    response.return_code = CancelGoal::Response::ERROR_REJECTED;
  if (!response.goals_canceling.empty()) publish_status();
}

void ActionServerCore::begin(const GoalId& id) {
  if (goals_.state(id) != GoalState::accepted) return;
  goals_.apply(id, GoalEvent::execute, executor_.now());
  publish_status();
}

void ActionServerCore::on_item(const GoalMailbox::Item& item) {
  switch (item.kind) {
    case GoalMailbox::Kind::execute:
      begin(item.goal);
      return;
    case GoalMailbox::Kind::feedback:
      begin(item.goal);
      if (is_active(goals_.state(item.goal))) typed_.publish_feedback(item.payload.get());
      return;
    case GoalMailbox::Kind::end:
      finish(item.goal, item.how, item.payload);
      return;
    case GoalMailbox::Kind::abandoned:
      if (!is_active(goals_.state(item.goal))) return;
      log::warn("an action goal was dropped before its end: aborted");
      finish(item.goal, GoalEvent::abort, nullptr);
      return;
  }
}

void ActionServerCore::finish(const GoalId& id, GoalEvent how, const std::shared_ptr<const void>& result) {
  if (goals_.state(id) == GoalState::accepted) goals_.apply(id, GoalEvent::execute, executor_.now());
  if (how == GoalEvent::canceled && goals_.state(id) != GoalState::canceling) {
    log::warn("an action goal ended as canceled without a granted cancel request: aborted");
    how = GoalEvent::abort;
  }
  if (!goals_.apply(id, how, executor_.now(), result)) return;
  for (const ActionGoals::Waiter waiter : goals_.take_waiters(id))
    typed_.reply_result(static_cast<Ticket>(waiter), goals_.state(id), result.get());
  publish_status();
  arm_expiry();
  typed_.goal_ended(id);
}

void ActionServerCore::publish_status() {
  action_msgs::msg::GoalStatusArray message;
  for (const ActionGoals::Goal& goal : goals_.goals()) {
    action_msgs::msg::GoalStatus& status = message.status_list.emplace_back();
    status.goal_info = goal_info(goal);
    status.status = static_cast<std::int8_t>(goal.state);
  }
  status_.publish(message);
}

void ActionServerCore::expire() {
  goals_.expire(monotonic_now());
  arm_expiry();
}

void ActionServerCore::arm_expiry() {
  const auto next = goals_.next_expiry();
  expiry_ = next ? executor_.add_timer(
                       *next, nanoseconds(0), [this] { expire(); }, "goal results")
                 : nullptr;
}

}  // namespace srfs::ros
