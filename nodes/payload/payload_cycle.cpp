// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/payload_cycle.hpp"

#include <algorithm>
#include <cassert>

#include <fmt/format.h>

#include <mission/structures.hpp>

namespace srfs {
namespace {

constexpr std::uint32_t silent_slots_to_report = 3;
/// Behind a deadline; a thread that looks sooner is in time, whatever the peripheral sends.
constexpr nanoseconds late_look = milliseconds(2);

FailureCode failure_of(wire::PeripheralResult result) {
  switch (result) {
    case wire::PeripheralResult::done:
    case wire::PeripheralResult::already_done:
      return mission::failure::none;
    case wire::PeripheralResult::unknown_function:
      return mission::failure::peripheral_unknown_function;
    case wire::PeripheralResult::bad_argument:
      return mission::failure::peripheral_bad_argument;
    case wire::PeripheralResult::cannot_now:
      return mission::failure::peripheral_cannot_now;
  }
  return mission::failure::peripheral_garbage;
}

}  // namespace

PayloadCycle::PayloadCycle(PayloadSettings settings, CommandDecoder decode, TelecommandJournal journal)
    : settings_(settings), decode_(std::move(decode)), journal_(std::move(journal)) {
  babble_.change_settings(settings_.babble);
}

PayloadActions PayloadCycle::set_orders(std::vector<StandingOrder> once, std::vector<StandingOrder> hold,
                                        nanoseconds repeat, MonotonicTime now) {
  orders_.set(std::move(once), std::move(hold), repeat, now);
  orders_changed_ = true;
  return finish();
}

void PayloadCycle::change_settings(const PayloadSettings& settings) {
  settings_ = settings;
  babble_.change_settings(settings_.babble);
}

// ---------------------------------------------------------------- state of the node

PayloadActions PayloadCycle::activate(MonotonicTime now) {
  active_ = true;
  starting_since_ = now;
  if (power_by_command_ && power_ != Power::on) journal_.finish(mission::failure::interrupted);
  power_by_command_ = false;
  power_reason_.clear();
  power_deadline_.reset();
  // A predecessor may have died in the middle of a power cycle.
  power_ = kept_off_ ? Power::switching_off : Power::switching_on;
  keep_off_wanted_ = kept_off_;
  kept_off_until_ = std::min(kept_off_until_, now + settings_.kept_off_time_max);
  act(SwitchPower{!kept_off_});
  return finish();
}

PayloadActions PayloadCycle::deactivate(MonotonicTime now) {
  active_ = false;
  if (step_ != Step::idle && step_ != Step::draining) abandon_slot("deactivated", now);
  return finish();
}

Activity PayloadCycle::activity() const {
  if (step_ != Step::idle) return Activity::occupying_can;
  const bool power_command = power_by_command_ && power_ != Power::on;
  if (journal_.storing() || power_command) return Activity::other_async_command;
  return processing_ > 0 ? Activity::data_processing : Activity::off;
}

PayloadActions PayloadCycle::finish() {
  for (const StageReport& report : journal_.take_reports()) {
    if (!report.success) {
      act(PayloadEvent{
          .kind = PayloadEvent::Kind::telecommand_failed, .id = report.id, .code = report.failure});
    }
    act(report);
  }
  if (journal_.revision() > written_or_asked_) {
    written_or_asked_ = journal_.revision();
    act(WriteTelecommands{written_or_asked_});
  }
  if (const auto done = orders_.take_first_round()) act(OrdersObeyed{*done});
  if (activity() != published_) {
    published_ = activity();
    act(published_);
  }
  return std::exchange(actions_, {});
}

// ---------------------------------------------------------------- flags

PayloadActions PayloadCycle::on_flag(const PayloadFlag& flag, MonotonicTime now) {
  if (flag.grant <= newest_) {
    ++counters_.repeated_flags;
    // A switcher that repeats a flag may have missed its outcome.
    if (last_status_ && last_status_->grant == flag.grant) act(*last_status_);
    return finish();
  }
  end_slot_of_another_grant(flag.grant, "a newer grant came", now);
  flag_ = flag;
  ++statistics_.slots_granted;
  statistics_.granted_total += flag.allotted_end - flag.granted;
  if (!flag.switcher_reachable) {
    ++counters_.unreachable_flags;
  } else if (now >= flag.lease_end) {
    ++counters_.stale_flags;
  } else if (!active_) {
    hand_back("inactive", now);
  } else if (kept_off_ && power_ == Power::off && time_for_request(now)) {
    serve_kept_off(now);
  } else if (is_starting(now) && (power_ != Power::on || !time_for_request(now))) {
    hand_back("starting", now);
  } else if (power_ != Power::on) {
    decline(PublishStatus::Kind::failed, "the peripheral is switched off", now);
  } else if (!time_for_request(now)) {
    ++counters_.stale_flags;
    decline(PublishStatus::Kind::failed, "the flag came late", now);
  } else if (has_nothing_to_say(now)) {
    hand_back("nothing to say", now);
  } else {
    begin_slot(now);
  }
  return finish();
}

bool PayloadCycle::is_starting(MonotonicTime now) const {
  return starting_since_ && now - *starting_since_ < settings_.start_time;
}

bool PayloadCycle::has_nothing_to_say(MonotonicTime now) {
  return measured_ && flag_.granted - *measured_ < settings_.measurement_period && silent_in_a_row_ == 0 &&
         journal_.next(now) == nullptr && orders_.next(now) == nullptr;
}

void PayloadCycle::hand_back(const std::string& detail, MonotonicTime now) {
  ++statistics_.slots_handed_back;
  decline(PublishStatus::Kind::released, detail, now);
}

void PayloadCycle::serve_kept_off(MonotonicTime now) {
  while (const StoredTelecommand* telecommand = journal_.next(now)) {
    const auto command = decode_(telecommand->function, telecommand->arguments);
    if (command && std::holds_alternative<PowerCyclePeripheral>(*command)) {
      begin_slot(now);
      return;
    }
    end_command(command ? mission::failure::peripheral_off : command.error());
  }
  hand_back("the peripheral is kept off", now);
}

void PayloadCycle::decline(PublishStatus::Kind kind, const std::string& detail, MonotonicTime now) {
  if (kind == PublishStatus::Kind::failed) ++statistics_.slots_failed;
  last_status_ = PublishStatus{kind, flag_.grant, now - flag_.granted, detail};
  act(*last_status_);
}

PayloadActions PayloadCycle::on_foreign_flag(GrantId grant, MonotonicTime now) {
  if (grant > newest_) end_slot_of_another_grant(grant, "another payload was granted", now);
  return finish();
}

PayloadActions PayloadCycle::on_recall(GrantId id, MonotonicTime now) {
  if (id < newest_) return finish();
  const bool first = id > newest_;
  newest_ = id;
  recalled_ = id;
  if (step_ == Step::idle) {
    act(AwaitQuiet{});
    return finish();
  }
  if (!first) return finish();  // it is being ended already
  ++counters_.lost_grants;
  act(CloseBus{});
  if (step_ != Step::draining) {
    abandon_slot("the bus was recalled", now);
  } else if (!await_power_off_) {
    if (!withdrawn_) deadline_ = drain_deadline(now);
    act(AwaitQuiet{});
  }
  return finish();
}

void PayloadCycle::answer_recall() {
  if (!recalled_) return;
  act(PublishStatus{PublishStatus::Kind::released, *recalled_, nanoseconds(0), "recalled"});
  recalled_.reset();
}

void PayloadCycle::end_slot_of_another_grant(GrantId grant, const std::string& why, MonotonicTime now) {
  newest_ = grant;
  recalled_.reset();
  if (step_ == Step::idle) return;
  ++counters_.lost_grants;
  if (step_ != Step::draining) abandon_slot(why, now);
  act(WithdrawFrames{});
  release(now);
}

void PayloadCycle::begin_slot(MonotonicTime now) {
  starting_since_.reset();
  failure_.reset();
  block_.reset();
  stuck_counted_ = false;
  withdrawn_ = false;
  power_needed_ = false;
  power_command_.reset();
  last_status_ = PublishStatus{PublishStatus::Kind::taken, flag_.grant, nanoseconds(0), {}};
  act(*last_status_);
  act(OpenBus{flag_.grant, flag_.lease_end});

  // Commands that act on the peripheral itself go first: it may be too dead to be woken.
  if (next_command_acts_on_peripheral(now)) {
    run_next_command(now);
  } else {
    wake_up(now);
  }
}

bool PayloadCycle::next_command_acts_on_peripheral(MonotonicTime now) {
  const StoredTelecommand* telecommand = journal_.next(now);
  if (telecommand == nullptr) return false;
  const auto command = decode_(telecommand->function, telecommand->arguments);
  // Its record is written while the peripheral is being woken.
  if (telecommand->repeat == RepeatClass::at_most_once) journal_.mark_started();
  return command && !std::holds_alternative<PeripheralFunction>(*command);
}

MonotonicTime PayloadCycle::answer_deadline(MonotonicTime now) const {
  return std::min(now + settings_.answer_timeout, flag_.allotted_end);
}

void PayloadCycle::await_answer(Step step, MonotonicTime now) {
  step_ = step;
  deadline_ = answer_deadline(now);
  was_late_ = false;
}

bool PayloadCycle::time_for_request(MonotonicTime now) const {
  return now + settings_.command_time <= flag_.allotted_end;
}

// ---------------------------------------------------------------- the peripheral

void PayloadCycle::wake_up(MonotonicTime now) {
  await_answer(Step::waking, now);
  act(SendRequest{wire::WakeUpRequest{}});
}

PayloadActions PayloadCycle::on_answer(const wire::PeripheralResponse& answer, MonotonicTime now) {
  if (step_ == Step::waking && std::holds_alternative<wire::WakeUpResponse>(answer.body)) {
    on_woken(std::get<wire::WakeUpResponse>(answer.body), now);
  } else if (step_ == Step::commanding && std::holds_alternative<wire::CommandResponse>(answer.body)) {
    on_command_answer(std::get<wire::CommandResponse>(answer.body), now);
  } else if (step_ == Step::ordering && std::holds_alternative<wire::CommandResponse>(answer.body)) {
    on_order_answer(std::get<wire::CommandResponse>(answer.body), now);
  } else if (step_ == Step::resetting && std::holds_alternative<wire::ResetResponse>(answer.body)) {
    on_reset_answered(now);
  } else {
    ++counters_.unexpected_answers;
  }
  return finish();
}

void PayloadCycle::on_woken(const wire::WakeUpResponse& answer, MonotonicTime now) {
  if (silent_in_a_row_ >= silent_slots_to_report) {
    act(PayloadEvent{.kind = PayloadEvent::Kind::peripheral_back, .number = silent_in_a_row_});
    orders_.on_peripheral_restarted(now);  // it may have been
  }
  silent_in_a_row_ = 0;
  if (answer.status == wire::PeripheralStatus::booting) {
    fail_slot("the peripheral is booting", now);
    return;
  }
  block_ = answer.measurement;
  measured_ = flag_.granted;
  run_next_command(now);
}

void PayloadCycle::run_next_command(MonotonicTime now) {
  const StoredTelecommand* telecommand = journal_.next(now);
  const StandingOrder* order = telecommand == nullptr ? orders_.next(now) : nullptr;
  if ((telecommand == nullptr && order == nullptr) || !time_for_request(now)) {
    drain(now);
    return;
  }
  if (order != nullptr) {
    send_order(*order, now);
    return;
  }
  if (telecommand->repeat == RepeatClass::at_most_once) {
    journal_.mark_started();
    if (!journal_.start_is_durable()) {
      step_ = Step::storing;
      deadline_ = flag_.allotted_end - settings_.command_time;
      return;
    }
  }
  execute(*telecommand, now);
}

void PayloadCycle::execute(const StoredTelecommand& telecommand, MonotonicTime now) {
  const auto command = decode_(telecommand.function, telecommand.arguments);
  if (!command) {  // stored by another version of this node
    end_command(command.error());
    run_next_command(now);
    return;
  }
  const auto id = static_cast<std::uint32_t>(telecommand.id);
  journal_.begin();
  if (const auto* function = std::get_if<PeripheralFunction>(&*command)) {
    await_answer(Step::commanding, now);
    act(SendRequest{wire::CommandRequest{id, function->function, function->arguments}});
  } else if (const auto* cycle = std::get_if<PowerCyclePeripheral>(&*command)) {
    power_command_ = cycle->off_time;
    drain(now);
  } else {
    send_reset(false, "by telecommand", now);
  }
}

void PayloadCycle::on_command_answer(const wire::CommandResponse& answer, MonotonicTime now) {
  const StoredTelecommand* telecommand = journal_.next(MonotonicTime());
  assert(telecommand != nullptr);
  if (answer.telecommand_id != static_cast<std::uint32_t>(telecommand->id)) {
    on_no_answer(RequestFailure::garbage, "answer to another telecommand", now);
    return;
  }
  end_command(failure_of(answer.result));
  run_next_command(now);
}

/// Its id is none that the peripheral remembers: it is to be carried out again, not to be known.
void PayloadCycle::send_order(const StandingOrder& order, MonotonicTime now) {
  constexpr std::uint32_t orders = 0x8000'0000;
  constexpr unsigned microsecond_bits = 10;
  const auto clock = static_cast<std::uint32_t>(now.ns() >> microsecond_bits);
  order_id_ = order_id_ == 0 ? clock | orders : (order_id_ + 1) | orders;
  await_answer(Step::ordering, now);
  orders_changed_ = false;
  act(SendRequest{wire::CommandRequest{order_id_, order.function, order.arguments}});
}

void PayloadCycle::on_order_answer(const wire::CommandResponse& answer, MonotonicTime now) {
  if (answer.telecommand_id != order_id_) {
    on_no_answer(RequestFailure::garbage, "answer to another order", now);
    return;
  }
  const StandingOrder* order = orders_changed_ ? nullptr : orders_.next(now);
  if (order == nullptr) {  // of the mode before
    run_next_command(now);
    return;
  }
  if (const FailureCode why = failure_of(answer.result); why == mission::failure::none) {
    act(CommandDone{PeripheralFunction{order->function, order->arguments}});
    orders_.on_done(now);
  } else {
    act(OrderRefused{order->text, why});
    const bool for_ever = answer.result == wire::PeripheralResult::bad_argument ||
                          answer.result == wire::PeripheralResult::unknown_function;
    orders_.on_refused(for_ever, now);
  }
  run_next_command(now);
}

void PayloadCycle::on_silent_order(FailureCode why, MonotonicTime now) {
  const StandingOrder* order = orders_changed_ ? nullptr : orders_.next(now);
  if (order == nullptr || why == mission::failure::bus_lost) return;
  const std::string text = order->text;
  if (orders_.on_silence(now)) act(OrderRefused{text, why});
}

void PayloadCycle::end_command(FailureCode outcome) {
  if (outcome == mission::failure::none) {
    ++statistics_.telecommands_executed;
    const StoredTelecommand* telecommand = journal_.next(MonotonicTime());
    const auto command = decode_(telecommand->function, telecommand->arguments);
    if (command && std::holds_alternative<PeripheralFunction>(*command)) {
      act(CommandDone{std::get<PeripheralFunction>(*command)});
    }
  }
  journal_.finish(outcome);
}

void PayloadCycle::send_reset(bool ordered, const std::string& reason, MonotonicTime now) {
  reset_ordered_ = ordered;
  reset_reason_ = reason;
  step_ = Step::resetting;
  const MonotonicTime latest = ordered ? flag_.lease_end - settings_.lease_margin : flag_.allotted_end;
  deadline_ = std::min(now + settings_.reset_answer_timeout, latest);
  act(SendRequest{wire::ResetRequest{}});
}

void PayloadCycle::on_reset_answered(MonotonicTime now) {
  act(PayloadEvent{.kind = PayloadEvent::Kind::peripheral_reset, .text = reset_reason_});
  orders_.on_peripheral_restarted(now);
  if (reset_ordered_) {
    fail_slot(reset_reason_, now);
    return;
  }
  end_command(mission::failure::none);
  drain(now);
}

PayloadActions PayloadCycle::on_peripheral_reset(GrantId grant, const std::string& reason,
                                                 MonotonicTime now) {
  if (grant != flag_.grant || step_ == Step::idle || step_ == Step::draining) {
    ++counters_.stray_reset_orders;
    // It may have missed our release.
    if (step_ == Step::idle && last_status_ && last_status_->grant == grant) act(*last_status_);
    return finish();
  }
  if (step_ == Step::resetting && reset_ordered_) return finish();
  ++counters_.resets_ordered;
  if (step_ == Step::commanding || step_ == Step::resetting) retry_command(mission::failure::bus_lost);
  if (step_ == Step::storing) journal_.unmark_started();
  block_.reset();
  act(AbortRequest{});
  send_reset(true, reason, now);
  return finish();
}

// ---------------------------------------------------------------- failures

PayloadActions PayloadCycle::on_request_failed(RequestFailure why, const std::string& detail,
                                               MonotonicTime now) {
  if (step_ == Step::waking || step_ == Step::commanding || step_ == Step::ordering ||
      step_ == Step::resetting)
    on_no_answer(why, detail, now);
  return finish();
}

void PayloadCycle::on_no_answer(RequestFailure why, const std::string& detail, MonotonicTime now) {
  if (why == RequestFailure::silent) {
    ++statistics_.peripheral_timeouts;
  } else if (why == RequestFailure::garbage) {
    ++counters_.garbage_answers;
    act(PayloadEvent{.kind = PayloadEvent::Kind::peripheral_garbage, .text = detail});
  }
  act(AbortRequest{});
  const bool slot_over = now >= flag_.allotted_end;
  const FailureCode code = why == RequestFailure::garbage ? mission::failure::peripheral_garbage
                           : slot_over || why == RequestFailure::not_sent
                               ? mission::failure::bus_lost
                               : mission::failure::peripheral_silent;
  if (step_ == Step::commanding) {
    retry_command(code);
  } else if (step_ == Step::ordering) {
    on_silent_order(code, now);
  } else if (step_ == Step::resetting) {
    if (reset_ordered_) {
      start_power_cycle(reset_reason_, settings_.power_off_time, false);
    } else {
      end_command(code);
    }
  } else if (step_ == Step::waking && why != RequestFailure::not_sent) {
    count_silence(detail);
  }
  fail_slot(detail, now);
}

void PayloadCycle::on_silence(const std::string& detail, bool own_frames_left, MonotonicTime now) {
  if (!own_frames_left) {
    on_no_answer(RequestFailure::not_sent, "own frames did not get the bus", now);
  } else if (was_late_) {
    on_no_answer(RequestFailure::not_sent, "the answer came, and this node was late", now);
  } else {
    on_no_answer(RequestFailure::silent, detail, now);
  }
}

void PayloadCycle::retry_command(FailureCode why) {
  if (step_ == Step::resetting && reset_ordered_) return;
  (void)journal_.attempt_failed(why);
}

void PayloadCycle::count_silence(const std::string& detail) {
  ++silent_in_a_row_;
  const std::uint32_t n = silent_in_a_row_;
  if (n == silent_slots_to_report || n % 100 == 0) {
    act(PayloadEvent{.kind = PayloadEvent::Kind::peripheral_silent, .number = n});
  }
  const std::uint32_t limit = settings_.silent_slots_to_power_cycle;
  if (limit > 0 && n % limit == 0) {
    power_needed_ = true;
    reset_reason_ = detail;
  }
}

void PayloadCycle::abandon_slot(const std::string& detail, MonotonicTime now) {
  if (step_ == Step::commanding || step_ == Step::resetting) retry_command(mission::failure::bus_lost);
  act(AbortRequest{});
  fail_slot(detail, now);
}

void PayloadCycle::fail_slot(const std::string& detail, MonotonicTime now) {
  if (!failure_) failure_ = detail;
  drain(now);
}

// ---------------------------------------------------------------- release

MonotonicTime PayloadCycle::drain_deadline(MonotonicTime now) const {
  if (withdrawn_) return flag_.lease_end;
  if (recalled_) return now + settings_.drain_time;
  return std::min(std::max(flag_.allotted_end, now + settings_.drain_time),
                  flag_.lease_end - settings_.lease_margin);
}

void PayloadCycle::drain(MonotonicTime now) {
  // A command that did not come to run keeps its place; whatever is recorded as begun must have been sent.
  if (step_ != Step::draining && !power_command_) journal_.unmark_started();
  step_ = Step::draining;
  // A peripheral that did not even answer its reset is off before the next payload gets the bus.
  await_power_off_ = power_ == Power::switching_off;
  deadline_ = await_power_off_ ? flag_.lease_end - settings_.lease_margin : drain_deadline(now);
  if (!await_power_off_) act(AwaitQuiet{});
}

PayloadActions PayloadCycle::on_bus_quiet(MonotonicTime now) {
  if (step_ == Step::draining && !await_power_off_) release(now);
  if (step_ == Step::idle) answer_recall();
  return finish();
}

void PayloadCycle::stop_awaiting_power_off(MonotonicTime now) {
  if (step_ != Step::draining || !await_power_off_) return;
  await_power_off_ = false;
  deadline_ = drain_deadline(now);
  act(AwaitQuiet{});
}

void PayloadCycle::release(MonotonicTime now) {
  step_ = Step::idle;
  deadline_.reset();
  act(CloseBus{});
  const nanoseconds used = now - flag_.granted;
  statistics_.last_used = used;
  statistics_.used_total += used;
  statistics_.longest_used = std::max(statistics_.longest_used, used);
  ++(failure_ ? statistics_.slots_failed : statistics_.slots_used);
  last_status_ = PublishStatus{failure_ ? PublishStatus::Kind::failed : PublishStatus::Kind::released,
                               flag_.grant, used, failure_.value_or("")};
  act(*last_status_);
  if (block_) {
    ++processing_;
    act(ProcessMeasurement{flag_.cycle, std::move(*block_), statistics_});
    block_.reset();
  }
  if (power_command_) {
    start_power_cycle("by telecommand", *power_command_, true);
    power_command_.reset();
  } else if (power_needed_ && power_ == Power::on) {
    start_power_cycle(reset_reason_, settings_.power_off_time, false);
    power_needed_ = false;
  }
}

PayloadActions PayloadCycle::on_processed(MonotonicTime /*now*/) {
  assert(processing_ > 0);
  --processing_;
  return finish();
}

// ---------------------------------------------------------------- time

std::optional<MonotonicTime> PayloadCycle::next_deadline() const {
  if (!deadline_) return power_deadline_;
  if (!power_deadline_) return deadline_;
  return std::min(*deadline_, *power_deadline_);
}

void PayloadCycle::on_frames_waited(MonotonicTime now) {
  const bool awaits_answer = step_ == Step::waking || step_ == Step::commanding || step_ == Step::ordering;
  if (!awaits_answer || now < *deadline_ + late_look || std::exchange(was_late_, true)) return;
  deadline_ = answer_deadline(now);
}

PayloadActions PayloadCycle::on_deadline(MonotonicTime now, bool own_frames_left) {
  if (power_deadline_ && now >= *power_deadline_) on_power_deadline();
  if (!deadline_ || now < *deadline_) return finish();
  switch (step_) {
    case Step::idle:
      deadline_.reset();
      break;
    case Step::waking:
      on_silence("no answer to the wake-up", own_frames_left, now);
      break;
    case Step::commanding:
      on_silence("no answer to a telecommand", own_frames_left, now);
      break;
    case Step::ordering:
      on_silence("no answer to an order of the mode", own_frames_left, now);
      break;
    case Step::resetting:
      on_no_answer(RequestFailure::silent, fmt::format("{}; no answer to the reset", reset_reason_), now);
      break;
    case Step::storing:
      // The record of the start takes too long for this slot.
      drain(now);
      break;
    case Step::draining:
      if (await_power_off_) {
        stop_awaiting_power_off(now);
        break;
      }
      if (!withdrawn_) {
        withdrawn_ = true;
        ++counters_.withdrawals;
        if (!failure_) failure_ = "own frames did not get the bus";
        deadline_ = drain_deadline(now);
        act(WithdrawFrames{});
        break;
      }
      // Only the fence can prove now that the frames are gone; a late echo still releases.
      if (!stuck_counted_) ++counters_.stuck_frames;
      stuck_counted_ = true;
      deadline_.reset();
      act(AbortRequest{});
      break;
  }
  return finish();
}

// ---------------------------------------------------------------- power switch

void PayloadCycle::start_power_cycle(const std::string& reason, nanoseconds off_time, bool by_command) {
  ++counters_.power_cycles;
  if (!by_command) journal_.on_ids_lost();
  note_ids_lost(!journal_.is_durable());
  power_reason_ = reason;
  power_off_time_ = off_time;
  power_by_command_ = by_command;
  if (by_command) {
    babble_.forgive();
    keep_off(false);
  }
  power_deadline_.reset();  // a switch-on that failed before is not tried again behind this
  power_ = Power::switching_off;
  act(SwitchPower{false});
}

void PayloadCycle::on_power_deadline() {
  power_deadline_.reset();
  keep_off(false);  // if it was: one trial, for the monitor remembers the cycles in vain
  if (power_ == Power::off) power_ = Power::switching_on;
  act(SwitchPower{true});
}

PayloadActions PayloadCycle::on_power_switched(bool on, bool ok, MonotonicTime now, bool was_on) {
  if (on) {
    // Off, and not by us: by a process that died before it could write down what that means, or by the
    // switcher while there was none. The switcher may have held the line when it was tried first.
    if (!was_on && power_reason_.empty()) journal_.on_ids_lost();
    on_switched_on(ok, now);
  } else if (power_ == Power::switching_off) {
    on_switched_off(ok, now);
    stop_awaiting_power_off(now);
  }
  return finish();
}

void PayloadCycle::on_switched_off(bool ok, MonotonicTime now) {
  const bool stays = std::exchange(keep_off_wanted_, false) || kept_off_;
  if (!ok) {
    end_power_cycle(mission::failure::power_switch_failed);
    // It may obey all the same, later than it was waited for.
    if (kept_off_) {
      power_deadline_ = kept_off_until_;
    } else {
      act(SwitchPower{true});
    }
    return;
  }
  power_ = Power::off;
  if (stays && !kept_off_) {
    kept_off_until_ = now + kept_off_time();
    keep_off(true);
    act(PayloadEvent{.kind = PayloadEvent::Kind::peripheral_kept_off, .number = babble_.in_a_row()});
  }
  power_deadline_ =
      stays ? kept_off_until_ : now + power_off_time_;  // not that of a switch-on that did not obey
}

void PayloadCycle::note_ids_lost(bool lost) {
  if (std::exchange(ids_lost_, lost) != lost) act(RememberIdsLost{lost});
}

void PayloadCycle::keep_off(bool off) {
  if (kept_off_ == off) return;
  kept_off_ = off;
  act(RememberKeptOff{.kept_off = off, .until = kept_off_until_});
}

nanoseconds PayloadCycle::kept_off_time() const {
  nanoseconds time = settings_.kept_off_time;
  const std::uint32_t in_a_row = babble_.in_a_row();
  for (std::uint32_t i = settings_.babble.power_cycles; i < in_a_row && time < settings_.kept_off_time_max;
       ++i)
    time *= 2;
  return std::min(time, settings_.kept_off_time_max);
}

PayloadActions PayloadCycle::on_unsolicited_frame(MonotonicTime now) {
  // What is being switched off already, or after the release, needs no judgement.
  if (power_ != Power::on || power_command_) return {};
  const BabbleMonitor::Verdict verdict = babble_.on_unsolicited_frame(now);
  if (verdict == BabbleMonitor::Verdict::tolerable) return {};
  ++counters_.babble_cuts;
  keep_off_wanted_ = verdict == BabbleMonitor::Verdict::keep_off;
  act(PayloadEvent{.kind = PayloadEvent::Kind::peripheral_babbles, .number = babble_.in_a_row()});
  start_power_cycle("it babbles", settings_.power_off_time, false);
  return finish();
}

void PayloadCycle::on_switched_on(bool ok, MonotonicTime now) {
  // A switch that does not obey is tried again; meanwhile the slots go on and show whether the peripheral
  // lives.
  if (!ok) power_deadline_ = now + settings_.power_retry;
  if (ok) babble_.on_switched_on(now);
  if (ok && power_ == Power::switching_on) orders_.on_peripheral_restarted(now);
  if (power_ != Power::switching_on) return;
  if (ok && !power_reason_.empty()) {
    act(PayloadEvent{.kind = PayloadEvent::Kind::peripheral_power_cycled, .text = power_reason_});
  }
  end_power_cycle(ok ? mission::failure::none : mission::failure::power_switch_failed);
}

void PayloadCycle::end_power_cycle(FailureCode outcome) {
  power_ = Power::on;
  power_reason_.clear();
  if (std::exchange(power_by_command_, false)) end_command(outcome);
}

// ---------------------------------------------------------------- telecommands

PayloadActions PayloadCycle::on_telecommand(StoredTelecommand telecommand, MonotonicTime now) {
  if (journal_.repeat_reports(telecommand.id)) return finish();
  const auto command = decode_(telecommand.function, telecommand.arguments);
  if (!active_) {
    journal_.refuse(telecommand.id, mission::failure::node_not_active);
  } else if (!command) {
    journal_.refuse(telecommand.id, command.error());
  } else if (telecommand.has_expired(now)) {
    journal_.refuse(telecommand.id, mission::failure::expired);
  } else {
    journal_.add(std::move(telecommand));
  }
  return finish();
}

PayloadActions PayloadCycle::on_journal_written(std::uint64_t revision, bool ok, MonotonicTime now) {
  journal_.on_written(revision, ok);
  if (journal_.is_durable()) note_ids_lost(false);
  if (step_ == Step::storing) {
    if (!ok) {
      fail_slot("the start of a telecommand could not be stored", now);
    } else if (journal_.start_is_durable()) {
      run_next_command(now);
    }
  }
  return finish();
}

}  // namespace srfs
