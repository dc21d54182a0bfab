// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/action_goals.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

#include <action_msgs/srv/cancel_goal.hpp>

namespace srfs::ros {
namespace {

using CancelCode = action_msgs::srv::CancelGoal_Response;

}  // namespace

const ActionGoals::Entry* ActionGoals::find(const GoalId& id) const {
  const auto found =
      std::find_if(entries_.begin(), entries_.end(), [&](const Entry& entry) { return entry.goal.id == id; });
  return found == entries_.end() ? nullptr : &*found;
}

ActionGoals::Entry* ActionGoals::find(const GoalId& id) {
  return const_cast<Entry*>(std::as_const(*this).find(id));
}

ActionGoals::Admission ActionGoals::admit(const GoalId& id) {
  if (find(id) != nullptr) {
    ++counters_.rejected_duplicate;
    return Admission::duplicate;
  }
  const auto active = std::count_if(entries_.begin(), entries_.end(),
                                    [](const Entry& entry) { return is_active(entry.goal.state); });
  if (static_cast<std::size_t>(active) >= limits_.active) {
    ++counters_.rejected_full;
    return Admission::full;
  }
  return Admission::open;
}

void ActionGoals::accept(const GoalId& id, const GoalClient& client, UtcTime stamp) {
  assert(find(id) == nullptr);
  Entry entry;
  entry.goal = {id, stamp, GoalState::accepted};
  entry.client = client;
  entries_.push_back(std::move(entry));
  ++counters_.accepted;
}

bool ActionGoals::apply(const GoalId& id, GoalEvent event, MonotonicTime now, ResultPointer result) {
  Entry* entry = find(id);
  const auto next = entry != nullptr ? next_state(entry->goal.state, event) : std::nullopt;
  if (!next) {
    ++counters_.refused_events;
    return false;
  }
  entry->goal.state = *next;
  if (is_terminal(*next)) {
    entry->ended_at = now;
    entry->result = std::move(result);
    make_room_for_results(id);
  }
  return true;
}

// The goal that just ended stays: its waiters are still to be answered.
void ActionGoals::make_room_for_results(const GoalId& just_ended) {
  const auto ended = [](const Entry& entry) { return is_terminal(entry.goal.state); };
  auto kept = static_cast<std::size_t>(std::count_if(entries_.begin(), entries_.end(), ended));
  while (kept > limits_.results) {
    auto oldest = entries_.end();
    for (auto entry = entries_.begin(); entry != entries_.end(); ++entry) {
      if (!ended(*entry) || entry->goal.id == just_ended) continue;
      if (oldest == entries_.end() || entry->ended_at < oldest->ended_at) oldest = entry;
    }
    if (oldest == entries_.end()) return;
    entries_.erase(oldest);
    ++counters_.evicted;
    --kept;
  }
}

GoalState ActionGoals::state(const GoalId& id) const {
  const Entry* entry = find(id);
  return entry != nullptr ? entry->goal.state : GoalState::unknown;
}

ActionGoals::ResultPointer ActionGoals::result(const GoalId& id) const {
  const Entry* entry = find(id);
  return entry != nullptr ? entry->result : nullptr;
}

ActionGoals::CancelScope ActionGoals::cancel_scope(const GoalId& id, UtcTime stamp) const {
  const bool any_id = id == GoalId{};
  const bool any_time = stamp == UtcTime();
  if (!any_id && any_time) {
    const Entry* entry = find(id);
    if (entry == nullptr) return {CancelCode::ERROR_UNKNOWN_GOAL_ID, {}};
    if (!is_cancelable(entry->goal.state)) return {CancelCode::ERROR_GOAL_TERMINATED, {}};
    return {CancelCode::ERROR_NONE, {entry->goal}};
  }
  CancelScope scope{CancelCode::ERROR_NONE, {}};
  for (const Entry& entry : entries_) {
    const bool meant = any_time || entry.goal.stamp <= stamp || entry.goal.id == id;
    if (meant && is_cancelable(entry.goal.state)) scope.goals.push_back(entry.goal);
  }
  return scope;
}

bool ActionGoals::await_result(const GoalId& id, Waiter waiter) {
  Entry* entry = find(id);
  if (entry == nullptr || !is_active(entry->goal.state)) return false;
  entry->waiters.push_back(waiter);
  return true;
}

std::vector<ActionGoals::Waiter> ActionGoals::take_waiters(const GoalId& id) {
  Entry* entry = find(id);
  return entry != nullptr ? std::exchange(entry->waiters, {}) : std::vector<Waiter>{};
}

void ActionGoals::forget_waiter(Waiter waiter) {
  for (Entry& entry : entries_) std::erase(entry.waiters, waiter);
}

std::size_t ActionGoals::expire(MonotonicTime now) {
  const std::size_t dropped = std::erase_if(entries_, [&](const Entry& entry) {
    return is_terminal(entry.goal.state) && now - entry.ended_at >= limits_.result_timeout;
  });
  counters_.expired += dropped;
  return dropped;
}

std::optional<MonotonicTime> ActionGoals::next_expiry() const {
  std::optional<MonotonicTime> next;
  for (const Entry& entry : entries_) {
    if (!is_terminal(entry.goal.state)) continue;
    const MonotonicTime at = entry.ended_at + limits_.result_timeout;
    if (!next || at < *next) next = at;
  }
  return next;
}

std::vector<ActionGoals::Goal> ActionGoals::goals() const {
  std::vector<Goal> all;
  all.reserve(entries_.size());
  for (const Entry& entry : entries_) all.push_back(entry.goal);
  return all;
}

std::vector<GoalId> ActionGoals::orphans(const std::function<bool(const GoalClient&)>& within_reach) {
  std::vector<GoalId> found;
  for (Entry& entry : entries_) {
    if (!is_active(entry.goal.state) || entry.orphaned) continue;
    if (within_reach(entry.client)) {
      entry.client_seen = true;
    } else if (entry.client_seen) {
      entry.orphaned = true;
      found.push_back(entry.goal.id);
    }
  }
  return found;
}

}  // namespace srfs::ros
