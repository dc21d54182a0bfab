// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/switcher.hpp"

namespace srfs::simulation {
namespace {

std::vector<Slot> plan_of(const std::vector<suite::Slot>& deployed) {
  std::vector<Slot> slots;
  for (const suite::Slot& slot : deployed)
    slots.push_back({slot.payload, slot.allotted, slot.overrun, slot.reset});
  return slots;
}

}  // namespace

Switcher::Switcher(Host& host, SwitcherSurroundings surroundings)
    : host_(host),
      around_(std::move(surroundings)),
      can_(around_.can.open(host, {},
                            [this] {
                              while (can_->receive()) {
                              }
                            })),
      deadline_(host.kernel(), host.guard(), [this] { on_deadline(); }),
      substitute_(host.kernel(), host.guard(), [this] { on_tick_missing(); }),
      fence_wait_(host.kernel(), host.guard(), [this] { run(fence_.on_wait_over()); }),
      last_heard_(host.now()),
      watches_(around_.slots.size()) {}

void Switcher::start() {
  make_rotation();
  around_.topics.bus_status.subscribe(host_, [this](const auto& m, Host&) { on_bus_status(m); });
  around_.topics.time_tick.subscribe(host_, [this](const auto& m, Host&) { on_tick(m); });
  if (rotation_->awaits_fence()) drain();
  record_holder();
  rotation_->resume(host_.now());
  holdover_.rest();
  arm();
}

Switcher::~Switcher() {
  if (std::exchange(around_.ledger.open, std::nullopt)) ++around_.ledger.abandoned;
}

void Switcher::make_rotation() {
  std::optional<InheritedGrant> granted;
  if (const auto& holder = around_.record.holder) {
    const std::string payload = around_.slots[holder->slot].payload;
    granted = InheritedGrant{payload, std::nullopt};
    const auto process = holder->process != 0 ? std::optional(holder->process) : std::nullopt;
    const Host* const instance = around_.find(payload);
    if (instance->pid() != 0 && instance->is_up() && is_holder(instance->incarnation(), process))
      granted->process = instance->incarnation();
  }
  rotation_.emplace(plan_of(around_.slots), host_.incarnation(), host_.now(), granted);
  if (!granted) rotation_->await_empty_queue(host_.now());
  rotation_->suspend();
}

void Switcher::record_holder() {
  around_.record.holder = rotation_->holder();
}

void Switcher::note(const std::string& payload, SlotState state) {
  const auto of = static_cast<std::uint64_t>(around_.find(payload)->lane());
  host_.kernel().coverage().note(StateTable::slot, of, static_cast<std::uint8_t>(state));
}

void Switcher::arm() {
  deadline_.arm(rotation_->next_deadline());
  substitute_.arm(holdover_.next_substitute());
}

// ---------------------------------------------------------------- input

void Switcher::on_tick(const srfs_msgs::msg::TimeTick& tick) {
  last_heard_ = host_.now();
  cycle_ = tick.cycle;
  run(holdover_.on_tick({.cycle = tick.cycle,
                         .due = MonotonicTime(nanoseconds(static_cast<std::int64_t>(tick.monotonic_ns))),
                         .period = microseconds(tick.period_us),
                         .received = host_.now()}));
  arm();
}

void Switcher::on_tick_missing() {
  around_.topics.time_tick.take_waiting(host_);
  if (const auto due = holdover_.next_substitute(); due && *due <= host_.now())
    run(holdover_.on_deadline(host_.now()));
  arm();
}

void Switcher::on_bus_status(const srfs_msgs::msg::BusStatus& status) {
  last_heard_ = host_.now();
  const BusReport report{.kind = static_cast<BusReport::Kind>(status.status),
                         .grant = {status.switcher_incarnation, status.grant_counter},
                         .payload = status.payload,
                         .payload_incarnation = status.payload_incarnation,
                         .unused = status.frames_sent == 0};
  const ReportVerdict verdict = rotation_->on_bus_status(report, host_.now());
  record_holder();
  if (verdict == ReportVerdict::applied && report.kind != BusReport::Kind::taken) {
    if (around_.ledger.open == report.grant) around_.ledger.open.reset();
    ++(report.kind == BusReport::Kind::failed ? around_.ledger.failed : around_.ledger.released);
  }
  if (verdict == ReportVerdict::applied)
    note(report.payload, report.kind == BusReport::Kind::taken ? SlotState::taken : SlotState::free);
  run(rotation_->on_early_release(host_.now()));
}

void Switcher::on_deadline() {
  const auto due = rotation_->next_deadline();
  if (!due || host_.now() < *due) return arm();
  around_.topics.bus_status.take_waiting(host_);
  const auto cpu = holder_cpu();
  run(rotation_->on_deadline(host_.now(), last_heard_, cpu));
  record_holder();
}

/// As of the grant or of the first recall.
void Switcher::watch_holder() {
  const auto holder = rotation_->holder();
  if (!holder || holder->process == 0) return;
  const Host* const host = around_.find(around_.slots[holder->slot].payload);
  Watch& watch = watches_[holder->slot];
  if (host->incarnation() != holder->process || host->pid() == 0) return;
  const bool is_repeated = watch.pid == host->pid() && watch.grant == rotation_->current()->id;
  if (!is_repeated) watch = {host->pid(), rotation_->current()->id, host->waited(), host_.now()};
}

std::optional<HolderCpu> Switcher::holder_cpu() {
  const auto holder = rotation_->holder();
  if (!holder || holder->process == 0) return std::nullopt;
  const Host* const host = around_.find(around_.slots[holder->slot].payload);
  const Watch& watch = watches_[holder->slot];
  if (watch.pid == 0 || watch.pid != host->pid()) return std::nullopt;
  return HolderCpu{host->waited() - watch.waited, nanoseconds(0), host->waits_for_cpu()};
}

// ---------------------------------------------------------------- actions

void Switcher::run(HoldoverActions actions) {
  holdover_actions_.run(std::move(actions), [this](const HoldoverAction& action) {
    host_.action_point();
    std::visit([this](const auto& a) { carry_out(a); }, action);
  });
}

void Switcher::carry_out(const Beat& action) {
  on_deadline();
  run(rotation_->on_tick(host_.now(), holdover_.cycle(), action.received));
}

void Switcher::carry_out(const ReportTicksMissing& action) {
  host_.trace(host_.lane(), "ticks missing", action.cycle);
}

void Switcher::carry_out(const ReportTicksBack& action) {
  host_.trace(host_.lane(), "ticks back", action.substitutes);
}

void Switcher::run(RotationActions actions) {
  rotation_actions_.run(std::move(actions), [this](const RotationAction& action) {
    host_.action_point();
    std::visit([this](const auto& a) { carry_out(a); }, action);
  });
  arm();
}

srfs_msgs::msg::TaskFlags Switcher::flag_of(GrantId id, MonotonicTime tick_received) {
  auto& ledger = around_.ledger;
  if (id < ledger.newest) throw Violation{"M8", "a flag is older than one before"};
  ledger.newest = id;
  srfs_msgs::msg::TaskFlags m;
  m.cycle = cycle_;
  m.switcher_incarnation = id.incarnation;
  m.grant_counter = id.counter;
  m.flags.assign(around_.slots.size(), false);
  m.tick_received_ns = static_cast<std::uint64_t>(tick_received.ns());
  m.published_ns = m.lease_end_ns = static_cast<std::uint64_t>(host_.now().ns());
  return m;
}

void Switcher::carry_out(const Grant& action) {
  auto& ledger = around_.ledger;
  const std::uint32_t not_taken = rotation_->slot_counters(action.slot).not_taken;
  (void)not_taken;
  std::uint32_t all_not_taken = 0;
  for (std::size_t i = 0; i < around_.slots.size(); ++i)
    all_not_taken += rotation_->slot_counters(i).not_taken;
  if (ledger.open && all_not_taken == ledger.not_taken_before)
    throw Violation{"S4", "a slot ended and was not counted"};
  if (std::exchange(ledger.open, std::nullopt)) ++ledger.not_taken;
  for (const suite::Slot& slot : around_.slots) note(slot.payload, SlotState::free);  // all before ended
  ++ledger.granted;
  if (host_.now() >= action.granted + action.allotted) {
    rotation_->withdraw(action.id);
    ++ledger.withdrawn;
    return;
  }
  ledger.open = action.id;
  note(action.payload, SlotState::granted);
  ledger.not_taken_before = all_not_taken;
  record_holder();
  host_.trace(around_.find(action.payload)->lane(), "grant", action.id.incarnation, action.id.counter);
  srfs_msgs::msg::TaskFlags m = flag_of(action.id, action.received);
  m.cycle = action.cycle;
  m.flags[action.slot] = true;
  m.holder = action.payload;
  m.allotted_us = static_cast<std::uint32_t>(action.allotted / microseconds(1));
  m.lease_end_ns = static_cast<std::uint64_t>(action.lease_end.ns());
  around_.topics.task_flags.publish(host_, std::move(m));
  watch_holder();
}

void Switcher::carry_out(const Recall& action) {
  if (std::exchange(around_.ledger.open, std::nullopt)) ++around_.ledger.recalled;
  note(action.payload, SlotState::recalled);
  host_.trace(around_.find(action.payload)->lane(), "recall", action.id.incarnation, action.id.counter);
  around_.topics.task_flags.publish(host_, flag_of(action.id, action.received));
  watch_holder();
}

void Switcher::carry_out(const ReportDoubt& action) {
  host_.trace(host_.lane(), "doubt", static_cast<std::uint64_t>(action.why));
}

void Switcher::carry_out(const OrderReset& action) {
  srfs_msgs::msg::PeripheralReset m;
  m.switcher_incarnation = action.id.incarnation;
  m.grant_counter = action.id.counter;
  m.payload = action.payload;
  m.reason = "bus held";
  host_.trace(around_.find(action.payload)->lane(), "overrun: reset the peripheral", action.id.counter);
  note(action.payload, SlotState::reset_ordered);
  around_.topics.reset_peripheral.publish(host_, std::move(m));
}

void Switcher::carry_out(const Fence& action) {
  if (std::exchange(around_.ledger.open, std::nullopt)) ++around_.ledger.fenced;
  note(action.payload, SlotState::fencing);
  host_.trace(around_.find(action.payload)->lane(), "fence", action.id.incarnation, action.id.counter);
  run(fence_.fence(action.payload, action.process));
}

void Switcher::run(FenceActions actions) {
  fence_actions_.run(std::move(actions), [this](const FenceAction& action) {
    host_.action_point();
    std::visit([this](const auto& a) { carry_out(a); }, action);
  });
}

/// The process ends some time after the signal.
void Switcher::carry_out(const KillHolder& action) {
  Host* const target = around_.find(action.payload);
  const bool is_there = target->is_up() && is_holder(target->incarnation(), action.process);
  if (is_there) {
    const pid_t pid = target->pid();
    host_.output([this, target, pid, &own = host_, own_pid = host_.pid()] {
      own.kernel().later(milliseconds(2), [this, target, pid, &own, own_pid] {
        if (target->pid() == pid) target->end("SIGKILL of the fence");
        if (own.pid() == own_pid) own.give([this] { run(fence_.on_exit()); });
      });
    });
  }
  run(fence_.on_killed(is_there, std::nullopt));
}

void Switcher::carry_out(const AwaitExit& action) {
  fence_wait_.arm(host_.now() + action.wait);
}

void Switcher::carry_out(const HolderGone& /*action*/) {
  fence_wait_.arm(std::nullopt);
  drain();
}

void Switcher::carry_out(const FenceUnproven& /*action*/) {
  rotation_->on_fence_unproven();
}

void Switcher::drain() {
  draining_ = true;
  drain_.emplace();
  step_drain();
}

void Switcher::step_drain() {
  if (!draining_) return;
  while (can_->receive()) {
  }
  const auto state = drain_->step(*can_, host_.now());
  if (state == TransmitDrain::State::unproven) rotation_->on_fence_unproven();
  if (state != TransmitDrain::State::empty) {
    host_.later(TransmitDrain::period, [this] { step_drain(); });
    return;
  }
  draining_ = false;
  rotation_->on_fenced(rotation_->current()->id, host_.now());
  record_holder();
  arm();
}

}  // namespace srfs::simulation
