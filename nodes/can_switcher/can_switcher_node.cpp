// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/can_switcher_node.hpp"

#include <sys/epoll.h>

#include <algorithm>

#include <fmt/ranges.h>

#include <mission/structures.hpp>

#include "base/saturate.hpp"
#include "hw/open.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/can_switcher/holder_kill.hpp"
#include "nodes/can_switcher/power_lines.hpp"
#include "suite/ring/heartbeat_page.hpp"

namespace srfs {
namespace {

using ros::CallbackReturn;

constexpr nanoseconds housekeeping_period = seconds(1);
constexpr nanoseconds failure_event_period = seconds(10);  // per payload
constexpr const char* timing_node = "timing";              // whose ticks these are

std::vector<Slot> plan_of(const suite::Bus& bus) {
  std::vector<Slot> slots;
  slots.reserve(bus.slots.size());
  for (const suite::Slot& slot : bus.slots)
    slots.push_back({slot.payload, slot.allotted, slot.overrun, slot.reset});
  return slots;
}

}  // namespace

CanSwitcherNode::CanSwitcherNode(suite::NodeContext& context) : Node(context) {
  declare_parameter("fence_wait_ms", std::int64_t{500}, ros::ParameterRange{10, 10000},
                    "Time a killed holder has to exit before it is killed again and reported", true);
  declare_parameter("recall_ms", std::int64_t{3000}, ros::ParameterRange{100, 60000},
                    "Time the holder left by an earlier switcher has to answer before it is fenced", true);
  declare_parameter(
      "rotation_order", std::vector<std::string>{},
      "Payloads in slot order; a payload not named gets no slot; empty: the deployment's slots");
  declare_parameter("early_handover", false,
                    "A slot released without a frame goes to the next payload at once, not at the next tick");
  declare_parameter("apid", std::int64_t{mission::CanSwitcherHousekeeping::apid},
                    ros::ParameterRange{1, 2046},
                    "APID of this node in the dictionary; of the switcher of a further bus, its own", true);
  declare_parameter("structure", std::int64_t{mission::CanSwitcherHousekeeping::structure_id},
                    ros::ParameterRange{1, 65535},
                    "Housekeeping structure with the content of can_switcher, of this node", true);
  declare_parameter("bus_structure", std::int64_t{mission::CanBusHousekeeping::structure_id},
                    ros::ParameterRange{1, 65535}, "The same of can_bus", true);
  declare_parameter("work_structure", std::int64_t{mission::CanSwitcherWorkHousekeeping::structure_id},
                    ros::ParameterRange{1, 65535}, "The same of can_switcher_work", true);
  on_parameter_check([this](const std::string& parameter,
                            const ros::ParameterValue& value) -> Result<void, std::string> {
    if (parameter != "rotation_order") return {};
    const auto& payloads = std::get<std::vector<std::string>>(value);
    for (const std::string& payload : payloads) {
      const auto& slots = bus().slots;
      const bool known =
          !payload.empty() &&
          std::any_of(slots.begin(), slots.end(), [&](const suite::Slot& s) { return s.payload == payload; });
      if (!known) return Err(fmt::format("rotation_order: '{}' has no slot in the deployment", payload));
      if (std::count(payloads.begin(), payloads.end(), payload) > 1)
        return Err(fmt::format("rotation_order: '{}' appears twice", payload));
    }
    return {};
  });
  on_parameter_change([this](const std::string&) { apply_parameters(); });
}

void CanSwitcherNode::apply_parameters() {
  if (!rotation_) return;
  rotation_->set_early_handover(get_parameter<bool>("early_handover"));
  if (!rotation_->set_order(turns()))
    log::error("rotation_order does not order the payloads: order unchanged");
}

std::vector<std::string> CanSwitcherNode::turns() const {
  const auto all = suite::turns_of(bus().slots);
  auto order = get_parameter<std::vector<std::string>>("rotation_order");
  std::erase_if(order, [&](const std::string& payload) {  // it may have been removed since
    return std::find(all.begin(), all.end(), payload) == all.end();
  });
  return order.empty() ? all : order;
}

void CanSwitcherNode::on_deployment_changed() {
  if (rotation_) take_plan();
  place_peripherals();
}

void CanSwitcherNode::place_peripherals() {
  static_assert(suite::Peripheral::power_lines == hw::gpio_power_count);
  std::vector<suite::Peripheral> ours = deployment().peripherals;
  std::erase_if(ours, [this](const suite::Peripheral& p) { return p.bus != bus().name; });
  power_cut_.place(ours);
  if (listener_) listener_->unattended().place(ours);
}

void CanSwitcherNode::take_plan() {
  const auto before = rotation_->turns();
  plan_waits_ = !rotation_->set_plan(plan_of(bus()), turns());
  failure_reported_.resize(rotation_->slots().size());
  slot_use_.resize(rotation_->slots().size());
  const auto now_turns = rotation_->turns();
  if (now_turns == before) return;
  constexpr std::size_t longest_text = 190;
  const std::string text = fmt::format("{}", fmt::join(now_turns, ", ")).substr(0, longest_text);
  log::info("slots: {}", text);
  raise(mission::CanSwitcherPlanChangedEvent{.slots = text});
}

// ---------------------------------------------------------------- lifecycle

CallbackReturn CanSwitcherNode::on_configure() {
  const std::size_t count = bus().slots.size();
  if (suite::turns_of(bus().slots).empty() || count > suite::slots_at_most) {
    set_failure_reason(fmt::format("{}: 'slots': expected 1 to {} entries, found {}",
                                   deployment().file.string(), suite::slots_at_most, count));
    return CallbackReturn::failure;
  }
  read_payloads();
  make_rotation();
  apply_parameters();
  if (!fence_) fence_.emplace(milliseconds(get_parameter<std::int64_t>("fence_wait_ms")));
  open_topics();
  open_bus();
  if (draining_ || (rotation_->awaits_fence() && !fence_->busy())) drain_transmit_queue();
  record_holder();
  arm_deadline();
  housekeeping_timer_ = create_timer(
      housekeeping_period, [this] { publish_housekeeping(); }, "housekeeping");
  return CallbackReturn::success;
}

void CanSwitcherNode::make_rotation() {
  std::optional<InheritedGrant> granted;
  if (!rotation_) {
    auto record = HolderRecord::open(var().holder_of(bus().name));
    if (record) {
      holder_record_ = std::move(*record);
    } else {
      log::error("{}; a restarted switcher will not know the bus holder", record.error());
    }
    granted = inherited(holder_record_ ? holder_record_->read() : std::nullopt);
    rotation_.emplace(plan_of(bus()), incarnation(), monotonic_now(), granted);
    if (!granted) rotation_->await_empty_queue(monotonic_now());
    rotation_->set_recall_time(milliseconds(get_parameter<std::int64_t>("recall_ms")));
    rotation_->suspend();
    failure_reported_.resize(rotation_->slots().size());
    slot_use_.resize(rotation_->slots().size());
  } else if (rotation_->awaits_release()) {
    // Since this node was unconfigured, the end of the slot was not monitored.
    const auto holder = rotation_->holder();
    granted = inherited(HolderRecord::Holder{holder->slot, holder->process});
    rotation_->inherit(*granted, monotonic_now());
  }
  if (granted && granted->process)
    log::warn("{} was granted the bus and has not been supervised since: recalling it", granted->payload);
}

std::optional<InheritedGrant> CanSwitcherNode::inherited(
    const std::optional<HolderRecord::Holder>& holder) const {
  // The process of a payload that was removed meanwhile is gone: it was ended before.
  if (!holder || holder->slot >= bus().slots.size() || bus().slots[holder->slot].payload.empty())
    return std::nullopt;
  InheritedGrant granted{bus().slots[holder->slot].payload, std::nullopt};
  const auto process = holder->process != 0 ? std::optional(holder->process) : std::nullopt;
  const auto instance = suite::find_instance(var(), granted.payload);
  // A process without a number has not opened the bus yet.
  if (instance && instance->incarnation != 0 && is_holder(instance->incarnation, process))
    granted.process = instance->incarnation;
  return granted;
}

void CanSwitcherNode::open_topics() {
  flags_ = create_publisher(suite::topics::task_flags);
  resets_ = create_publisher(suite::topics::reset_peripheral);
  statuses_ = create_subscription(suite::topics::bus_status,
                                  [this](const srfs_msgs::msg::BusStatus& status) { on_bus_status(status); });
  ticks_ = create_subscription(suite::topics::time_tick,
                               [this](const srfs_msgs::msg::TimeTick& tick, const ros::MessageInfo& info) {
                                 on_tick(tick, info.received);
                               });
}

void CanSwitcherNode::open_bus() {
  if (!deployment().devices.contains(bus().name)) return;
  listener_ = BusListener::open(device(bus().name), var().root);
  if (!listener_) return;
  place_peripherals();
  listen_timer_ = create_timer(
      BusListener::period, [this] { listen(); }, "can");
  if (!deployment().devices.contains("gpio")) return;
  gpio_worker_ = create_worker("gpio", 2 * suite::Peripheral::power_lines);
}

void CanSwitcherNode::record_holder() {
  if (!holder_record_) return;
  const auto holder = rotation_->holder();
  holder_record_->write(holder ? std::optional(HolderRecord::Holder{holder->slot, holder->process})
                               : std::nullopt);
}

CallbackReturn CanSwitcherNode::on_activate() {
  rotation_->resume(monotonic_now());
  holdover_.rest();
  nanoseconds wait{0};
  for (const Slot& slot : rotation_->slots()) wait = std::max(wait, slot.lease());
  if (rotation_->counters().ticks == 0) {
    raise(mission::CanSwitcherWaitsOutLeaseEvent{.wait_ms =
                                                     static_cast<std::uint32_t>(wait / milliseconds(1))});
  }
  return CallbackReturn::success;
}

CallbackReturn CanSwitcherNode::on_deactivate() {
  // A running slot is still watched: its end, its overrun, its fence.
  rotation_->suspend();
  holdover_.rest();
  arm_substitute();
  return CallbackReturn::success;
}

void CanSwitcherNode::close() {
  substitute_timer_.reset();
  substitute_armed_.reset();
  housekeeping_timer_.reset();
  listen_timer_.reset();
  drain_timer_.reset();
  if (gpio_worker_) gpio_worker_->drain();
  power_lines_ = {};
  power_cut_.close();
  gpio_worker_.reset();
  listener_.reset();
  deadline_timer_.reset();
  armed_.reset();
  ticks_.reset();
  statuses_.reset();
  flags_.reset();
  resets_.reset();
}

CallbackReturn CanSwitcherNode::on_cleanup() {
  close();
  return CallbackReturn::success;
}

CallbackReturn CanSwitcherNode::on_shutdown() {
  if (rotation_) rotation_->suspend();
  close();
  return CallbackReturn::success;
}

CallbackReturn CanSwitcherNode::on_error() {
  return on_shutdown();
}

// ---------------------------------------------------------------- rotation

std::optional<mission::WorkThreadStructure> CanSwitcherNode::work_structure() const {
  return mission::WorkThreadStructure{name(), of_dictionary("apid"), of_dictionary("work_structure")};
}

std::uint16_t CanSwitcherNode::of_dictionary(const char* parameter) const {
  return static_cast<std::uint16_t>(get_parameter<std::int64_t>(parameter));
}

suite::WorkStatus CanSwitcherNode::work_status() const {
  suite::WorkStatus work;
  work.done = static_cast<std::uint32_t>(flag_latency_.count());
  for (const auto& due : {armed_, substitute_armed_}) {
    if (!due || *due > now()) continue;
    ++work.due;
    work.oldest_due = work.oldest_due ? std::min(*work.oldest_due, *due) : *due;
  }
  return work;
}

void CanSwitcherNode::on_tick(const srfs_msgs::msg::TimeTick& tick, MonotonicTime received) {
  time_.on_tick(tick);
  if (!is_active()) return;
  const auto due = static_cast<std::int64_t>(std::min<std::uint64_t>(tick.monotonic_ns, INT64_MAX));
  run(holdover_.on_tick({.cycle = tick.cycle,
                         .due = MonotonicTime(nanoseconds(due)),
                         .period = microseconds(tick.period_us),
                         .received = received}));
  arm_substitute();
}

void CanSwitcherNode::run(HoldoverActions actions) {
  holdover_actions_.run(std::move(actions), [this](const HoldoverAction& action) {
    std::visit([this](const auto& a) { carry_out(a); }, action);
  });
}

void CanSwitcherNode::carry_out(const Beat& action) {
  // This thread may be the late one: a release that waits in the reader does not block the beat.
  if (rotation_->holder()) statuses_->take_waiting();
  // A deadline that passed while the tick was on its way comes first.
  on_deadline();
  RotationActions actions = rotation_->on_tick(monotonic_now(), holdover_.cycle(), action.received);
  const bool grants = !actions.empty() && std::holds_alternative<Grant>(actions.front());
  run(std::move(actions));
  if (grants && !action.is_substitute) flag_latency_.add(monotonic_now() - action.received);
}

void CanSwitcherNode::arm_substitute() {
  const auto due = holdover_.next_substitute();
  if (due == substitute_armed_) return;
  substitute_armed_ = due;
  substitute_timer_.reset();
  if (due)
    substitute_timer_ = create_one_shot(
        *due,
        [this] {
          substitute_armed_.reset();
          on_tick_missing();
        },
        "substitute tick");
}

void CanSwitcherNode::on_tick_missing() {
  // This thread may be the late one: a tick that waits in the reader is no missing one.
  ticks_->take_waiting();
  const MonotonicTime t = monotonic_now();
  if (const auto due = holdover_.next_substitute(); due && *due <= t) {
    run(ticks_were_stopped() ? holdover_.stop(t) : holdover_.on_deadline(t));
  }
  arm_substitute();
}

bool CanSwitcherNode::ticks_were_stopped() const {
  // Both on tmpfs or in the page cache, and asked for only while ticks are missing.
  const auto page = suite::HeartbeatPage::read(var(), timing_node);
  const bool by_command = page && page->desired != 0 &&  // 0: it starts, and is on its way to what it was
                          page->desired != static_cast<std::uint32_t>(ros::State::active);
  std::error_code ec;
  return by_command || std::filesystem::exists(var().stopping_flag(), ec);
}

void CanSwitcherNode::carry_out(const ReportTicksMissing& action) {
  log::warn("no tick since cycle {}: the rotation continues with substitute ticks", action.cycle);
  raise(mission::CanSwitcherTicksMissingEvent{.cycle = action.cycle});
}

void CanSwitcherNode::carry_out(const ReportTicksBack& action) {
  const auto lasted_ms = static_cast<std::uint32_t>(action.lasted / milliseconds(1));
  log::info("ticks are back after {} substitute ticks in {} ms", action.substitutes, lasted_ms);
  raise(mission::CanSwitcherTicksBackEvent{.substitutes = action.substitutes, .lasted_ms = lasted_ms});
}

void CanSwitcherNode::run(RotationActions actions) {
  rotation_actions_.run(std::move(actions), [this](const RotationAction& action) {
    std::visit([this](const auto& a) { carry_out(a); }, action);
  });
  arm_deadline();
}

/// Opens the accounting of the holder's process, which lives as long as the process, and records its values
/// as of the grant or of the first recall. A recall that is repeated goes on with them.
void CanSwitcherNode::watch_holder() {
  const auto holder = rotation_->holder();
  if (!holder || holder->process == 0) return;
  if (holders_.size() <= holder->slot) holders_.resize(holder->slot + 1);
  HolderWatch& watch = holders_[holder->slot];
  if (watch.process != holder->process) {
    watch = HolderWatch{.process = holder->process};
    const auto instance = suite::find_instance(var(), rotation_->slots()[holder->slot].payload);
    if (instance && instance->incarnation == holder->process)
      watch.cpu = suite::ProcessCpu::open(instance->pid);
  }
  if (!watch.cpu) return;
  const auto totals = watch.cpu->read(true, monotonic_now());
  const bool is_repeated = std::exchange(watch.grant, rotation_->current()->id) == rotation_->current()->id;
  if (totals && !is_repeated) watch.at_grant = *totals;
  watch_simulator(is_repeated);
}

/// A simulated bus lets the holder's frames leave when its process has a CPU: what it waits keeps the holder
/// from releasing.
void CanSwitcherNode::watch_simulator(bool is_repeated) {
  const pid_t process = listener_ ? listener_->bus().simulator() : 0;
  if (process != simulator_.process) {
    simulator_ = SimulatorWatch{.process = process, .cpu = ThreadCpuFiles::open(process, process)};
    is_repeated = false;
  }
  const auto waited = read_simulator();
  if (!waited) simulator_.process = 0;  // it has ended; the next one may have its number
  if (!waited || is_repeated) return;
  simulator_.grant = rotation_->current()->id;
  simulator_.waited_at_grant = *waited;
}

std::optional<nanoseconds> CanSwitcherNode::read_simulator() {
  const auto cpu = simulator_.cpu ? simulator_.cpu->read() : std::nullopt;
  if (!cpu) return std::nullopt;
  simulator_.is_runnable = simulator_.cpu->state() == 'R';
  simulator_.wait.on_reading(*cpu, simulator_.is_runnable, monotonic_now());
  return simulator_.wait.total();
}

std::optional<HolderCpu> CanSwitcherNode::holder_cpu() {
  const auto holder = rotation_->holder();
  if (!holder || holder->process == 0 || holders_.size() <= holder->slot) return std::nullopt;
  HolderWatch& watch = holders_[holder->slot];
  if (watch.process != holder->process || !watch.cpu) return std::nullopt;
  const auto totals = watch.cpu->read(true, monotonic_now());
  if (!totals) return std::nullopt;  // it has ended
  HolderCpu cpu{totals->any_waited - watch.at_grant.any_waited, totals->ran - watch.at_grant.ran,
                watch.cpu->is_runnable()};
  const auto played = read_simulator();
  if (played && simulator_.grant == rotation_->current()->id) {
    cpu.bus_waited = *played - simulator_.waited_at_grant;
    cpu.runnable = cpu.runnable || simulator_.is_runnable;
  }
  return cpu;
}

/// A flag without holder and without times. The message keeps its memory.
srfs_msgs::msg::TaskFlags& CanSwitcherNode::flag_of(GrantId id, MonotonicTime tick_received) {
  srfs_msgs::msg::TaskFlags& m = flag_;
  m.cycle = time_.cycle();
  m.switcher_incarnation = id.incarnation;
  m.grant_counter = id.counter;
  m.flags.assign(rotation_->slots().size(), false);
  m.holder.clear();
  m.tick_received_ns = static_cast<std::uint64_t>(tick_received.ns());
  m.allotted_us = 0;
  m.published_ns = static_cast<std::uint64_t>(monotonic_now().ns());
  m.lease_end_ns = m.published_ns;
  return m;
}

void CanSwitcherNode::carry_out(const Recall& action) {
  flags_->publish(flag_of(action.id, action.received));
  watch_holder();
}

void CanSwitcherNode::carry_out(const Grant& action) {
  // This process may have been stopped since the decision: the holder must not be killed for that.
  if (monotonic_now() >= action.granted + action.allotted) {
    rotation_->withdraw(action.id);
    return;
  }
  record_holder();
  srfs_msgs::msg::TaskFlags& m = flag_of(action.id, action.received);
  m.cycle = action.cycle;
  m.flags[action.slot] = true;
  m.holder = action.payload;
  m.allotted_us = as_us(action.allotted);
  m.lease_end_ns = static_cast<std::uint64_t>(action.lease_end.ns());
  flags_->publish(m);
  watch_holder();
}

void CanSwitcherNode::on_bus_status(const srfs_msgs::msg::BusStatus& status) {
  using Kind = BusReport::Kind;
  if (status.status < static_cast<std::uint8_t>(Kind::taken) ||
      status.status > static_cast<std::uint8_t>(Kind::failed)) {
    ++meaningless_statuses_;
    return;
  }
  const BusReport report{.kind = static_cast<Kind>(status.status),
                         .grant = {status.switcher_incarnation, status.grant_counter},
                         .payload = status.payload,
                         .payload_incarnation = status.payload_incarnation,
                         .unused = status.frames_sent == 0};
  const ReportVerdict verdict = rotation_->on_bus_status(report, monotonic_now());
  record_holder();
  if (verdict == ReportVerdict::applied && report.kind != Kind::taken) note_slot_use(status);
  if (verdict == ReportVerdict::applied && report.kind == Kind::failed) report_failed_slot(status);
  run(is_active() ? rotation_->on_early_release(monotonic_now()) : RotationActions());
}

void CanSwitcherNode::note_slot_use(const srfs_msgs::msg::BusStatus& status) {
  const Grant& grant = *rotation_->current();
  SlotUse& use = slot_use_[grant.slot];
  const nanoseconds used = microseconds(status.used_us);
  use.used += used;
  use.allotted += grant.allotted;
  use.longest = std::max(use.longest, used);
  if (used > grant.allotted) ++use.late;
}

void CanSwitcherNode::report_failed_slot(const srfs_msgs::msg::BusStatus& status) {
  auto& reported = failure_reported_[rotation_->current()->slot];
  if (reported && now() - *reported < failure_event_period) return;
  reported = now();
  log::warn("{} reported a failed slot: {}", status.payload, status.detail);
  raise(mission::CanSwitcherSlotFailedEvent{
      .payload = status.payload, .grant = status.grant_counter, .detail = status.detail});
}

void CanSwitcherNode::arm_deadline() {
  const auto deadline = rotation_->next_deadline();
  if (deadline == armed_) return;
  armed_ = deadline;
  deadline_timer_.reset();
  if (deadline)
    deadline_timer_ = create_one_shot(
        *deadline,
        [this] {
          armed_.reset();
          on_deadline();
        },
        "slot deadline");
}

void CanSwitcherNode::on_deadline() {
  const auto due = rotation_->next_deadline();
  if (!due || monotonic_now() < *due) {
    arm_deadline();
    return;
  }
  // This thread may be the late one: a release that waits in the reader counts before the holder is blamed.
  statuses_->take_waiting();
  const auto cpu = holder_cpu();
  run(rotation_->on_deadline(monotonic_now(), context().participant.transport_stats().last_datagram, cpu));
  record_holder();
}

void CanSwitcherNode::carry_out(const ReportDoubt& action) {
  switch (action.why) {
    case ReportDoubt::Why::starved:
      log::warn("{} got no CPU{} to release the bus at the end of its lease: waiting for it", action.payload,
                simulator_.cpu ? ", or its simulated bus got none," : "");
      break;
    case ReportDoubt::Why::deaf:
      log::warn("no datagram received at the end of the lease of {}: not accusing it", action.payload);
      break;
    case ReportDoubt::Why::held_up:
      log::warn("this switcher was deaf or late at the end of the lease of {}: asking before killing it",
                action.payload);
      break;
  }
}

void CanSwitcherNode::carry_out(const OrderReset& action) {
  srfs_msgs::msg::PeripheralReset m;
  m.switcher_incarnation = action.id.incarnation;
  m.grant_counter = action.id.counter;
  m.payload = action.payload;
  m.reason = fmt::format("bus held for {} ms", action.held / milliseconds(1));
  resets_->publish(m);
  ++resets_sent_;
  log::warn("{} overran its slot (grant {}.{}): {}", action.payload, action.id.incarnation, action.id.counter,
            m.reason);
  raise(mission::CanSwitcherOverrunEvent{
      .payload = action.payload, .grant = action.id.counter, .held_us = as_us(action.held)});
}

// ---------------------------------------------------------------- the fence

void CanSwitcherNode::carry_out(const Fence& action) {
  const auto& cpu = action.cpu;
  const std::string had = cpu ? fmt::format(", in which it ran {} and waited {} ms for a CPU",
                                            cpu->ran / milliseconds(1), cpu->waited / milliseconds(1))
                              : std::string();
  log::error("{} did not release the bus before the end of its lease (grant {}.{}){}: killing it",
             action.payload, action.id.incarnation, action.id.counter, had);
  raise(mission::CanSwitcherHolderFencedEvent{.payload = action.payload, .grant = action.id.counter});
  run(fence_->fence(action.payload, action.process));
}

void CanSwitcherNode::run(FenceActions actions) {
  fence_actions_.run(std::move(actions), [this](const FenceAction& action) {
    std::visit([this](const auto& a) { carry_out(a); }, action);
  });
}

void CanSwitcherNode::carry_out(const KillHolder& action) {
  exit_watch_.reset();
  HolderKill kill = kill_holder([&]() -> std::optional<pid_t> {
    const auto instance = suite::find_instance(var(), action.payload);
    if (!instance || !is_holder(instance->incarnation, action.process)) return std::nullopt;
    return instance->pid;
  });
  holder_pidfd_ = std::move(kill.pidfd);
  run(fence_->on_killed(kill.is_there, kill.problem));
}

void CanSwitcherNode::carry_out(const AwaitExit& action) {
  if (holder_pidfd_) {
    exit_watch_ = watch_fd(
        holder_pidfd_.get(), EPOLLIN, [this](std::uint32_t) { run(fence_->on_exit()); }, "fence");
  }
  fence_timer_ = create_one_shot(
      monotonic_now() + action.wait, [this] { run(fence_->on_wait_over()); }, "fence");
}

void CanSwitcherNode::carry_out(const HolderGone& /*action*/) {
  exit_watch_.reset();
  fence_timer_.reset();
  holder_pidfd_.reset();
  drain_transmit_queue();
}

void CanSwitcherNode::carry_out(const FenceUnproven& action) {
  report_unproven(action.why);
}

void CanSwitcherNode::report_unproven(const std::string& why) {
  const std::string& granted = rotation_->current()->payload;
  const std::string payload = granted.empty() ? "an earlier holder" : granted;
  rotation_->on_fence_unproven();
  log::fatal("{} may still write, the bus stays blocked: {}", payload, why);
  raise(mission::CanSwitcherFenceUnprovenEvent{.payload = payload, .why = why});
}

void CanSwitcherNode::drain_transmit_queue() {
  draining_ = true;
  if (!flags_) return;  // unconfigured meanwhile: on_configure() goes on
  drain_.emplace();
  drain_timer_ = create_timer(
      TransmitDrain::period, [this] { step_drain(); }, "drain");
  step_drain();
}

void CanSwitcherNode::step_drain() {
  using State = TransmitDrain::State;
  State state = State::empty;  // without a handle there is nothing to ask
  if (listener_) {
    listen();
    state = drain_->step(listener_->bus(), monotonic_now());
  }
  if (state == State::waiting) return;
  if (state == State::unproven) {
    report_unproven("its frames do not get the bus and cannot be withdrawn");
    return;
  }
  drain_timer_.reset();
  draining_ = false;
  rotation_->on_fenced(rotation_->current()->id, monotonic_now());
  record_holder();
}

void CanSwitcherNode::listen() {
  listener_->listen();
  if (!gpio_worker_) return;
  const auto attended = [this](std::string_view payload) {
    return suite::find_instance(var(), std::string(payload)).has_value();
  };
  for (const suite::Peripheral& peripheral : listener_->unattended().babbling(attended))
    run(power_cut_.cut(peripheral));
  run(power_cut_.give_back(attended));
}

void CanSwitcherNode::run(PowerActions actions) {
  power_actions_.run(std::move(actions), [this](const PowerAction& action) {
    std::visit([this](const auto& a) { carry_out(a); }, action);
  });
}

void CanSwitcherNode::carry_out(const CutPower& action) {
  const auto attended = [paths = var()](std::string_view payload) {
    return suite::find_instance(paths, std::string(payload)).has_value();
  };
  const auto open_chip = [root = var().root,
                          uri = device("gpio")]() -> Result<std::unique_ptr<hw::GpioLines>, std::string> {
    auto opened = hw::open_gpio(uri, root);
    if (!opened) return Err(opened.error().message);
    return std::move(*opened);
  };
  const bool taken = gpio_worker_->ask(
      [access = PowerAccess{attended, open_chip}, peripheral = action.peripheral,
       &lines = power_lines_.at(action.peripheral.power_line)] {
        return cut_power(peripheral, lines, access);
      },
      [this, peripheral = action.peripheral](const std::optional<Result<void, hw::GpioError>>& set) {
        run(power_cut_.on_cut(peripheral, set));
      });
  if (!taken) power_cut_.on_refused(action.peripheral);
}

void CanSwitcherNode::carry_out(const GiveBackLines& action) {
  const bool taken =
      gpio_worker_->post([&lines = power_lines_.at(action.peripheral.power_line)] { lines.reset(); },
                         [this, peripheral = action.peripheral] { power_cut_.on_given_back(peripheral); });
  if (!taken) power_cut_.on_refused(action.peripheral);
}

void CanSwitcherNode::carry_out(const ReportPowerCut& action) {
  log::error("the peripheral of {} babbles and its payload has no process: switched off",
             action.peripheral.payload);
  raise(mission::CanSwitcherPeripheralCutEvent{.payload = action.peripheral.payload});
}

void CanSwitcherNode::carry_out(const ReportCutFailed& action) {
  log::error("the peripheral of {} babbles and cannot be switched off ({} tries): {}",
             action.peripheral.payload, action.tries, hw::to_string(action.why));
}

// ---------------------------------------------------------------- housekeeping

/// Where the payloads of the dictionary stand, in its order; when it cannot be read, those of the slots.
void CanSwitcherNode::read_payloads() {
  try {
    payloads_ = mission::Dictionary::payloads_of(mission::Dictionary::default_folder());
  } catch (const ConfigError& e) {
    log::error("{}; counters per payload are in slot order", e.what());
    payloads_ = suite::turns_of(bus().slots);
  }
  if (payloads_.size() > mission::most_payloads) payloads_.resize(mission::most_payloads);
}

std::optional<std::size_t> CanSwitcherNode::place_in_telemetry(std::size_t slot) const {
  const auto found = std::find(payloads_.begin(), payloads_.end(), rotation_->slots()[slot].payload);
  if (found == payloads_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - payloads_.begin());
}

void CanSwitcherNode::publish_housekeeping() {
  if (plan_waits_) take_plan();
  if (listener_) publish_bus_statistics();
  const TaskFlagRotation::Counters& counters = rotation_->counters();
  const TickHoldover::Counters& ticks = holdover_.counters();
  mission::CanSwitcherHousekeeping hk;
  hk.cycle = time_.cycle();
  for (auto* list : {&hk.grants, &hk.releases, &hk.failures, &hk.not_taken, &hk.unused})
    list->resize(payloads_.size());
  for (std::size_t i = 0; i < rotation_->slots().size(); ++i) {
    const TaskFlagRotation::SlotCounters& slot = rotation_->slot_counters(i);
    if (const auto at = place_in_telemetry(i)) {
      hk.grants[*at] = slot.granted;
      hk.releases[*at] = slot.released;
      hk.failures[*at] = slot.failed;
      hk.not_taken[*at] = slot.not_taken;
      hk.unused[*at] = slot.unused;
    }
    hk.overruns += slot.overruns;
    hk.fences += slot.fences;
  }
  hk.ticks = ticks.ticks;
  hk.repeated_ticks = ticks.repeated;
  hk.waiting_ticks = counters.waiting_ticks;
  hk.idle_ticks = counters.idle_ticks;
  hk.blocked_ticks = counters.blocked_ticks;
  hk.early_grants = counters.early_grants;
  hk.fences_unproven = counters.unproven_fences;
  hk.starved_holders = counters.starved_holders;
  hk.peripheral_resets = resets_sent_;
  hk.flag_latency_p50_us = as_us(flag_latency_.quantile(0.5));
  hk.flag_latency_p99_us = as_us(flag_latency_.quantile(0.99));
  hk.flag_latency_max_us = as_us(flag_latency_.max());
  hk.holder = rotation_->next_deadline() ? static_cast<std::uint8_t>(rotation_->current()->slot + 1)
                                         : std::uint8_t{0};
  hk.ticks_missed = ticks.missed_cycles;
  hk.status_rejected =
      counters.old_reports + counters.foreign_reports + counters.duplicate_reports + meaningless_statuses_;
  hk.dds_malformed = static_cast<std::uint32_t>(malformed_samples());
  hk.events_suppressed = static_cast<std::uint32_t>(suppressed_events());
  hk.flags_withheld = counters.withdrawn;
  hk.peripherals_cut = power_cut_.counters().cut;
  hk.power_cuts_failed = power_cut_.counters().failed;
  hk.ticks_substituted = ticks.substitutes;
  hk.ticks_superseded = ticks.made;
  hk.tick_outages = ticks.outages;
  publish_as("structure",
             suite::telemetry_message(name(), hk, hk.cycle, time_.utc_at(now()), time_.valid(), now()));
}

void CanSwitcherNode::publish_bus_statistics() {
  const BusMeter::Flood flood = listener_->end_window();
  report_flood(flood);
  const BusMeter& meter = listener_->meter();
  const hw::CanController controller = listener_->bus().controller();
  const hw::CanCounters& can = listener_->bus().counters();
  const auto percent = [](double share) { return static_cast<float>(100 * share); };
  constexpr std::uint16_t unknown = 0xFFFF;
  mission::CanBusHousekeeping hk;
  hk.cycle = time_.cycle();
  hk.load = percent(meter.last().load);
  hk.load_peak = percent(meter.peak());
  hk.flooded = meter.flooded();
  hk.floods = meter.counters().floods;
  hk.most_frequent = meter.last().most_frequent;
  hk.frames = meter.counters().frames;
  hk.foreign_frames = meter.counters().foreign_frames;
  hk.receive_overruns = as_u32(can.receive_overruns);
  hk.controller = static_cast<mission::CanControllerState>(controller.state);
  hk.transmit_errors = controller.transmit_errors.value_or(unknown);
  hk.receive_errors = controller.receive_errors.value_or(unknown);
  hk.bus_errors = as_u32(can.bus_errors);
  hk.arbitration_lost = as_u32(can.arbitration_lost);
  hk.bus_off = as_u32(can.bus_off);
  hk.controller_restarts = as_u32(can.restarts);
  hk.slot_use.resize(payloads_.size());
  for (auto* list : {&hk.longest_used_us, &hk.late_releases, &hk.overruns, &hk.fences})
    list->resize(payloads_.size());
  for (std::size_t i = 0; i < slot_use_.size(); ++i) {
    SlotUse& use = slot_use_[i];
    if (const auto at = place_in_telemetry(i)) {
      const double allotted = std::chrono::duration<double>(use.allotted).count();
      const double used = std::chrono::duration<double>(use.used).count();
      hk.slot_use[*at] = allotted > 0 ? percent(used / allotted) : 0;
      hk.longest_used_us[*at] = as_us(use.longest);
      hk.late_releases[*at] = use.late;
      hk.overruns[*at] = rotation_->slot_counters(i).overruns;
      hk.fences[*at] = rotation_->slot_counters(i).fences;
    }
    use.used = use.allotted = nanoseconds(0);
  }
  publish_as("bus_structure",
             suite::telemetry_message(name(), hk, hk.cycle, time_.utc_at(now()), time_.valid(), now()));
}

void CanSwitcherNode::publish_as(const char* structure, srfs_msgs::msg::PayloadTelemetry message) {
  message.apid = of_dictionary("apid");
  message.structure_id = of_dictionary(structure);
  publish_telemetry(message);
}

void CanSwitcherNode::report_flood(BusMeter::Flood flood) {
  const BusMeter& meter = listener_->meter();
  if (flood == BusMeter::Flood::began) {
    const double load = std::min(100.0, 100 * meter.last().load);
    log::error("the CAN bus is flooded: load {:.0f} %, identifier {:X}", load, meter.last().most_frequent);
    raise(mission::CanSwitcherBusFloodedEvent{.load = static_cast<std::uint8_t>(load),
                                              .identifier = meter.last().most_frequent});
  } else if (flood == BusMeter::Flood::ended) {
    log::info("the CAN bus is no longer flooded");
    raise(mission::CanSwitcherBusFloodOverEvent{
        .lasted_s = static_cast<std::uint32_t>(meter.flood_lasted() / seconds(1))});
  }
}

}  // namespace srfs
