// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/timing_node.hpp"

#include <sys/epoll.h>

#include <algorithm>

#include <mission/structures.hpp>

#include "base/process.hpp"
#include "base/saturate.hpp"
#include "hw/open.hpp"
#include "nodes/timing/mission_clock.hpp"
#include "suite/commanding/command_set.hpp"
#include "suite/mission_time.hpp"
#include "suite/set_aside.hpp"
#include "suite/step_down.hpp"

namespace srfs {
namespace {

using ros::CallbackReturn;

constexpr nanoseconds housekeeping_period = seconds(1);
constexpr nanoseconds feed_period = seconds(1);
constexpr nanoseconds save_period = seconds(60);
constexpr nanoseconds discipline_period = seconds(1);

}  // namespace

TimingNode::TimingNode(suite::NodeContext& context)
    : CommandedNode(context), store_(state_dir()), boot_store_(var().boot()) {
  declare_parameters();
}

void TimingNode::declare_parameters() {
  declare_parameter("tick_period_ms", std::int64_t{1000}, ros::ParameterRange{1, 60000},
                    "Period of the tick; divides the second or is a whole number of seconds");
  declare_parameter("late_tick_ms", std::int64_t{50}, ros::ParameterRange{10, 60000},
                    "A tick handled later than this is late; after more than five late ticks in a row the "
                    "watchdog is not fed");
  declare_parameter("gps_baud", std::int64_t{9600}, ros::ParameterRange{4800, 921600},
                    "Line rate of the GPS receiver", true);
  declare_parameter("outlier_limit_us", std::int64_t{2000}, ros::ParameterRange{10, 200000},
                    "Largest accepted distance of a pulse from its prediction", true);
  declare_parameter("time_jump_limit_s", std::int64_t{2}, ros::ParameterRange{0, 86400},
                    "Largest change of a valid time that is accepted without an operator", true);
  declare_parameter("clock", std::string("mission"), {"mission", "system"},
                    "What is disciplined: a clock beside the system clock, or the system clock itself", true);
  declare_parameter("not_before", std::string("2026-01-01T00:00:00Z"),
                    "The receiver's dates are read as within the 1024 weeks from this date on", true);
  declare_parameter(
      "oscillator_wander_ppm", 0.3, ros::ParameterRange{0.001, 50},
      "Possible drift of the oscillator from its measured rate: growth of the error in holdover", true);
  declare_parameter("leap_seconds", std::int64_t{default_leap_seconds}, ros::ParameterRange{30, 60},
                    "TAI minus UTC");
  declare_parameter("watchdog_timeout_s", std::int64_t{30}, ros::ParameterRange{1, 3600},
                    "Requested time-out of the hardware watchdog", true);
  declare_parameter("healthy_after_s", std::int64_t{600}, ros::ParameterRange{1, 86400},
                    "Time of gapless watchdog feeding after which the boot record calls this boot healthy",
                    true);
  on_parameter_check(
      [](const std::string& name, const ros::ParameterValue& value) -> Result<void, std::string> {
        if (name == "tick_period_ms" && !is_tick_period(milliseconds(std::get<std::int64_t>(value)))) {
          return Err(std::string("tick_period_ms: expected a divisor of 1000 or a multiple of it"));
        }
        if (name == "not_before" && !from_iso8601(std::get<std::string>(value)))
          return Err(std::string("not_before: expected a time like 2026-01-01T00:00:00Z"));
        return {};
      });
  on_parameter_change([this](const std::string& name) { on_parameter_changed(name); });
}

nanoseconds TimingNode::tick_period() const {
  return milliseconds(get_parameter<std::int64_t>("tick_period_ms"));
}

PulseClockSettings TimingNode::clock_settings() const {
  PulseClockSettings settings;
  settings.outlier_limit = microseconds(get_parameter<std::int64_t>("outlier_limit_us"));
  settings.jump_limit = seconds(get_parameter<std::int64_t>("time_jump_limit_s"));
  settings.wander_ppm = get_parameter<double>("oscillator_wander_ppm");
  settings.not_before = from_iso8601(get_parameter<std::string>("not_before")).value_or(settings.not_before);
  return settings;
}

void TimingNode::on_parameter_changed(const std::string& parameter) {
  if (!is_active() || (parameter != "tick_period_ms" && parameter != "late_tick_ms")) return;
  // The tick that is due next stays; from there on the new period holds.
  skipped_before_ += ticks_->skipped_total();
  ticks_.emplace(tick_period(), ticks_->next_cycle(), ticks_->next_due());
  start_feeding();
}

void TimingNode::start_feeding() {
  const milliseconds late_tick(get_parameter<std::int64_t>("late_tick_ms"));
  if (feeding_) return feeding_->change_tick(tick_period(), late_tick);
  feeding_.emplace(tick_period(), late_tick);
  if (!critical_) return;
  for (WatchdogEvidence& evidence : critical_->evidence()) feeding_->add_evidence(std::move(evidence));
}

// ---------------------------------------------------------------- lifecycle

CallbackReturn TimingNode::on_configure() {
  if (!is_tick_period(tick_period())) {
    set_failure_reason("parameter 'tick_period_ms': expected a divisor of 1000 or a multiple of it");
    return CallbackReturn::failure;
  }
  if (!from_iso8601(get_parameter<std::string>("not_before"))) {
    set_failure_reason("parameter 'not_before': expected a time like 2026-01-01T00:00:00Z");
    return CallbackReturn::failure;
  }
  auto pulse = hw::open_pulse(device("gps_pulse"), var().root);
  const auto baud = static_cast<std::uint32_t>(get_parameter<std::int64_t>("gps_baud"));
  auto serial = hw::open_serial(device("gps_serial"), baud, var().root);
  for (const auto& error : {pulse ? "" : pulse.error().message, serial ? "" : serial.error().message}) {
    if (error.empty()) continue;
    set_failure_reason(error);
    return CallbackReturn::failure;
  }
  if (const auto ready = prepare_critical_watch(); !ready) {
    set_failure_reason(ready.error());
    return CallbackReturn::failure;
  }
  pulse_ = std::move(*pulse);
  serial_ = std::move(*serial);

  boot_id_ = kernel_boot_id().value_or("-");
  if (!boot_) stored_boot_ = boot_store_.load().state;
  const TimingRecord record = store_.load();
  start_clock(record);
  if (!reservation_) {  // this process's own count goes on across a clean-up
    reservation_.emplace(record.cycle_ceiling);
    next_cycle_ = reservation_->first_cycle();
  }
  // The first reservation is on disk before the first tick: written here, also after an attempt that failed.
  worker_.reset();
  run(reservation_->reserve(next_cycle_));

  worker_ = create_worker("records", 4);
  open_commanding();
  tick_publisher_ = create_publisher(suite::topics::time_tick);
  pulse_watch_ = watch_fd(
      pulse_->fd(), EPOLLIN, [this](std::uint32_t) { on_pulse_input(); }, "gps pulse");
  serial_watch_ = watch_fd(
      serial_->fd(), EPOLLIN, [this](std::uint32_t) { on_serial_input(); }, "gps serial");
  housekeeping_timer_ = create_timer(
      housekeeping_period, [this] { publish_housekeeping(); }, "housekeeping");
  save_timer_ = create_timer(
      save_period, [this] { run(reservation_->renew()); }, "save time");
  discipline_timer_ = create_timer(
      discipline_period, [this] { run(timekeeper_->on_time_passing(monotonic_now())); }, "discipline");
  set_time_ = create_order_service<srfs_msgs::srv::SetTime>(
      "~/set_time", [this](const auto& request, auto& response) { on_set_time(request, response); },
      [](const auto&, auto& response) { response.outcome = srfs_msgs::srv::SetTime::Response::REFUSED; });
  return CallbackReturn::success;
}

void TimingNode::start_clock(const TimingRecord& record) {
  const MonotonicTime t = monotonic_now();
  const CarriedTime carried = carry_on(record, boot_id_, t);
  ClockStart start{carried.utc, carried.valid, carried.error, carried.drift_ppm};
  timekeeper_.reset();
  system_clock_ = nullptr;
  if (get_parameter<std::string>("clock") == "system") {
    kernel_ = hw::open_kernel_clock();
    auto clock = std::make_unique<SystemClockDiscipline>(*kernel_);
    system_clock_ = clock.get();
    clock_ = std::move(clock);
    // Within one boot it has run on; after another boot its value is unknown.
    if (start.valid) {
      start.utc = clock_->utc_at(t);
    } else {
      clock_->step_to(start.utc, t);
    }
  } else {
    clock_ = std::make_unique<MissionClock>(start.utc, t);
  }
  timekeeper_.emplace(clock_settings(), start, t, *clock_);
}

Result<void, std::string> TimingNode::prepare_critical_watch() {
  const suite::RingSettings& ring = deployment().ring;
  if (!ring.enabled) return {};
  const WatchdogBudget budget = watchdog_budget(ring.period, ring.misses, ring.start_deadline);
  const seconds timeout(get_parameter<std::int64_t>("watchdog_timeout_s"));
  if (timeout <= budget.least_timeout) {
    return Err(
        fmt::format("{}: timing parameter 'watchdog_timeout_s': expected more than {:.1f} s, since the ring "
                    "may take {:.1f} s "
                    "to bring a node back, found {}",
                    deployment().file.string(), std::chrono::duration<double>(budget.least_timeout).count(),
                    std::chrono::duration<double>(budget.recovery).count(), timeout.count()));
  }
  std::vector<std::string> asked;
  for (const std::string& node : ring.critical) {
    if (node != name()) asked.push_back(node);
  }
  critical_ = std::make_unique<CriticalWatch>(
      CriticalAnswers(std::move(asked), incarnation(), budget.evidence_lifetime), name());
  critical_->open([this](const std::string& service) {
    return create_client<srfs_msgs::srv::CheckAlive>(service, {}, ros::Priority::liveness);
  });
  return {};
}

CallbackReturn TimingNode::on_activate() {
  auto watchdog = hw::open_watchdog(device("watchdog"), var().root,
                                    seconds(get_parameter<std::int64_t>("watchdog_timeout_s")));
  if (!watchdog) {
    set_failure_reason(watchdog.error().message);
    return CallbackReturn::failure;
  }
  watchdog_ = std::move(*watchdog);
  begin_boot();
  start_feeding();
  if (critical_) critical_->ask(monotonic_now(), [this](const std::string& node) { return pid_of(node); });
  ticks_.emplace(tick_period(), next_cycle_, monotonic_now() + milliseconds(1));
  arm_tick();
  feed_timer_ = create_timer(
      feed_period, [this] { feed_watchdog(); }, "watchdog");
  resume_commanding();
  return CallbackReturn::success;
}

CallbackReturn TimingNode::on_deactivate() {
  tick_timer_.reset();
  feed_timer_.reset();
  if (ticks_) {
    next_cycle_ = ticks_->next_cycle();
    skipped_before_ += ticks_->skipped_total();
  }
  ticks_.reset();
  watchdog_.reset();  // stays armed: a spacecraft without a tick is to be restarted
  if (boot_) run(boot_->on_feeding_ended());
  return CallbackReturn::success;
}

void TimingNode::close() {
  housekeeping_timer_.reset();
  save_timer_.reset();
  discipline_timer_.reset();
  set_time_.reset();
  close_commanding();
  pulse_watch_.reset();
  serial_watch_.reset();
  pulse_.reset();
  serial_.reset();
  if (worker_) worker_->drain();
  worker_.reset();
  feeding_.reset();
  critical_.reset();
  tick_publisher_.reset();
}

CallbackReturn TimingNode::on_cleanup() {
  close();
  return CallbackReturn::success;
}

CallbackReturn TimingNode::on_shutdown() {
  on_deactivate();
  if (boot_) run(boot_->on_end());
  close();
  return CallbackReturn::success;
}

CallbackReturn TimingNode::on_error() {
  on_deactivate();
  close();
  return CallbackReturn::success;
}

// ---------------------------------------------------------------- tick

suite::WorkStatus TimingNode::work_status() const {
  suite::WorkStatus work;
  work.done = static_cast<std::uint32_t>(ticks_published_);
  if (ticks_ && ticks_->next_due() <= now()) {
    work.due = 1;
    work.oldest_due = ticks_->next_due();
  }
  return work;
}

std::optional<pid_t> TimingNode::pid_of(const std::string& node) const {
  const auto instance = suite::find_instance(var(), node);
  return instance ? std::optional(instance->pid) : std::nullopt;
}

void TimingNode::arm_tick() {
  tick_timer_ = create_one_shot(
      ticks_->next_due(), [this] { on_tick_due(); }, "tick");
}

void TimingNode::on_tick_due() {
  const MonotonicTime t = monotonic_now();
  if (const auto grid = time().pulse_clock().grid()) ticks_->follow(*grid);
  const auto tick = ticks_->on_wakeup(t);
  if (tick) publish(*tick);
  arm_tick();
  if (!tick) return;
  feeding_->on_tick(tick->late, waited_since_last_tick(), t);
  run(reservation_->reserve(ticks_->next_cycle()));
}

/// For a CPU, by this thread.
nanoseconds TimingNode::waited_since_last_tick() {
  if (!own_cpu_) own_cpu_ = ThreadCpuFiles::open_own();
  const auto cpu = own_cpu_ ? own_cpu_->read() : std::nullopt;
  if (!cpu) return nanoseconds(0);
  return cpu->waited - std::exchange(own_waited_, cpu->waited);
}

void TimingNode::publish(const Tick& tick) {
  srfs_msgs::msg::TimeTick m;
  m.cycle = tick.cycle;
  m.utc = ros::to_message(time().utc_at(tick.due));
  const PulseClock& pulses = time().pulse_clock();
  m.time_valid = pulses.time_valid();
  m.monotonic_ns = static_cast<std::uint64_t>(tick.due.ns());
  m.sync_state = static_cast<std::uint8_t>(pulses.state());
  m.offset_s = static_cast<double>(pulses.offset().count()) * 1e-9;
  m.estimated_error_s = static_cast<double>(estimated_error(tick.due).count()) * 1e-9;
  m.period_us = static_cast<std::uint32_t>(tick_period() / microseconds(1));
  m.incarnation = incarnation();
  m.published_ns = static_cast<std::uint64_t>(monotonic_now().ns());
  tick_publisher_->publish(m);

  reservation_->on_published(tick.cycle);
  last_tick_ = tick;
  ++ticks_published_;
  max_lateness_ = std::max(max_lateness_, tick.late);
}

TimingRecord TimingNode::record_now(MissionCycle ceiling) const {
  const MonotonicTime t = monotonic_now();
  const PulseClock& pulses = time().pulse_clock();
  TimingRecord record{ceiling, time().utc_at(t), t, boot_id_, pulses.time_valid(), estimated_error(t)};
  if (pulses.drift_known()) record.drift_ppm = pulses.drift_ppm();
  return record;
}

void TimingNode::carry_out(const SaveCycles& action) {
  const auto save = [this, record = record_now(action.ceiling)] {
    const auto written = store_.save(record);
    if (!written)
      log::error("cannot save the cycle number, it may repeat after a restart: {}", written.error().message);
    return written.has_value();
  };
  const auto on_saved = [this, ceiling = action.ceiling](bool ok) { reservation_->on_written(ceiling, ok); };
  if (!worker_) return on_saved(save());  // before the first tick
  if (!worker_->ask(save, on_saved)) on_saved(false);
}

// ---------------------------------------------------------------- GPS

nanoseconds TimingNode::estimated_error(MonotonicTime t) const {
  return std::min(time().error_at(t).value_or(largest_error), largest_error);
}

void TimingNode::on_pulse_input() {
  while (const auto pulse = pulse_->read()) run(timekeeper_->on_pulse(pulse->edge, monotonic_now()));
  run(timekeeper_->review_state(monotonic_now()));
}

void TimingNode::on_serial_input() {
  on_pulse_input();  // the pulse a message belongs to comes first
  std::array<std::uint8_t, 512> buffer;
  const auto count = serial_->read(buffer);
  if (line_reopened_ != serial_->counters().reopened) {
    line_reopened_ = serial_->counters().reopened;
    gnss_.discard_partial();
  }
  if (!count || *count == 0) return;
  const MonotonicTime received = monotonic_now();
  for (const wire::GnssTime& time : gnss_.push(OctetView(buffer).first(*count)))
    run(timekeeper_->on_time_of_day(time, received));
}

void TimingNode::carry_out(const ReportPulseMoved& action) {
  log::warn("GPS pulse moved by {:.0f} us, re-locked", action.moved_us);
  raise(mission::TimingPulseMovedEvent{.moved_us = action.moved_us});
}

void TimingNode::carry_out(const ReportTimeSet& action) {
  log::info("time set to {}", to_iso8601(action.utc));
  raise(mission::TimingTimeSetEvent{
      .utc = to_tai(action.utc, static_cast<int>(get_parameter<std::int64_t>("leap_seconds")))});
  run(reservation_->renew());
}

void TimingNode::carry_out(const ReportJumpRefused& action) {
  log::warn("time of day differs by {} s, ignored", action.difference / seconds(1));
  raise(mission::TimingTimeJumpRefusedEvent{.difference_s =
                                                static_cast<double>(action.difference.count()) * 1e-9});
}

void TimingNode::carry_out(const ReportTimeRejected& action) {
  log::warn("time {} rejected: {}", to_iso8601(action.utc),
            action.why == SetTimeVerdict::implausible
                ? "implausible"
                : "it differs by more than time_jump_limit_s, and no step was allowed");
}

void TimingNode::carry_out(const ReportLocked& action) {
  const auto offset_us = static_cast<float>(action.offset.count()) * 1e-3F;
  log::info("locked to the GPS pulse, offset {:.1f} us, drift {:.2f} ppm", offset_us, action.drift_ppm);
  raise(mission::TimingLockedEvent{.offset_us = offset_us});
}

void TimingNode::carry_out(const ReportHoldover& action) {
  log::warn("no GPS pulse for {} ms, holdover", action.silent / milliseconds(1));
  raise(mission::TimingHoldoverEvent{
      .silent_ms = as_u32(static_cast<std::uint64_t>(action.silent / milliseconds(1)))});
}

void TimingNode::on_set_time(const srfs_msgs::srv::SetTime::Request& request,
                             srfs_msgs::srv::SetTime::Response& response) {
  const MonotonicTime t = monotonic_now();
  const auto as_duration = [](std::uint64_t ns) {
    return nanoseconds(static_cast<std::int64_t>(std::min<std::uint64_t>(ns, INT64_MAX)));
  };
  const TimeCommand command{
      .utc = UtcTime(nanoseconds(request.utc_ns)),
      .at = request.monotonic_ns == 0 ? t : MonotonicTime(as_duration(request.monotonic_ns)),
      .accuracy = std::min(as_duration(request.accuracy_ns), largest_error),
      .allow_jump = request.allow_jump};
  const SetTimeVerdict verdict = set_time(command);
  response.outcome = static_cast<std::uint8_t>(verdict);
  if (verdict != SetTimeVerdict::implausible) response.difference_ns = time().commanded_difference().count();
}

SetTimeVerdict TimingNode::set_time(const TimeCommand& command) {
  Timekeeper::SetTime set = timekeeper_->set_time(command, monotonic_now());
  if (set.is_set()) ++times_commanded_;
  run(std::move(set.actions));
  return set.verdict;
}

FailureCode TimingNode::check(std::uint16_t function, OctetView arguments) const {
  static_assert(mission::TimingSetTime::timeout == mission::TimingStepTime::timeout);
  return CommandSet<mission::TimingSetTime, mission::TimingStepTime>::check(function, arguments);
}

void TimingNode::execute(const StoredTelecommand& telecommand) {
  const auto arguments = *mission::TimingSetTime::decode(telecommand.arguments);
  // ttc counts the time-out from the acceptance on, so the way through the suite, and a restart on it, cost
  // nothing.
  const SetTimeVerdict verdict =
      set_time({.utc = to_utc(arguments.utc, static_cast<int>(get_parameter<std::int64_t>("leap_seconds"))),
                .at = telecommand.expiry - mission::TimingSetTime::timeout,
                .accuracy = milliseconds(arguments.accuracy_ms),
                .allow_jump = telecommand.function == mission::TimingStepTime::function_id});
  switch (verdict) {
    case SetTimeVerdict::stepped:
    case SetTimeVerdict::slewed:
      return finished(mission::failure::none);
    case SetTimeVerdict::jump_refused:
      return finished(mission::failure::time_jump_refused);
    case SetTimeVerdict::implausible:
      return finished(mission::failure::time_implausible);
  }
}

// ---------------------------------------------------------------- watchdog and housekeeping

/// Whether this process is the first of a new boot, as soon as the watchdog could be asked.
void TimingNode::begin_boot() {
  const hw::WatchdogFacts& facts = watchdog_->facts();
  const auto in_force = watchdog_->timeout();
  if (critical_ && in_force) {
    const suite::RingSettings& ring = deployment().ring;
    const WatchdogBudget budget = watchdog_budget(ring.period, ring.misses, ring.start_deadline);
    // It runs already, so it is fed none the less.
    if (*in_force <= budget.least_timeout)
      log::error("the watchdog's time-out is {} s: it may reset the computer while the ring recovers a node",
                 in_force->count());
  }
  if (boot_) return;
  const std::string boot = facts.boot.empty() ? boot_id_ : boot_id_ + "/" + facts.boot;
  boot_.emplace(stored_boot_, BootFacts{boot, facts.reset_by_watchdog},
                BootRecorder::Settings{
                    .healthy_after = seconds(get_parameter<std::int64_t>("healthy_after_s")),
                    .withheld_after = seconds(get_parameter<std::int64_t>("watchdog_timeout_s")) / 2});
  run(boot_->begin());
}

void TimingNode::carry_out(const ReportBoot& action) {
  log::info("boot {}, reset cause {}", action.count, mission::to_text(action.cause));
  raise(mission::TimingBootEvent{.count = action.count, .cause = action.cause});
}

void TimingNode::carry_out(const SaveBootRecord& action) {
  const auto save = [this, record = action.record] {
    const auto stored = boot_store_.store(record);
    if (!stored.problem.empty()) log::error("cannot save the boot record: {}", stored.problem);
    return stored.problem.empty();
  };
  const auto on_saved = [this](bool ok) {
    if (!ok) boot_->on_write_failed();
  };
  if (!worker_) return on_saved(save());  // at the end
  if (!worker_->ask(save, on_saved)) on_saved(false);
}

/// Without room the next boot still sees that this one was healthy.
void TimingNode::carry_out(const NoteHealthySuite& /*action*/) {
  if (worker_) (void)worker_->post([var = var()] { suite::forget_suite_starts(var); });
  calm_timer_ = create_one_shot(
      monotonic_now() + deployment().step_down.calm,
      [this] {
        if (!worker_) return;
        (void)worker_->post([boot = var().boot()] {
          if (const auto problem = suite::StepStore(boot).change(suite::on_calm); !problem.empty())
            log::error("the step of the start stays as it is: {}", problem);
        });
      },
      "calm");
}

void TimingNode::feed_watchdog() {
  if (critical_) critical_->ask(monotonic_now(), [this](const std::string& node) { return pid_of(node); });
  run(feeding_->on_due(monotonic_now()));
}

void TimingNode::note_feeding(bool fed) {
  const MonotonicTime t = monotonic_now();
  const bool valid = time().pulse_clock().time_valid();
  run(boot_->on_feeding(fed, t, valid ? std::optional(time().utc_at(t)) : std::nullopt));
}

void TimingNode::carry_out(const FeedWatchdog& /*action*/) {
  note_feeding(true);
  if (watchdog_->feed()) ++watchdog_feeds_;
}

void TimingNode::carry_out(const WithholdWatchdog& /*action*/) {
  note_feeding(false);
  ++watchdog_withheld_;
}

void TimingNode::carry_out(const ReportWithheld& action) {
  log::error("watchdog not fed: {}", action.what);
  raise(mission::TimingWatchdogWithheldEvent{.what = action.what});
}

void TimingNode::publish_housekeeping() {
  const PulseClock& pulses = time().pulse_clock();
  const PulseClock::Counters& clock = pulses.counters();
  const wire::GnssTimeStream::Counters& gnss = gnss_.counters();
  const MonotonicTime at = last_tick_ ? last_tick_->due : now();
  const UtcTime utc = time().utc_at(at);
  mission::TimingHousekeeping hk;
  hk.cycle = last_tick_ ? last_tick_->cycle : next_cycle_;
  hk.ticks = ticks_published_;
  hk.sync_state = pulses.state();
  hk.time_valid = pulses.time_valid();
  hk.utc = to_tai(utc, static_cast<int>(get_parameter<std::int64_t>("leap_seconds")));
  hk.offset_us = static_cast<float>(pulses.offset().count()) * 1e-3F;
  hk.drift_ppm = static_cast<float>(pulses.drift_ppm());
  hk.pulses_seen = as_u32(clock.pulses);
  hk.pulses_rejected = as_u32(clock.outliers + clock.repeated_pulses);
  hk.sentences_seen = as_u32(gnss.times);
  hk.sentences_rejected = as_u32(gnss.rejected() + clock.implausible_times + clock.times_without_pulse);
  hk.pulse_outliers = as_u32(clock.outliers);
  hk.times_without_pulse = as_u32(clock.times_without_pulse);
  hk.week_rollovers = as_u32(clock.week_rollovers);
  hk.leap_seconds_seen = as_u32(gnss.leap_seconds);
  hk.gps_line_reopened = as_u32(pulse_->counters().reopened + serial_->counters().reopened);
  hk.estimated_error_us = telemetered_error_us(time().error_at(at));
  hk.times_commanded = times_commanded_;
  hk.kernel_clock_refused = as_u32(system_clock_ ? system_clock_->refused() : 0);
  hk.watchdog_feeds = watchdog_feeds_;
  hk.watchdog_withheld = watchdog_withheld_;
  hk.max_tick_lateness_us = as_us(max_lateness_);
  hk.ticks_skipped = as_u32(skipped_before_ + (ticks_ ? ticks_->skipped_total() : 0));
  hk.phase_adoptions = as_u32(clock.phase_adoptions);
  hk.times_set = as_u32(clock.times_set);
  hk.time_jumps_refused = as_u32(clock.jumps_refused);
  hk.cycles_unreserved = as_u32(reservation_->unreserved());
  hk.reservation_failures = as_u32(reservation_->failed_writes());
  const auto timeout = watchdog_ ? watchdog_->timeout() : std::nullopt;
  hk.watchdog_timeout_s =
      static_cast<std::uint16_t>(std::clamp<std::int64_t>(timeout ? timeout->count() : 0, 0, 0xFFFF));
  if (critical_) {
    const CriticalAnswers::Counters& critical = critical_->answers().counters();
    hk.critical_asked = as_u32(critical.asked);
    hk.critical_answered = as_u32(critical.answered);
    hk.critical_refused = as_u32(critical.wrong_nonce + critical.not_active);
  }
  hk.boot_count = boot_ ? boot_->record().count : 0;
  hk.reset_cause = boot_ ? boot_->cause() : mission::ResetCause::unknown;
  hk.boot_healthy = boot_ && boot_->record().healthy;
  hk.unhealthy_boots = boot_ ? boot_->record().unhealthy_boots : 0;
  hk.dds_malformed = as_u32(malformed_samples());
  hk.events_suppressed = as_u32(suppressed_events());
  publish_telemetry(suite::telemetry_message(name(), hk, hk.cycle, utc, hk.time_valid, at));
  max_lateness_ = nanoseconds(0);
}

}  // namespace srfs
