// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/payload_node.hpp"

#include <fcntl.h>
#include <malloc.h>
#include <sys/epoll.h>

#include <algorithm>
#include <thread>

#include "base/excerpt.hpp"
#include "base/file.hpp"
#include "base/private_file.hpp"
#include "base/process.hpp"
#include "base/saturate.hpp"
#include "base/text.hpp"
#include "hw/open.hpp"
#include "nodes/payload/frame_conversion.hpp"
#include "nodes/payload/kept_off.hpp"
#include "nodes/payload/payload_events.hpp"
#include "suite/commanding/messages.hpp"
#include "suite/state_files.hpp"
#include "wire/can_bits.hpp"

namespace srfs {
namespace {

using ros::CallbackReturn;

constexpr std::size_t longest_detail = 120;  // bound of BusStatus.detail
constexpr nanoseconds counters_period = seconds(5);
constexpr nanoseconds orders_retry_period = seconds(5);
constexpr int frames_per_turn = 128;  // the rest of a flood waits for other input
// Where the interface does not report it (docs/reference/icd_can.md).
constexpr std::uint32_t usual_bit_rate = 500'000;

std::uint64_t pack(GrantId grant) {
  return std::uint64_t{grant.incarnation} << 32U | grant.counter;
}
std::uint64_t as_ns(MonotonicTime t) {
  return static_cast<std::uint64_t>(t.ns());
}
MonotonicTime from_ns(std::uint64_t ns) {
  return MonotonicTime(nanoseconds(static_cast<std::int64_t>(ns)));
}

mission::SlotStatistics to_mission(const SlotStatistics& s) {
  return {.slots_granted = s.slots_granted,
          .slots_used = s.slots_used,
          .slots_failed = s.slots_failed,
          .slots_handed_back = s.slots_handed_back,
          .peripheral_timeouts = s.peripheral_timeouts,
          .last_used_us = as_us(s.last_used),
          .telecommands_executed = s.telecommands_executed};
}

unsigned bits_of(const hw::CanFrame& frame) {
  return wire::can_bits_on_wire({.id = frame.id,
                                 .extended = frame.extended,
                                 .remote = frame.remote,
                                 .size = frame.size,
                                 .data = frame.view()});
}

}  // namespace

PayloadNode::PayloadNode(suite::NodeContext& context, std::unique_ptr<PayloadProfile> profile)
    : Node(context), profile_(std::move(profile)) {
  declare_parameters();
}

void PayloadNode::declare_parameters() {
  declare_parameter("answer_timeout_ms", std::int64_t{25}, ros::ParameterRange{1, 10000},
                    "Longest wait for the peripheral's answer to one request; never past the allotted time");
  declare_parameter("command_time_ms", std::int64_t{12}, ros::ParameterRange{1, 10000},
                    "A request starts only while at least this much of the allotted time is left");
  declare_parameter("power_off_ms", std::int64_t{200}, ros::ParameterRange{50, 10000},
                    "Time without power when the node power-cycles its peripheral by itself");
  declare_parameter("silent_slots_to_power_cycle", std::int64_t{20}, ros::ParameterRange{0, 100000},
                    "Silent slots in a row after which the peripheral is power-cycled; 0: never");
  declare_parameter("babble_power_cycles", std::int64_t{3}, ros::ParameterRange{0, 100},
                    "Power cycles of a babbling peripheral before it is kept off for a while");
  declare_parameter("measurement_period_ms", std::int64_t{0}, ros::ParameterRange{0, 3600000},
                    "A slot without a telecommand, sooner than this after the last measurement, is released "
                    "unused; 0: never");
  declare_parameter("processing_time_ms", std::int64_t{0}, ros::ParameterRange{0, 60000},
                    "Artificial time added to the processing of a measurement, for experiments");
  declare_parameter("sensor_inputs", std::vector<std::int64_t>{},
                    "GPIO lines (8-11) of the on-board sensor inputs that this node reads and reports", true);
  declare_parameter("sensor_input_period_ms", std::int64_t{500}, ros::ParameterRange{20, 60000},
                    "How often the sensor inputs are read", true);
  on_parameter_change([this](const std::string&) {
    if (cycle_) cycle_->change_settings(settings());
  });
}

PayloadSettings PayloadNode::settings() const {
  PayloadSettings s;
  s.answer_timeout = milliseconds(get_parameter<std::int64_t>("answer_timeout_ms"));
  s.command_time = milliseconds(get_parameter<std::int64_t>("command_time_ms"));
  s.power_off_time = milliseconds(get_parameter<std::int64_t>("power_off_ms"));
  s.measurement_period = milliseconds(get_parameter<std::int64_t>("measurement_period_ms"));
  s.babble.power_cycles = static_cast<std::uint32_t>(get_parameter<std::int64_t>("babble_power_cycles"));
  s.silent_slots_to_power_cycle =
      static_cast<std::uint32_t>(get_parameter<std::int64_t>("silent_slots_to_power_cycle"));
  return s;
}

// ---------------------------------------------------------------- lifecycle

CallbackReturn PayloadNode::on_configure() {
  if (!assign_inputs() || !open_devices()) return CallbackReturn::failure;
  restore();
  reported_ = Reported{monotonic_now(), bits_, nanoseconds(0), nanoseconds(0)};
  bus_offs_seen_ = 0;
  open_topics();
  can_watch_ = watch_fd(
      can_->fd(), EPOLLIN, [this](std::uint32_t) { on_can_input(); }, "can");
  report_timer_ = create_timer(
      milliseconds(200), [this] { flush_reports(); }, "reports");
  counter_timer_ = create_timer(
      counters_period, [this] { publish_counters(); }, "counters");
  if (!input_lines_.empty()) {
    input_timer_ = create_timer(
        milliseconds(get_parameter<std::int64_t>("sensor_input_period_ms")), [this] { read_inputs(); },
        "inputs");
  }
  hold_to_mode();
  return CallbackReturn::success;
}

bool PayloadNode::open_devices() {
  const suite::Peripheral* const place = deployment().peripheral_of(name());
  if (place == nullptr) {
    set_failure_reason(
        fmt::format("{}: the entry of {} has no 'peripheral: {{ can_address: ..., power_line: ... }}'",
                    deployment().file.string(), name()));
    return false;
  }
  peripheral_ = *place;
  link_ = profile_->make_link(peripheral_.can_address);
  std::vector<hw::CanFilter> filters;
  for (const wire::CanIdentifierPair& pair : link_->identifiers()) {
    if (!wire::comes_before_marker(pair.request, pair.extended)) {
      set_failure_reason(fmt::format(
          "the identifier {:#x} of a request has no higher priority than the marker {:#x} of can_switcher",
          pair.request, wire::transmit_marker_id));
      return false;
    }
    if (!peripheral_.sends(pair.answer, pair.extended)) {
      set_failure_reason(
          fmt::format("the peripheral answers on {:#x}: its place in {} has no 'answers: [{:#x}]' "
                      "(can_switcher cuts its power by it)",
                      pair.answer, deployment().file.string(), pair.answer));
      return false;
    }
    filters.push_back(hw::exactly(pair.answer, pair.request, pair.extended));
  }
  auto can = hw::open_can(device(peripheral_.bus), var().root, std::move(filters));
  auto gpio = hw::open_gpio(device("gpio"), var().root);
  if (!can || !gpio) {
    set_failure_reason(!can ? can.error().message : gpio.error().message);
    return false;
  }
  can_ = std::move(*can);
  leased_ = std::make_unique<hw::LeasedCanBus>(*can_);
  gpio_ = std::move(*gpio);
  return true;
}

void PayloadNode::restore() {
  TelecommandJournal journal = read_journal(state_dir() / "telecommands");
  (void)suite::read_state_file(
      var(), name(), "processing", 65536, suite::TakenBack::yes,
      [this](const std::string& content) { return profile_->restore_state(as_octets(content)); });
  cycle_.emplace(
      settings(),
      [profile = profile_.get()](std::uint16_t function, OctetView arguments) {
        return profile->decode_command(function, arguments);
      },
      std::move(journal));
  std::error_code ec;
  const auto marked = std::filesystem::file_size(ids_lost_mark(), ec);
  if (!ec && marked > 0) cycle_->restore_ids_lost();
  const auto kept_off = read_file(kept_off_mark(), 64);
  if (kept_off) {
    const auto until = kept_off_until(*kept_off, kernel_boot_id().value_or("unknown"));
    if (until)
      cycle_->restore_kept_off(*until);
    else
      (void)remove_durably(kept_off_mark());
  }
  once_done_ = OnceDone(std::nullopt);
  if (std::filesystem::exists(once_done_file(), ec))
    once_done_ = OnceDone(read_file(once_done_file(), 32).value_or(""));
}

void PayloadNode::open_topics() {
  process_worker_ = create_worker("process", 4);
  store_worker_ = create_worker("store", 8);
  gpio_worker_ = create_worker("gpio", 4);
  statuses_ = create_publisher(suite::topics::bus_status);
  activities_ = create_publisher(suite::topics::activity(name()));
  authority_.emplace(*this);
  reports_ = create_publisher(suite::topics::telecommand_report);
  ticks_ = create_subscription(suite::topics::time_tick,
                               [this](const srfs_msgs::msg::TimeTick& m) { time_.on_tick(m); });
  flags_ = create_subscription(
      suite::topics::task_flags,
      [this](const srfs_msgs::msg::TaskFlags& m, const ros::MessageInfo& info) { on_flags(m, info); });
  resets_ = create_subscription(suite::topics::reset_peripheral, [this](const srfs_msgs::msg::PeripheralReset&
                                                                            m) {
    if (m.payload != name()) return;
    run(cycle_->on_peripheral_reset({m.switcher_incarnation, m.grant_counter}, m.reason, monotonic_now()));
  });
  telecommands_ = create_subscription(suite::topics::telecommand,
                                      [this](const srfs_msgs::msg::Telecommand& m) { on_telecommand(m); });
}

// ---------------------------------------------------------------- mode

std::filesystem::path PayloadNode::once_done_file() const {
  return state_dir() / "mode_orders_done";
}

void PayloadNode::on_mode_changed() {
  // What this node did by itself, the next mode puts right, though it is no other one.
  if (mode_in_force()->by_itself) remember_once_done(std::nullopt);
  hold_to_mode();
}

void PayloadNode::hold_to_mode() {
  if (!cycle_ || !mode_in_force()) return;
  const suite::ModeReaction reaction = mode_reaction();
  if (mode_orders_ || (reaction.hold.empty() && reaction.once.empty())) {
    give_orders();
  } else {
    resolve_mode_orders();
  }
}

void PayloadNode::resolve_mode_orders() {
  if (resolving_orders_) return;
  const auto decode = [profile = profile_.get()](std::uint16_t function, OctetView arguments) {
    return profile->decode_command(function, arguments);
  };
  std::vector<mission::Fragment> fragments;
  for (const suite::AddedNode& added : deployment().added) {
    if (added.name == name()) fragments.push_back({added.name, added.dictionary});
  }
  resolving_orders_ = process_worker_->ask(
      [decode, fragments, settings = deployment().modes, node = name()] {
        try {
          const auto dictionary = mission::Dictionary::load(mission::Dictionary::default_folder(), fragments);
          return resolve_orders(dictionary, settings, node, decode);
        } catch (const ConfigError& error) {
          ModeOrders none;
          none.problems.push_back({suite::ModeSettings::safe, "", error.what()});
          return none;
        }
      },
      [this](const ModeOrders& orders) {
        resolving_orders_ = false;
        if (orders.modes.empty()) {  // the disk may be repaired meanwhile
          log::error(
              "the mission dictionary cannot be read, so the mode's orders are not given; tried again: {}",
              orders.problems.front().why);
          retry_mode_orders();
          return;
        }
        mode_orders_ = orders;
        malloc_trim(0);  // the dictionary took more than what is kept of it
        for (const ModeOrders::Problem& problem : orders.problems)
          log::error("mode {}: order '{}' is left out, correct the deployment: {}", problem.mode,
                     problem.order, problem.why);
        hold_to_mode();
      });
  if (!resolving_orders_) retry_mode_orders();  // the worker has no room now
}

void PayloadNode::retry_mode_orders() {
  orders_retry_ = create_one_shot(
      monotonic_now() + orders_retry_period, [this] { hold_to_mode(); }, "orders of the mode");
}

void PayloadNode::give_orders() {
  const suite::ModeInForce& mode = *mode_in_force();
  ModeOrders::OfMode orders;
  if (mode_orders_) orders = mode_orders_->modes[mode.name];
  if (mode.by_itself || once_done_.is_of(mode.change)) orders.once.clear();
  run(cycle_->set_orders(std::move(orders.once), std::move(orders.hold), deployment().modes.repeat,
                         monotonic_now()));
}

void PayloadNode::remember_once_done(std::optional<std::uint32_t> change) {
  if (!once_done_.set(change) || !store_worker_) return;
  (void)store_worker_->post([file = once_done_file(), text = once_done_.stored_text()] {
    if (const auto written = write_file_atomically(file, text); !written)
      log::error("{}", written.error().message);
  });
}

void PayloadNode::carry_out(const OrdersObeyed& action) {
  if (!mode_in_force()) return;
  if (!mode_in_force()->by_itself) remember_once_done(mode_in_force()->change);
  if (mode_orders_) {
    for (const ModeOrders::Problem& problem : mode_orders_->problems) {
      if (problem.mode == mode_in_force()->name) raise_order_failed(problem.order, problem.why);
    }
  }
  report_mode_obeyed(action.done);
}

void PayloadNode::carry_out(const OrderRefused& action) {
  log::warn("order of the mode '{}': {}", action.order, mission::failure_text(action.why));
  raise_order_failed(action.order, std::string(mission::failure_text(action.why)));
}

void PayloadNode::raise_order_failed(const std::string& order, const std::string& why) {
  mission::NodeModeOrderFailedEvent event;
  event.mode = static_cast<mission::MissionMode>(mode_in_force() ? mode_in_force()->number : 0);
  event.order = order;
  event.reason = excerpt(why, 60);
  raise(event);
}

std::filesystem::path PayloadNode::kept_off_mark() const {
  return state_dir() / "peripheral_kept_off";
}

std::filesystem::path PayloadNode::ids_lost_mark() const {
  return var().memory() / (name() + "_ids_lost");
}

CallbackReturn PayloadNode::on_activate() {
  run(cycle_->activate(monotonic_now()));
  carry_out(cycle_->activity());  // recorders that start with us see the first state
  return CallbackReturn::success;
}

CallbackReturn PayloadNode::on_deactivate() {
  run(cycle_->deactivate(monotonic_now()));
  return CallbackReturn::success;
}

void PayloadNode::say_goodbye() {
  if (!statuses_) return;
  srfs_msgs::msg::BusStatus m;  // grant {0, 0}: we hold nothing, and will not answer
  m.status = srfs_msgs::msg::BusStatus::FAILED;
  m.payload = name();
  m.payload_incarnation = incarnation();
  m.monotonic_ns = as_ns(monotonic_now());
  m.detail = "leaving";
  statuses_->publish(m);
}

void PayloadNode::close() {
  say_goodbye();
  timer_.reset();
  armed_.reset();
  report_timer_.reset();
  counter_timer_.reset();
  input_timer_.reset();
  if (process_worker_) process_worker_->drain();
  if (store_worker_) store_worker_->drain();
  if (gpio_worker_) gpio_worker_->drain();
  process_worker_.reset();
  resolving_orders_ = false;
  orders_retry_.reset();
  store_worker_.reset();
  gpio_worker_.reset();
  timer_.reset();  // what the workers had finished may have set it again
  armed_.reset();
  journal_writing_ = false;
  reading_inputs_ = false;
  telecommands_.reset();
  resets_.reset();
  flags_.reset();
  ticks_.reset();
  can_watch_.reset();
  if (leased_) leased_->end();
  leased_.reset();
  can_.reset();
  gpio_.reset();
  statuses_.reset();
  activities_.reset();
  reports_.reset();
  // The state on disk is complete; on_configure takes it up again.
  cycle_.reset();
  link_.reset();
  actions_.clear();
  awaiting_quiet_ = false;
}

CallbackReturn PayloadNode::on_cleanup() {
  close();
  return CallbackReturn::success;
}

CallbackReturn PayloadNode::on_shutdown() {
  if (cycle_ && statuses_) run(cycle_->deactivate(monotonic_now()));
  close();
  return CallbackReturn::success;
}

CallbackReturn PayloadNode::on_error() {
  return on_shutdown();
}

// ---------------------------------------------------------------- input

bool PayloadNode::is_plausible(const srfs_msgs::msg::TaskFlags& flags) {
  const suite::Bus& bus = deployment().bus_of(name());
  return flag_check_.is_plausible(flags, bus.slots, monotonic_now(), [this, &bus] {
    const auto switcher = suite::find_instance(var(), bus.switcher);
    return switcher ? std::optional(switcher->incarnation) : std::nullopt;
  });
}

void PayloadNode::on_flags(const srfs_msgs::msg::TaskFlags& flags, const ros::MessageInfo& info) {
  if (!is_plausible(flags)) {
    if (++implausible_flags_ % 100 == 1) {
      log::warn("implausible task flags ignored ({} so far): grant {}.{} for '{}'", implausible_flags_,
                flags.switcher_incarnation, flags.grant_counter, flags.holder);
    }
    return;
  }
  const GrantId grant{flags.switcher_incarnation, flags.grant_counter};
  if (flags.holder.empty()) {
    run(cycle_->on_recall(grant, monotonic_now()));
    return;
  }
  if (flags.holder != name()) {
    run(cycle_->on_foreign_flag(grant, monotonic_now()));
    return;
  }
  PayloadFlag flag;
  flag.grant = grant;
  flag.cycle = flags.cycle;
  flag.granted = from_ns(flags.tick_received_ns);
  flag.allotted_end = flag.granted + microseconds(flags.allotted_us);
  flag.lease_end = from_ns(flags.lease_end_ns);
  flag.switcher_reachable = statuses_->is_heard_by_sender_of(info);
  run(cycle_->on_flag(flag, monotonic_now()));
}

void PayloadNode::on_telecommand(const srfs_msgs::msg::Telecommand& m) {
  if (m.target != name() || !authority_->admits(m)) return;
  run(cycle_->on_telecommand(from_message(m), monotonic_now()));
}

/// This thread may be the late one: what waits in the socket counts before a deadline is judged, and nothing
/// is sent before that.
void PayloadNode::on_can_input() {
  const MonotonicTime t = monotonic_now();
  const std::uint32_t received = frames_received_;
  for (int i = 0; i < frames_per_turn; ++i) {
    const auto frame = can_->receive();
    if (!frame) break;
    on_can_frame(*frame);
  }
  if (can_->counters().bus_off != bus_offs_seen_) {
    // The request left no trace on the bus: that is no silence of the peripheral.
    bus_offs_seen_ = can_->counters().bus_off;
    link_->abort();
    run(cycle_->on_request_failed(RequestFailure::not_sent, hw::to_string(hw::CanError::bus_off), t));
  }
  take_outcomes();
  check_quiet();
  if (frames_received_ != received) cycle_->on_frames_waited(t);
  run(cycle_->on_deadline(t, leased_->quiet()));
  pump();
  check_quiet();
  arm_timer();
}

void PayloadNode::on_can_frame(const hw::CanFrame& frame) {
  const MonotonicTime t = monotonic_now();
  bits_ += bits_of(frame);
  if (frame.is_echo) {
    link_->on_transmit_confirm(without_meta(frame), t);
    return;
  }
  if (cycle_->holds_bus()) {
    ++frames_received_;
    link_->on_frame(without_meta(frame), t);
  } else {
    ++frames_outside_slot_;
  }
  if (!cycle_->expects_frames()) run(cycle_->on_unsolicited_frame(t));
}

/// Puts what the channel has to say on the bus, under the lease.
void PayloadNode::pump() {
  while (const auto frame = link_->poll(monotonic_now())) {
    const auto sent = leased_->send(to_can_frame(*frame), grant_, monotonic_now());
    if (sent) {
      ++frames_sent_;
    } else if (sent.error() == hw::CanError::queue_full) {
      link_->on_transmit_refused(monotonic_now());
      break;
    } else {
      link_->abort();
      run(cycle_->on_request_failed(RequestFailure::not_sent, hw::to_string(sent.error()), monotonic_now()));
      return;
    }
  }
  take_outcomes();
}

/// Of the request, for the cycle.
void PayloadNode::take_outcomes() {
  while (auto outcome = link_->take_outcome()) {
    if (*outcome) {
      run(cycle_->on_answer(**outcome, monotonic_now()));
    } else {
      run(cycle_->on_request_failed(outcome->error().kind, outcome->error().detail, monotonic_now()));
    }
  }
}

void PayloadNode::check_quiet() {
  if (!awaiting_quiet_ || !leased_->quiet()) return;
  awaiting_quiet_ = false;
  run(cycle_->on_bus_quiet(monotonic_now()));
}

suite::WorkStatus PayloadNode::work_status() const {
  suite::WorkStatus work;
  if (cycle_) work.done = cycle_->statistics().slots_granted;
  if (armed_ && *armed_ <= now()) {
    work.due = 1;
    work.oldest_due = armed_;
  }
  return work;
}

void PayloadNode::on_timer() {
  armed_.reset();
  on_can_input();
}

void PayloadNode::arm_timer() {
  auto deadline = cycle_->next_deadline();
  const auto link = link_->next_deadline();
  if (link && (!deadline || *link < *deadline)) deadline = link;
  if (deadline == armed_) return;
  armed_ = deadline;
  timer_.reset();
  if (deadline)
    timer_ = create_one_shot(
        *deadline, [this] { on_timer(); }, "slot deadline");
}

// ---------------------------------------------------------------- actions

void PayloadNode::run(PayloadActions actions) {
  const bool all_done = actions_.run(std::move(actions), [this](const PayloadAction& action) {
    std::visit([this](const auto& a) { carry_out(a); }, action);
  });
  if (all_done) arm_timer();
}

void PayloadNode::carry_out(const PublishStatus& action) {
  srfs_msgs::msg::BusStatus m;
  m.status = static_cast<std::uint8_t>(action.kind);
  m.switcher_incarnation = action.grant.incarnation;
  m.grant_counter = action.grant.counter;
  m.payload = name();
  m.payload_incarnation = incarnation();
  m.monotonic_ns = as_ns(monotonic_now());
  if (action.kind != PublishStatus::Kind::taken) m.used_us = as_us(action.used);
  // A slot that was not taken has no frames; the counts are still those of the slot before.
  if (action.kind != PublishStatus::Kind::taken && pack(action.grant) == grant_) {
    m.frames_sent = frames_sent_;
    m.frames_received = frames_received_;
  }
  m.detail = action.detail.substr(0, longest_detail);
  statuses_->publish(m);
}

void PayloadNode::carry_out(const OpenBus& action) {
  grant_ = pack(action.grant);
  frames_sent_ = 0;
  frames_received_ = 0;
  awaiting_quiet_ = false;
  if (!leased_->begin(grant_, action.lease_end))
    log::error("grant {:#x} refused: not newer than the last one", grant_);
}

void PayloadNode::carry_out(const CloseBus& /*action*/) {
  leased_->end();
  link_->abort();
}

void PayloadNode::carry_out(const SendRequest& action) {
  link_->request(action.body, monotonic_now());
  pump();
}

void PayloadNode::carry_out(const AbortRequest& /*action*/) {
  link_->abort();
}

void PayloadNode::carry_out(const AwaitQuiet& /*action*/) {
  awaiting_quiet_ = true;
  check_quiet();
}

void PayloadNode::carry_out(const ProcessMeasurement& action) {
  const milliseconds artificial(get_parameter<std::int64_t>("processing_time_ms"));
  const MonotonicTime measured = monotonic_now();
  const bool taken = process_worker_->ask(
      [profile = profile_.get(), action, artificial] {
        if (artificial > milliseconds(0)) std::this_thread::sleep_for(artificial);
        return profile->process(action.block, action.cycle, to_mission(action.statistics));
      },
      [this, cycle = action.cycle, size = action.block.size(), measured](const auto& processed) {
        if (processed) {
          publish_processed(*processed, cycle, measured);
        } else {
          raise(mission::PayloadPeripheralGarbageEvent{.reason =
                                                           fmt::format("measurement of {} octets", size)});
        }
        run(cycle_->on_processed(monotonic_now()));
      });
  if (taken) return;
  ++measurements_dropped_;
  log::warn("processing is too slow: measurement of cycle {} dropped ({} so far)", action.cycle,
            measurements_dropped_);
  run(cycle_->on_processed(measured));
}

void PayloadNode::publish_structure(std::uint16_t structure_id, Octets data, MissionCycle cycle,
                                    MonotonicTime at) {
  srfs_msgs::msg::PayloadTelemetry m;
  m.source = name();
  m.apid = profile_->apid();
  m.structure_id = structure_id;
  m.cycle = cycle;
  m.utc = ros::to_message(time_.utc_at(at));
  m.time_valid = time_.valid();
  m.monotonic_ns = as_ns(at);
  m.data = std::move(data);
  publish_telemetry(m);
}

/// By a timer and not with the measurements: a silent peripheral must not hide what went wrong.
void PayloadNode::publish_counters() {
  const PayloadCycle::Counters& cycle = cycle_->counters();
  const TelecommandJournal::Counters& journal = cycle_->journal().counters();
  const PeripheralLink::Counters link = link_->counters();
  const hw::CanCounters& can = can_->counters();
  mission::PayloadCounters c;
  c.flags_repeated = cycle.repeated_flags;
  c.flags_stale = cycle.stale_flags;
  c.flags_unreachable = cycle.unreachable_flags;
  c.flags_implausible = as_u32(implausible_flags_);
  c.grants_lost = cycle.lost_grants;
  c.answers_unexpected = cycle.unexpected_answers;
  c.answers_garbage = cycle.garbage_answers;
  c.answers_late = link.late_answers;
  c.transport_errors = as_u32(link.transport_errors);
  c.frames_outside_slot = frames_outside_slot_;
  c.frames_stuck = cycle.stuck_frames;
  c.bus_errors = as_u32(can.bus_errors);
  c.receive_overruns = as_u32(can.receive_overruns);
  c.resets_ordered = cycle.resets_ordered;
  c.resets_stray = cycle.stray_reset_orders;
  c.power_cycles = cycle.power_cycles;
  c.measurements_dropped = measurements_dropped_;
  c.telecommands_arrived = journal.arrived;
  c.telecommands_repeated = journal.repeated;
  c.telecommands_refused = journal.refused;
  c.telecommands_expired = journal.expired;
  c.telecommands_completed = journal.completed;
  c.telecommands_failed = journal.failed;
  c.journal_failures = journal.failed_writes;
  c.reports_dropped = as_u32(unheard_.dropped());
  c.dds_malformed = as_u32(malformed_samples());
  c.events_suppressed = as_u32(suppressed_events());
  add_bus_statistics(c);
  EncodedStructure structure = profile_->counters(time_.cycle(), c,
                                                  {.sensor_levels = inputs_->levels(),
                                                   .sensor_valid = inputs_->valid(),
                                                   .sensor_changes = inputs_->changes(),
                                                   .sensor_failures = inputs_->failures()});
  publish_structure(structure.id, std::move(structure.data), time_.cycle(), monotonic_now());
}

void PayloadNode::add_bus_statistics(mission::PayloadCounters& c) {
  const hw::CanController controller = can_->controller();
  const hw::CanCounters& can = can_->counters();
  const SlotStatistics& slots = cycle_->statistics();
  const Reported before =
      std::exchange(reported_, Reported{monotonic_now(), bits_, slots.used_total, slots.granted_total});
  const auto percent = [](double part, double whole) {
    return whole > 0 ? static_cast<float>(100 * part / whole) : 0.0F;
  };
  const double period_s = std::chrono::duration<double>(reported_.at - before.at).count();
  c.bus_load = percent(static_cast<double>(bits_ - before.bits),
                       period_s * controller.bit_rate.value_or(usual_bit_rate));
  c.slot_use = percent(static_cast<double>((slots.used_total - before.used).count()),
                       static_cast<double>((slots.granted_total - before.granted).count()));
  c.longest_used_us = as_us(slots.longest_used);
  c.controller = static_cast<mission::CanControllerState>(controller.state);
  constexpr std::uint16_t unknown = 0xFFFF;
  c.transmit_errors = controller.transmit_errors.value_or(unknown);
  c.receive_errors = controller.receive_errors.value_or(unknown);
  c.frames_sent = can.sent;
  c.frames_received = can.received;
  c.frames_lost = as_u32(can.lost_in_queue);
  c.queue_full = as_u32(can.refused_full);
  c.arbitration_lost = as_u32(can.arbitration_lost);
  c.bus_off = as_u32(can.bus_off);
  c.controller_restarts = as_u32(can.restarts);
  c.withdrawals = cycle_->counters().withdrawals;
  c.babble_cuts = cycle_->counters().babble_cuts;
  c.kept_off = cycle_->peripheral_kept_off();
}

bool PayloadNode::assign_inputs() {
  input_lines_.clear();
  unsigned assigned = 0;
  for (const std::int64_t line : get_parameter<std::vector<std::int64_t>>("sensor_inputs")) {
    constexpr int last = hw::gpio_first_input + hw::gpio_input_count - 1;
    if (line < hw::gpio_first_input || line > last) {
      set_failure_reason(fmt::format("parameter 'sensor_inputs': expected lines from {} to {}, found {}",
                                     hw::gpio_first_input, last, line));
      return false;
    }
    input_lines_.push_back(static_cast<std::uint8_t>(line));
    assigned |= 1U << (line - hw::gpio_first_input);
  }
  inputs_.emplace(static_cast<std::uint8_t>(assigned));
  return true;
}

/// Line by line: on the board a line has one owner, and the others of the bank are other nodes'.
void PayloadNode::read_inputs() {
  if (reading_inputs_) return;  // of a simulator that is late, for instance
  reading_inputs_ = gpio_worker_->ask(
      [this] {
        SensorInputs::Reading reading;
        for (const std::uint8_t line : input_lines_) {
          const auto level = gpio_->read_line(line);
          if (!level) continue;
          const unsigned bit = 1U << (line - hw::gpio_first_input);
          reading.read = static_cast<std::uint8_t>(reading.read | bit);
          if (*level) reading.levels = static_cast<std::uint8_t>(reading.levels | bit);
        }
        return reading;
      },
      [this](const SensorInputs::Reading& reading) {
        reading_inputs_ = false;
        const auto change = inputs_->on_reading(reading, monotonic_now());
        if (!change) return;
        log::info("on-board sensor inputs {:#04x} -> {:#04x}", change->before, change->after);
        raise(mission::PayloadSensorInputsChangedEvent{.before = change->before, .after = change->after});
      });
}

void PayloadNode::publish_processed(const Processed& processed, MissionCycle cycle, MonotonicTime measured) {
  publish_structure(profile_->structure_id(), processed.housekeeping, cycle, measured);
  for (const EncodedEvent& event : processed.events) raise_event(event.id, event.severity, event.data);
}

void PayloadNode::carry_out(const CommandDone& action) {
  // On the processing thread, behind the measurements taken before.
  (void)process_worker_->post(
      [profile = profile_.get(), command = action.command, file = state_dir() / "processing"] {
        if (!profile->on_command_done(command)) return;
        const auto written = write_file_atomically(file, as_text(profile->state()));
        if (!written) log::error("{}", written.error().message);
      });
}

void PayloadNode::carry_out(const WriteTelecommands& action) {
  journal_wanted_ = action.revision;
  if (!journal_writing_) write_journal();
}

void PayloadNode::write_journal() {
  journal_writing_ = true;
  const std::uint64_t revision = cycle_->journal().revision();
  const bool taken = store_worker_->ask(
      [file = state_dir() / "telecommands", content = cycle_->journal().encode()] {
        const auto written = write_file_atomically(file, as_text(content));
        if (!written) log::error("telecommands cannot be stored: {}", written.error().message);
        return written.has_value();
      },
      [this, revision](bool ok) {
        journal_writing_ = false;
        run(cycle_->on_journal_written(revision, ok, monotonic_now()));
        if (journal_wanted_ > revision && !journal_writing_) write_journal();
      });
  if (taken) return;
  journal_writing_ = false;
  run(cycle_->on_journal_written(revision, false, monotonic_now()));
}

void PayloadNode::carry_out(const SwitchPower& action) {
  struct Outcome {
    bool ok = false;
    bool was_on = true;
  };
  const bool taken = gpio_worker_->ask(
      [this, on = action.on] {
        Outcome outcome;
        outcome.was_on = gpio_->read_line(peripheral_.power_line).value_or(true);
        const auto set = gpio_->set_line(peripheral_.power_line, on);
        if (!set) log::warn("cannot switch the power of the peripheral: {}", hw::to_string(set.error()));
        outcome.ok = set.has_value();
        return outcome;
      },
      [this, on = action.on](const Outcome& outcome) {
        run(cycle_->on_power_switched(on, outcome.ok, monotonic_now(), outcome.was_on));
      });
  if (!taken) run(cycle_->on_power_switched(action.on, false, monotonic_now()));
}

void PayloadNode::carry_out(const WithdrawFrames& /*action*/) {
  const std::size_t waiting = can_->unconfirmed();
  if (waiting == 0) return;
  if (can_->withdraw()) {
    log::warn("{} own frames did not get the bus: withdrawn", waiting);
  } else {
    log::error("{} own frames do not get the bus and cannot be withdrawn", waiting);
  }
  check_quiet();
}

void PayloadNode::carry_out(const RememberKeptOff& action) {
  (void)store_worker_->post([file = kept_off_mark(), action] {
    const auto written =
        action.kept_off
            ? write_file_atomically(file, kept_off_text(action.until, kernel_boot_id().value_or("unknown")))
            : remove_durably(file);
    if (!written) log::error("{}", written.error().message);
  });
}

void PayloadNode::carry_out(const RememberIdsLost& action) {
  // Its content is the mark: an uplinked payload may neither make nor remove the file.
  if (action.lost) {
    const auto made = open_private(ids_lost_mark(), O_WRONLY | O_CREAT, var().owner());
    if (!made) {
      log::error("a restart may repeat telecommands: {}", made.error().message);
    } else if (write(made->get(), "1", 1) != 1) {
      log::error("a restart may repeat telecommands: {}: {}", ids_lost_mark().string(), errno_text(errno));
    }
  } else {
    (void)open_private(ids_lost_mark(), O_WRONLY | O_TRUNC, var().owner());
  }
}

void PayloadNode::carry_out(const PayloadEvent& action) {
  using Kind = PayloadEvent::Kind;
  switch (action.kind) {
    case Kind::peripheral_silent:
      log::warn("the peripheral does not answer, {} slots", action.number);
      break;
    case Kind::peripheral_garbage:
      break;
    case Kind::peripheral_back:
      log::info("the peripheral answers again after {} slots", action.number);
      break;
    case Kind::peripheral_reset:
      log::warn("peripheral reset: {}", action.text);
      break;
    case Kind::peripheral_power_cycled:
      log::warn("peripheral switched off and on: {}", action.text);
      break;
    case Kind::peripheral_babbles:
      log::error("the peripheral sends frames without request: its power is cut");
      break;
    case Kind::peripheral_kept_off:
      log::error(
          "the peripheral babbled again after {} power cycles: it is tried again in 10 minutes to 6 hours, "
          "or when commanded",
          action.number);
      break;
    case Kind::telecommand_failed:
      log::warn("telecommand {} failed: {}", action.id, mission::failure_text(action.code));
      break;
  }
  const EncodedEvent event = to_event(action);
  raise_event(event.id, event.severity, event.data);
}

void PayloadNode::carry_out(const StageReport& action) {
  unheard_.push(to_message(action, name(), incarnation(), monotonic_now()));
  flush_reports();
}

void PayloadNode::flush_reports() {
  // Telecommands are published by ttc. A recorder that listens to the reports does not keep them for ttc.
  if (!reports_ || !telecommands_ || !reports_->is_heard_by_a_publisher_of(*telecommands_)) return;
  while (auto report = unheard_.pop()) {
    authority_->prove(*report);
    reports_->publish(*report);
  }
}

void PayloadNode::carry_out(const Activity& action) {
  srfs_msgs::msg::PayloadActivity m;
  m.payload = name();
  m.state = static_cast<std::uint8_t>(action);
  m.monotonic_ns = as_ns(monotonic_now());
  m.cycle = time_.cycle();
  activities_->publish(m);
}

}  // namespace srfs
