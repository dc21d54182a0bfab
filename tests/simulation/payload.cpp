// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/payload.hpp"

#include "base/text.hpp"
#include "nodes/payload/frame_conversion.hpp"
#include "nodes/payload/kept_off.hpp"
#include "nodes/payload/payload_events.hpp"
#include "suite/commanding/messages.hpp"

namespace srfs::simulation {
namespace {

constexpr unsigned process_worker_capacity = 4;
constexpr std::size_t remembered_grants = 10'000;
constexpr nanoseconds report_period = milliseconds(200);

std::uint64_t pack(GrantId grant) {
  return std::uint64_t{grant.incarnation} << 32U | grant.counter;
}
MonotonicTime from_ns(std::uint64_t ns) {
  return MonotonicTime(nanoseconds(static_cast<std::int64_t>(ns)));
}

std::vector<hw::CanFilter> filters_of(const PeripheralLink& link) {
  std::vector<hw::CanFilter> filters;
  for (const wire::CanIdentifierPair& pair : link.identifiers())
    filters.push_back(hw::exactly(pair.answer, pair.request, pair.extended));
  return filters;
}

const char* text_of(PublishStatus::Kind kind) {
  switch (kind) {
    case PublishStatus::Kind::taken:
      return "TAKEN";
    case PublishStatus::Kind::released:
      return "RELEASED";
    case PublishStatus::Kind::failed:
      return "FAILED";
  }
  return "?";
}

}  // namespace

Payload::Payload(Host& host, PayloadSurroundings surroundings)
    : host_(host),
      around_(std::move(surroundings)),
      random_(host.kernel().random(host.name() + std::to_string(host.incarnation()))),
      profile_(around_.make_profile()),
      link_(profile_->make_link(around_.can_address)),
      can_(around_.can.open(host, filters_of(*link_), [this] { on_can_input(); })),
      leased_(*can_),
      mode_(host, around_.topics, around_.modes, [this] { hold_to_mode(); }),
      timer_(host.kernel(), host.guard(), [this] {
        pump();
        run(cycle_->on_deadline(host_.now()));
      }) {}

void Payload::start() {
  restore();
  open_topics();
  host_.every(report_period, [this] { flush_reports(); });
  mode_.start();
  run(cycle_->activate(host_.now()));
}

Payload::~Payload() = default;

void Payload::restore() {
  TelecommandJournal journal(around_.boot_id);
  const auto content = around_.disk.read(host_.name() + "/telecommands");
  if (content && !journal.restore(*content))
    throw Violation{"L4", "a telecommand journal that cannot be read"};
  cycle_.emplace(
      PayloadSettings{},
      [profile = profile_.get()](std::uint16_t function, OctetView arguments) {
        return profile->decode_command(function, arguments);
      },
      std::move(journal));
  if (const auto state = around_.disk.read(host_.name() + "/processing"))
    (void)profile_->restore_state(*state);
  if (around_.ids_lost) cycle_->restore_ids_lost();
  if (const auto kept_off = around_.disk.read(host_.name() + "/peripheral_kept_off")) {
    if (const auto until = kept_off_until(as_text(*kept_off), around_.boot_id))
      cycle_->restore_kept_off(*until);
  }
  const auto once_done = around_.disk.read(host_.name() + "/mode_orders_done");
  once_done_ = once_done ? OnceDone(as_text(*once_done)) : OnceDone(std::nullopt);
  mode_orders_ = resolve_orders(around_.dictionary, around_.modes, host_.name(),
                                [profile = profile_.get()](std::uint16_t function, OctetView arguments) {
                                  return profile->decode_command(function, arguments);
                                });
}

void Payload::open_topics() {
  Topics& topics = around_.topics;
  topics.time_tick.subscribe(host_, [this](const auto& m, Host&) { time_.on_tick(m); });
  topics.task_flags.subscribe(host_, [this](const auto& m, Host& writer) { on_flags(m, writer); });
  topics.reset_peripheral.subscribe(host_, [this](const auto& m, Host&) {
    if (m.payload != host_.name()) return;
    run(cycle_->on_peripheral_reset({m.switcher_incarnation, m.grant_counter}, m.reason, host_.now()));
  });
  topics.telecommand.subscribe(host_, [this](const auto& m, Host&) {
    if (m.target == host_.name()) run(cycle_->on_telecommand(from_message(m), host_.now()));
  });
}

void Payload::on_flags(const srfs_msgs::msg::TaskFlags& flags, Host& writer) {
  const auto switcher = [this]() -> std::optional<std::uint32_t> {
    return around_.switcher.pid() != 0 ? std::optional(around_.switcher.incarnation()) : std::nullopt;
  };
  if (!flag_check_.is_plausible(flags, around_.slots, host_.now(), switcher)) return;
  const GrantId grant{flags.switcher_incarnation, flags.grant_counter};
  if (flags.holder.empty()) return run(cycle_->on_recall(grant, host_.now()));
  if (flags.holder != host_.name()) return run(cycle_->on_foreign_flag(grant, host_.now()));
  PayloadFlag flag;
  flag.grant = grant;
  flag.cycle = flags.cycle;
  flag.granted = from_ns(flags.tick_received_ns);
  flag.allotted_end = flag.granted + microseconds(flags.allotted_us);
  flag.lease_end = from_ns(flags.lease_end_ns);
  flag.switcher_reachable = around_.network.hears(host_, writer);
  run(cycle_->on_flag(flag, host_.now()));
}

void Payload::on_can_input() {
  while (const auto frame = can_->receive()) on_can_frame(*frame);
  if (can_->counters().bus_off != bus_offs_seen_) {
    bus_offs_seen_ = can_->counters().bus_off;
    link_->abort();
    run(cycle_->on_request_failed(RequestFailure::not_sent, hw::to_string(hw::CanError::bus_off),
                                  host_.now()));
  }
  pump();
  check_quiet();
  arm_timer();
}

void Payload::on_can_frame(const hw::CanFrame& frame) {
  if (frame.is_echo) return link_->on_transmit_confirm(without_meta(frame), host_.now());
  if (cycle_->holds_bus()) {
    ++frames_received_;
    link_->on_frame(without_meta(frame), host_.now());
  }
  if (!cycle_->expects_frames()) run(cycle_->on_unsolicited_frame(host_.now()));
}

void Payload::pump() {
  while (const auto frame = link_->poll(host_.now())) {
    const auto sent = leased_.send(to_can_frame(*frame), grant_, host_.now());
    if (sent) {
      ++frames_sent_;
    } else if (sent.error() == hw::CanError::queue_full) {
      link_->on_transmit_refused(host_.now());
      break;
    } else {
      link_->abort();
      run(cycle_->on_request_failed(RequestFailure::not_sent, hw::to_string(sent.error()), host_.now()));
      return;
    }
  }
  while (auto outcome = link_->take_outcome()) {
    if (*outcome) {
      run(cycle_->on_answer(**outcome, host_.now()));
    } else {
      run(cycle_->on_request_failed(outcome->error().kind, outcome->error().detail, host_.now()));
    }
  }
}

void Payload::check_quiet() {
  if (!awaiting_quiet_ || !leased_.quiet()) return;
  awaiting_quiet_ = false;
  run(cycle_->on_bus_quiet(host_.now()));
}

void Payload::arm_timer() {
  auto deadline = cycle_->next_deadline();
  const auto link = link_->next_deadline();
  if (link && (!deadline || *link < *deadline)) deadline = link;
  timer_.arm(deadline);
}

// ---------------------------------------------------------------- actions

void Payload::run(PayloadActions actions) {
  const bool all_done = actions_.run(std::move(actions), [this](const PayloadAction& action) {
    host_.action_point();
    std::visit([this](const auto& a) { carry_out(a); }, action);
  });
  if (all_done) arm_timer();
}

void Payload::carry_out(const PublishStatus& action) {
  srfs_msgs::msg::BusStatus m;
  m.status = static_cast<std::uint8_t>(action.kind);
  m.switcher_incarnation = action.grant.incarnation;
  m.grant_counter = action.grant.counter;
  m.payload = host_.name();
  m.payload_incarnation = host_.incarnation();
  m.monotonic_ns = static_cast<std::uint64_t>(host_.now().ns());
  if (action.kind != PublishStatus::Kind::taken && pack(action.grant) == grant_) {
    m.frames_sent = frames_sent_;
    m.frames_received = frames_received_;
  }
  host_.trace(Lane::can_switcher, text_of(action.kind), action.grant.incarnation, action.grant.counter);
  around_.topics.bus_status.publish(host_, std::move(m));
}

void Payload::carry_out(const OpenBus& action) {
  grant_ = pack(action.grant);
  frames_sent_ = 0;
  frames_received_ = 0;
  awaiting_quiet_ = false;
  if (!around_.opened.insert(grant_).second || !leased_.begin(grant_, action.lease_end))
    throw Violation{"M4", "a grant was used twice: " + host_.name()};
  if (around_.opened.size() > remembered_grants) around_.opened.erase(around_.opened.begin());
}

void Payload::carry_out(const CloseBus& /*action*/) {
  leased_.end();
  link_->abort();
}

void Payload::carry_out(const SendRequest& action) {
  link_->request(action.body, host_.now());
  pump();
}

void Payload::carry_out(const AbortRequest& /*action*/) {
  link_->abort();
}

void Payload::carry_out(const AwaitQuiet& /*action*/) {
  awaiting_quiet_ = true;
  check_quiet();
}

void Payload::carry_out(const ProcessMeasurement& action) {
  if (processing_ == process_worker_capacity) return run(cycle_->on_processed(host_.now()));
  ++processing_;
  host_.later(random_.between(milliseconds(1), milliseconds(30)), [this, action, measured = host_.now()] {
    --processing_;
    const auto processed = profile_->process(action.block, action.cycle, mission::SlotStatistics{});
    if (processed) {
      srfs_msgs::msg::PayloadTelemetry m;
      m.source = host_.name();
      m.apid = profile_->apid();
      m.structure_id = profile_->structure_id();
      m.cycle = action.cycle;
      m.utc = ros::to_message(time_.utc_at(measured));
      m.time_valid = time_.valid();
      m.monotonic_ns = static_cast<std::uint64_t>(measured.ns());
      m.data = processed->housekeeping;
      around_.topics.telemetry.publish(host_, std::move(m));
      for (const EncodedEvent& event : processed->events) publish_event(around_.topics, host_, event);
    }
    run(cycle_->on_processed(host_.now()));
  });
}

void Payload::carry_out(const CommandDone& action) {
  if (!profile_->on_command_done(action.command)) return;
  around_.disk.write(host_, host_.name() + "/processing", profile_->state(), [](bool) {});
}

/// As PayloadNode does.
void Payload::hold_to_mode() {
  const suite::ModeInForce& mode = *mode_.in_force();
  if (mode.by_itself) remember_once_done(std::nullopt);
  ModeOrders::OfMode orders = mode_orders_.modes[mode.name];
  if (mode.by_itself || once_done_.is_of(mode.change)) orders.once.clear();
  run(cycle_->set_orders(std::move(orders.once), std::move(orders.hold), around_.modes.repeat, host_.now()));
}

void Payload::remember_once_done(std::optional<std::uint32_t> change) {
  if (!once_done_.set(change)) return;
  around_.disk.write(host_, host_.name() + "/mode_orders_done", octets_of_text(once_done_.stored_text()),
                     [](bool) {});
}

void Payload::carry_out(const OrdersObeyed& action) {
  if (!mode_.in_force()) return;
  if (!mode_.in_force()->by_itself) remember_once_done(mode_.in_force()->change);
  mode_.report_obeyed(action.done);
}

void Payload::carry_out(const WriteTelecommands& action) {
  journal_wanted_ = action.revision;
  if (!journal_writing_) write_journal();
}

void Payload::write_journal() {
  journal_writing_ = true;
  const std::uint64_t revision = cycle_->journal().revision();
  around_.disk.write(host_, host_.name() + "/telecommands", cycle_->journal().encode(),
                     [this, revision](bool ok) {
                       journal_writing_ = false;
                       run(cycle_->on_journal_written(revision, ok, host_.now()));
                       if (journal_wanted_ > revision && !journal_writing_) write_journal();
                     });
}

void Payload::carry_out(const SwitchPower& action) {
  host_.later(random_.between(milliseconds(1), milliseconds(20)), [this, on = action.on] {
    const bool was_on = around_.power.is_on();
    const bool ok = around_.power.switch_power(on);
    host_.trace(Lane::bus, on ? "power on" : "power off", ok ? 1 : 0);
    run(cycle_->on_power_switched(on, ok, host_.now(), was_on));
  });
}

void Payload::carry_out(const WithdrawFrames& /*action*/) {
  if (can_->unconfirmed() == 0) return;
  (void)can_->withdraw();
  check_quiet();
}

void Payload::carry_out(const RememberKeptOff& action) {
  const std::string file = host_.name() + "/peripheral_kept_off";
  if (action.kept_off) {
    const std::string text = kept_off_text(action.until, around_.boot_id);
    around_.disk.write(host_, file, Octets(text.begin(), text.end()), [](bool) {});
  } else {
    around_.disk.remove(file);
  }
}

void Payload::carry_out(const RememberIdsLost& action) {
  around_.ids_lost = action.lost;
}

void Payload::carry_out(const PayloadEvent& action) {
  host_.trace(host_.lane(), "event", static_cast<std::uint64_t>(action.kind), action.number);
  publish_event(around_.topics, host_, to_event(action));
}

void Payload::carry_out(const StageReport& action) {
  unheard_.push(to_message(action, host_.name(), host_.incarnation(), host_.now()));
  flush_reports();
}

void Payload::flush_reports() {
  if (!around_.network.hears(host_, around_.ttc)) return;
  while (const auto report = unheard_.pop()) around_.topics.telecommand_report.publish(host_, *report);
}

void Payload::carry_out(const Activity& action) {
  host_.trace(host_.lane(), "activity", static_cast<std::uint64_t>(action));
}

}  // namespace srfs::simulation
