// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/task_flag_rotation.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

namespace srfs {
namespace {

nanoseconds longest_lease(const std::vector<Slot>& slots) {
  nanoseconds longest{0};
  for (const Slot& slot : slots) longest = std::max(longest, slot.lease());
  return longest;
}

}  // namespace

TaskFlagRotation::TaskFlagRotation(std::vector<Slot> slots, std::uint32_t incarnation, MonotonicTime now,
                                   const std::optional<InheritedGrant>& inherited)
    : slots_(std::move(slots)),
      known_process_(slots_.size()),
      slot_counters_(slots_.size()),
      incarnation_(incarnation),
      had_this_tick_(slots_.size(), false),
      not_before_(now + longest_lease(slots_)) {
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (!slots_[i].payload.empty()) order_.push_back(i);
  }
  assert(!order_.empty());
  if (inherited) inherit(*inherited, now);
}

void TaskFlagRotation::inherit(const InheritedGrant& granted, MonotonicTime now) {
  const auto slot = slot_of(granted.payload);
  if (!slot) return;
  current_ = Grant{.id = {incarnation_, next_counter_++},
                   .slot = *slot,
                   .payload = granted.payload,
                   .cycle = 0,
                   .received = now,
                   .granted = now,
                   .lease_end = now,
                   .allotted = nanoseconds(0)};
  holder_process_ = granted.process;
  recalled_ = false;
  starved_end_.reset();
  starved_since_.reset();
  phase_ = granted.process ? Phase::recalling : Phase::fencing;
}

void TaskFlagRotation::await_empty_queue(MonotonicTime now) {
  current_ = Grant{.id = {incarnation_, next_counter_++},
                   .slot = 0,
                   .payload = {},
                   .cycle = 0,
                   .received = now,
                   .granted = now,
                   .lease_end = now,
                   .allotted = nanoseconds(0)};
  phase_ = Phase::fencing;
}

RotationActions TaskFlagRotation::on_tick(MonotonicTime now, MissionCycle cycle, MonotonicTime received) {
  last_cycle_ = cycle;
  ++counters_.ticks;

  if (phase_ == Phase::recalling) return suspended_ ? RotationActions() : recall(now, received);
  if (phase_ != Phase::free) {
    ++counters_.blocked_ticks;
    return {};
  }
  if (now < not_before_) {
    ++counters_.waiting_ticks;
    return {};
  }
  return grant_next(now, cycle, received);
}

/// With each tick, as a flag may be lost; later seldom: all payloads answer, and the holder may be too late
/// for all that it hears.
RotationActions TaskFlagRotation::recall(MonotonicTime now, MonotonicTime received) {
  ++counters_.waiting_ticks;
  if (!std::exchange(recalled_, true)) {
    current_->lease_end = now + recall_time_;
    recalled_first_ = now;
  } else if (now - recalled_first_ > recalled_often && now - recalled_last_ < recall_pause) {
    return {};
  }
  recalled_last_ = now;
  return {Recall{current_->id, current_->payload, received}};
}

RotationActions TaskFlagRotation::grant_next(MonotonicTime now, MissionCycle cycle, MonotonicTime received) {
  const bool from_before = resumed_ && received < *resumed_;
  if (suspended_ || from_before) {
    ++counters_.idle_ticks;
    return {};
  }
  had_this_tick_.assign(slots_.size(), false);
  return {grant(now, cycle, received)};
}

RotationActions TaskFlagRotation::on_early_release(MonotonicTime now) {
  const bool unused = std::exchange(slot_left_unused_, false);
  if (!unused || !early_handover_ || suspended_ || phase_ != Phase::free || now < not_before_) return {};
  if (had_this_tick_[order_[next_place_]]) return {};
  ++counters_.early_grants;
  return {grant(now, last_cycle_, now)};
}

Grant TaskFlagRotation::grant(MonotonicTime now, MissionCycle cycle, MonotonicTime received) {
  assert(phase_ == Phase::free);
  const std::size_t slot = order_[next_place_];
  const Slot& plan = slots_[slot];
  Grant grant{.id = {incarnation_, next_counter_++},
              .slot = slot,
              .payload = plan.payload,
              .cycle = cycle,
              .received = received,
              .granted = now,
              .lease_end = now + plan.lease(),
              .allotted = plan.allotted};
  assert(!current_ || grant.id > current_->id);
  current_ = grant;
  holder_process_.reset();
  phase_ = Phase::granted;
  slot_left_unused_ = false;
  had_this_tick_[slot] = true;
  next_place_ = (next_place_ + 1) % order_.size();
  ++slot_counters_[slot].granted;
  return grant;
}

bool TaskFlagRotation::set_order(const std::vector<std::string>& payloads) {
  std::vector<std::size_t> order;
  order.reserve(payloads.size());
  for (const std::string& payload : payloads) {
    const auto slot = slot_of(payload);
    if (!slot || std::find(order.begin(), order.end(), *slot) != order.end()) return false;
    order.push_back(*slot);
  }
  if (order.empty()) return false;
  if (order == order_) return true;
  const std::vector<std::size_t> before = std::exchange(order_, std::move(order));
  const std::size_t next_before = std::exchange(next_place_, 0);
  if (!current_ || current_->payload.empty()) return true;
  // It goes on after the last holder; if that payload has left, with the payload that would have been next.
  const auto place_of = [this](std::size_t slot) { return std::find(order_.begin(), order_.end(), slot); };
  const bool is_there = slots_[current_->slot].payload == current_->payload;
  if (const auto last = place_of(current_->slot); is_there && last != order_.end()) {
    next_place_ = static_cast<std::size_t>(last - order_.begin() + 1) % order_.size();
    return true;
  }
  for (std::size_t i = 0; i < before.size(); ++i) {
    const auto next = place_of(before[(next_before + i) % before.size()]);
    if (next == order_.end()) continue;
    next_place_ = static_cast<std::size_t>(next - order_.begin());
    break;
  }
  return true;
}

bool TaskFlagRotation::set_plan(const std::vector<Slot>& slots, const std::vector<std::string>& order) {
  const std::size_t places = std::max(slots.size(), slots_.size());
  slots_.resize(places);
  known_process_.resize(places);
  slot_counters_.resize(places);
  had_this_tick_.resize(places, false);
  const bool runs = phase_ != Phase::free && !current_->payload.empty();
  bool whole = true;
  for (std::size_t i = 0; i < places; ++i) {
    const Slot wanted = i < slots.size() && !slots[i].payload.empty() ? slots[i] : Slot{};
    if (wanted == slots_[i]) continue;
    if (runs && current_->slot == i) {
      whole = false;
      continue;
    }
    if (wanted.payload != slots_[i].payload) {
      known_process_[i].reset();
      slot_counters_[i] = {};
    }
    slots_[i] = wanted;
  }
  std::vector<std::string> turns;
  for (const std::string& payload : order) {
    if (slot_of(payload)) turns.push_back(payload);  // one that waits for its place has no turn yet
  }
  return set_order(turns) && whole;
}

std::vector<std::string> TaskFlagRotation::turns() const {
  std::vector<std::string> payloads;
  for (const std::size_t slot : order_) payloads.push_back(slots_[slot].payload);
  return payloads;
}

std::optional<std::size_t> TaskFlagRotation::slot_of(const std::string& payload) const {
  for (std::size_t i = 0; i < slots_.size(); ++i) {
    if (!payload.empty() && slots_[i].payload == payload) return i;
  }
  return std::nullopt;
}

std::optional<MonotonicTime> TaskFlagRotation::next_deadline() const {
  switch (phase_) {
    case Phase::free:
    case Phase::fencing:
      return std::nullopt;
    case Phase::taken:
      return current_->granted + current_->allotted + slots_[current_->slot].overrun;
    case Phase::granted:
    case Phase::reset_ordered:
      return current_->lease_end;
    case Phase::recalling:
      return recalled_ ? std::optional(current_->lease_end) : std::nullopt;
  }
  return std::nullopt;
}

std::optional<TaskFlagRotation::Holder> TaskFlagRotation::holder() const {
  if (phase_ == Phase::free || current_->payload.empty()) return std::nullopt;
  return Holder{current_->slot, process_of_holder().value_or(0)};
}

void TaskFlagRotation::withdraw(GrantId id) {
  if (phase_ != Phase::granted || id != current_->id) return;
  ++counters_.withdrawn;
  free_bus();
}

RotationActions TaskFlagRotation::on_deadline(MonotonicTime now, MonotonicTime last_heard,
                                              const std::optional<HolderCpu>& holder) {
  const auto deadline = next_deadline();
  if (!deadline || now < *deadline) return {};
  if (now < current_->lease_end) {
    // Only a payload that took the bus can overrun it; one that never took it has nothing to reset.
    assert(phase_ == Phase::taken);
    phase_ = Phase::reset_ordered;
    ++slot_counters_[current_->slot].overruns;
    return {OrderReset{current_->id, current_->payload, now - current_->granted}};
  }
  RotationActions actions;
  if (waits_to_hear(now, last_heard, actions)) return actions;
  switch (holder ? judge(now, *holder, actions) : HolderVerdict::could_run) {
    case HolderVerdict::starved:
      ask_starved_holder(now, actions);
      break;
    case HolderVerdict::may_starve:
      break;
    case HolderVerdict::could_run:
      end_lease(now, holder, actions);
      break;
  }
  return actions;
}

bool TaskFlagRotation::waits_to_hear(MonotonicTime now, MonotonicTime last_heard, RotationActions& actions) {
  const bool deaf = deaf_since_ ? last_heard <= *deaf_since_ : now - last_heard > deaf_limit;
  if (!deaf || (deaf_since_ && now - *deaf_since_ >= deaf_patience)) return false;
  if (!deaf_since_) {
    deaf_since_ = now;
    ++counters_.deaf_deadlines;
    actions.emplace_back(ReportDoubt{ReportDoubt::Why::deaf, current_->payload});
  }
  current_->lease_end = now + deaf_look;
  return true;
}

TaskFlagRotation::HolderVerdict TaskFlagRotation::judge(MonotonicTime now, const HolderCpu& holder,
                                                        RotationActions& actions) {
  if (phase_ != Phase::recalling && now - current_->lease_end > held_up_limit)
    return HolderVerdict::could_run;  // this process was held up itself: it asks first
  const bool first_look = !starved_end_;
  const MonotonicTime end = starved_end_.value_or(current_->lease_end);
  if (now - starved_since_.value_or(end) >= starved_patience) return HolderVerdict::could_run;
  const nanoseconds lease = end - current_->granted;
  const nanoseconds able = now - current_->granted - std::max(holder.waited, holder.bus_waited);
  const nanoseconds much = std::max(lease, slots_[current_->slot].lease() * starved_leases);
  const nanoseconds enough = holder.waited > lease / 4 ? much : lease - starved_look;
  const bool starved = able < enough;
  // A wait that goes on shows at the second look only.
  const bool may_wait = first_look && holder.runnable && holder.ran < lease / 2;
  if (!starved && !may_wait) return HolderVerdict::could_run;
  if (!starved_since_) {
    starved_since_ = end;
    ++counters_.starved_holders;
    actions.emplace_back(ReportDoubt{ReportDoubt::Why::starved, current_->payload});
  }
  starved_end_ = end;
  current_->lease_end = now + starved_look;
  return starved ? HolderVerdict::starved : HolderVerdict::may_starve;
}

/// It is asked: its release, or the flag, may be lost, and then it would say nothing once it has a CPU.
void TaskFlagRotation::ask_starved_holder(MonotonicTime now, RotationActions& actions) {
  const auto process = process_of_holder();
  if (phase_ == Phase::recalling || !process) return;
  actions.emplace_back(ask(*process, now, std::min(recall_time_, held_up_recall_time)));
}

/// A recall does not renew the patience with a starved holder.
Recall TaskFlagRotation::ask(std::uint32_t process, MonotonicTime now, nanoseconds time) {
  const auto starved_since = starved_since_;
  inherit({current_->payload, process}, now);
  starved_since_ = starved_since;
  deaf_since_.reset();
  recalled_ = true;
  recalled_first_ = recalled_last_ = now;
  current_->lease_end = now + time;
  return {current_->id, current_->payload, now};
}

void TaskFlagRotation::end_lease(MonotonicTime now, const std::optional<HolderCpu>& holder,
                                 RotationActions& actions) {
  const auto process = process_of_holder();
  const bool was_deaf = std::exchange(deaf_since_, std::nullopt).has_value();
  if (phase_ != Phase::recalling && process && (was_deaf || now - current_->lease_end > held_up_limit)) {
    // This process was deaf, stopped or starved, and so may the holder have been: it is asked before it is
    // killed.
    const bool long_ago = now - current_->lease_end > held_up_recall_time;
    ++counters_.late_deadlines;
    actions.emplace_back(ReportDoubt{ReportDoubt::Why::held_up, current_->payload});
    actions.emplace_back(
        ask(*process, now, long_ago ? recall_time_ : std::min(recall_time_, held_up_recall_time)));
    return;
  }
  SlotCounters& counters = slot_counters_[current_->slot];
  if (phase_ == Phase::granted) {
    ++counters.not_taken;
    // A payload writes its first frame only after its TAKEN left for a switcher it is matched with. A payload
    // that never reported since its start is not up yet (or not configured): there is nothing to fence.
    if (!known_process_[current_->slot]) {
      free_bus();
      return;
    }
  }
  phase_ = Phase::fencing;
  ++counters.fences;
  actions.emplace_back(Fence{current_->id, current_->payload, process, holder});
}

void TaskFlagRotation::on_fenced(GrantId id, MonotonicTime now) {
  if (phase_ != Phase::fencing || id != current_->id) return;
  known_process_[current_->slot].reset();
  not_before_ = std::max(not_before_, now + guard_time);
  free_bus();
}

ReportVerdict TaskFlagRotation::count(ReportVerdict verdict) {
  if (verdict == ReportVerdict::duplicate) ++counters_.duplicate_reports;
  if (verdict == ReportVerdict::old_grant) ++counters_.old_reports;
  if (verdict == ReportVerdict::foreign) ++counters_.foreign_reports;
  return verdict;
}

ReportVerdict TaskFlagRotation::on_bus_status(const BusReport& report, MonotonicTime now) {
  const auto slot = slot_of(report.payload);
  if (!slot) return count(ReportVerdict::foreign);
  if (report.grant == GrantId{}) {
    if (report.kind == BusReport::Kind::released) {
      known_process_[*slot] = report.payload_incarnation;
    } else if (known_process_[*slot] == report.payload_incarnation) {
      known_process_[*slot].reset();  // it says that it leaves
    }
    return ReportVerdict::greeting;
  }
  if (!current_ || report.grant > current_->id) {
    // A grant of an earlier switcher is old news, not a foreign claim.
    return count(report.grant.incarnation < incarnation_ ? ReportVerdict::old_grant : ReportVerdict::foreign);
  }
  if (report.grant < current_->id) return count(ReportVerdict::old_grant);
  if (phase_ == Phase::recalling && report.kind == BusReport::Kind::released &&
      report.payload != current_->payload) {
    known_process_[*slot] = report.payload_incarnation;  // every payload answers a recall
    return ReportVerdict::greeting;
  }
  if (report.payload != current_->payload) return count(ReportVerdict::foreign);
  return count(on_current_report(report, now));
}

ReportVerdict TaskFlagRotation::on_recall_answer(const BusReport& report, MonotonicTime now) {
  if (report.kind != BusReport::Kind::released || report.payload_incarnation < *holder_process_)
    return ReportVerdict::foreign;
  if (report.payload_incarnation > *holder_process_) {
    // The holder is gone and will never answer. Its frames may still wait to be sent: the fence handles that.
    current_->lease_end = now;
    return ReportVerdict::greeting;
  }
  known_process_[current_->slot] = report.payload_incarnation;
  not_before_ = std::max(not_before_, now + guard_time);
  free_bus();
  return ReportVerdict::applied;
}

ReportVerdict TaskFlagRotation::on_current_report(const BusReport& report, MonotonicTime now) {
  if (phase_ == Phase::recalling) return on_recall_answer(report, now);
  if (holder_process_ && *holder_process_ != report.payload_incarnation) return ReportVerdict::foreign;
  if (phase_ == Phase::free) return ReportVerdict::duplicate;
  if (phase_ == Phase::fencing) return ReportVerdict::old_grant;  // its lease is over; it is being killed
  holder_process_ = report.payload_incarnation;
  known_process_[current_->slot] = report.payload_incarnation;
  if (report.kind == BusReport::Kind::taken) {
    if (phase_ != Phase::granted) return ReportVerdict::duplicate;
    phase_ = Phase::taken;
    return ReportVerdict::applied;
  }
  // RELEASED may overtake TAKEN on its way; it reports everything TAKEN would have reported.
  SlotCounters& counters = slot_counters_[current_->slot];
  ++(report.kind == BusReport::Kind::released ? counters.released : counters.failed);
  // A payload that took the bus may have written, whatever it reports now.
  slot_left_unused_ = report.unused && report.kind == BusReport::Kind::released && phase_ == Phase::granted;
  if (slot_left_unused_) ++counters.unused;
  free_bus();
  return ReportVerdict::applied;
}

}  // namespace srfs
