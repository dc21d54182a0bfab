#include "nodes/timing/timing_node.hpp"

#include <sys/epoll.h>

#include <algorithm>

#include <mission/structures.hpp>

#include "base/process.hpp"
#include "hw/open.hpp"
#include "ros/mission_time.hpp"

namespace srfs {
namespace {

using ros::CallbackReturn;

constexpr nanoseconds housekeeping_period = seconds(1);
constexpr nanoseconds feed_period = seconds(1);
constexpr nanoseconds save_period = seconds(60);
constexpr std::uint64_t refused_jumps_per_event = 60;  // one event a minute while the receiver insists

std::uint32_t as_u32(std::uint64_t v) {
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(v, 0xFFFFFFFFU));
}
std::uint32_t as_us(nanoseconds d) {
  return as_u32(static_cast<std::uint64_t>(std::max<std::int64_t>(0, d.count() / 1000)));
}

}  // namespace

TimingNode::TimingNode(ros::NodeContext& context)
    : LifecycleNode(context), store_(state_dir()), boot_store_(var().boot()) {
  declare_parameters();
}

void TimingNode::declare_parameters() {
  declare_parameter("tick_period_ms", std::int64_t{1000}, ros::ParameterRange{1, 60000},
                    "Period of the tick; divides the second or is a whole number of seconds");
  declare_parameter(
      "late_tick_ms", std::int64_t{50}, ros::ParameterRange{1, 60000},
      "A tick handled later than this is late; the watchdog is not fed after more than five in a row");
  declare_parameter("gps_baud", std::int64_t{9600}, ros::ParameterRange{4800, 921600},
                    "Line rate of the GPS receiver", true);
  declare_parameter("outlier_limit_us", std::int64_t{2000}, ros::ParameterRange{10, 200000},
                    "Largest accepted distance of a pulse from its prediction", true);
  declare_parameter("time_jump_limit_s", std::int64_t{2}, ros::ParameterRange{0, 86400},
                    "Largest change of a valid time that is taken over without an operator", true);
  declare_parameter("leap_seconds", std::int64_t{default_leap_seconds}, ros::ParameterRange{30, 60},
                    "TAI minus UTC");
  declare_parameter("watchdog_timeout_s", std::int64_t{30}, ros::ParameterRange{1, 3600},
                    "Time-out asked of the hardware watchdog", true);
  declare_parameter("healthy_after_s", std::int64_t{600}, ros::ParameterRange{1, 86400},
                    "The watchdog was fed for so long without a gap: the boot record calls this boot healthy",
                    true);
  on_parameter_check(
      [](const std::string& name, const ros::ParameterValue& value) -> Result<void, std::string> {
        if (name == "tick_period_ms" && !is_tick_period(milliseconds(std::get<std::int64_t>(value)))) {
          return Err(std::string("tick_period_ms: expected a divisor of 1000 or a multiple of it"));
        }
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
  feeding_.emplace(tick_period(), milliseconds(get_parameter<std::int64_t>("late_tick_ms")));
  for (const WatchdogEvidence& evidence : evidence_) feeding_->add_evidence(evidence);
  if (!critical_) return;
  for (WatchdogEvidence& evidence : critical_->evidence()) feeding_->add_evidence(std::move(evidence));
}

void TimingNode::add_watchdog_evidence(WatchdogEvidence evidence) {
  evidence_.push_back(evidence);
  if (feeding_) feeding_->add_evidence(std::move(evidence));
}

// ---------------------------------------------------------------- lifecycle

CallbackReturn TimingNode::on_configure() {
  if (!is_tick_period(tick_period())) {
    set_failure_reason("parameter 'tick_period_ms': expected a divisor of 1000 or a multiple of it");
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
  if (!boot_) stored_boot_ = boot_store_.load();
  const TimingRecord record = store_.load();
  const CarriedTime start = carry_on(record, boot_id_, monotonic_now());
  clock_.emplace(clock_settings(), start.utc, monotonic_now(), start.valid);
  if (!reservation_) {  // this process's own count goes on across a clean-up
    reservation_.emplace(record.cycle_ceiling);
    next_cycle_ = reservation_->first_cycle();
  }
  // The first reservation is on disk before the first tick.
  if (const auto ceiling = reservation_->wanted(next_cycle_)) {
    const auto written = store_.save(record_now(*ceiling));
    if (!written) log::error("the cycle number may repeat after a restart: {}", written.error().message);
    reservation_->on_written(*ceiling, written.has_value());
  }

  worker_ = create_worker("store", 4);
  tick_publisher_ = create_publisher(ros::topics::time_tick);
  pulse_watch_ = watch_fd(
      pulse_->fd(), EPOLLIN, [this](std::uint32_t) { on_pulse_input(); }, "gps pulse");
  serial_watch_ = watch_fd(
      serial_->fd(), EPOLLIN, [this](std::uint32_t) { on_serial_input(); }, "gps serial");
  housekeeping_timer_ = create_timer(
      housekeeping_period, [this] { publish_housekeeping(); }, "housekeeping");
  save_timer_ = create_timer(
      save_period, [this] { save_time(); }, "save time");
  return CallbackReturn::success;
}

Result<void, std::string> TimingNode::prepare_critical_watch() {
  const ros::RingSettings& ring = deployment().ring;
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
  if (critical_) critical_->ask(monotonic_now());
  ticks_.emplace(tick_period(), next_cycle_, monotonic_now() + milliseconds(1));
  arm_tick();
  feed_timer_ = create_timer(
      feed_period, [this] { feed_watchdog(); }, "watchdog");
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
  if (boot_) {
    boot_->on_feeding_ended();
    save_boot_record();
  }
  return CallbackReturn::success;
}

void TimingNode::close() {
  housekeeping_timer_.reset();
  save_timer_.reset();
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
  if (boot_) boot_->on_end();
  save_boot_record();
  close();
  return CallbackReturn::success;
}

CallbackReturn TimingNode::on_error() {
  on_deactivate();
  close();
  return CallbackReturn::success;
}

// ---------------------------------------------------------------- tick

ros::WorkStatus TimingNode::work_status() const {
  ros::WorkStatus work;
  work.done = static_cast<std::uint32_t>(ticks_published_);
  if (ticks_ && ticks_->next_due() <= now()) {
    work.due = 1;
    work.oldest_due = ticks_->next_due();
  }
  return work;
}

void TimingNode::arm_tick() {
  tick_timer_ = create_one_shot(
      ticks_->next_due(), [this] { on_tick_due(); }, "tick");
}

void TimingNode::on_tick_due() {
  const MonotonicTime t = monotonic_now();
  clock_->on_time_passing(t);
  if (const auto grid = clock_->grid()) ticks_->follow(*grid);
  const auto tick = ticks_->on_wakeup(t);
  if (tick) publish(*tick);
  arm_tick();
  if (!tick) return;
  feeding_->on_tick(tick->late, t);
  reserve_cycles();
  report_sync_change();
}

void TimingNode::publish(const Tick& tick) {
  srfs_msgs::msg::TimeTick m;
  m.cycle = tick.cycle;
  m.utc = ros::to_message(clock_->utc_at(tick.due));
  m.time_valid = clock_->time_valid();
  m.monotonic_ns = static_cast<std::uint64_t>(tick.due.ns());
  m.sync_state = static_cast<std::uint8_t>(clock_->state());
  m.offset_s = static_cast<double>(clock_->offset().count()) * 1e-9;
  m.period_us = static_cast<std::uint32_t>(tick_period() / microseconds(1));
  m.incarnation = incarnation();
  m.published_ns = static_cast<std::uint64_t>(monotonic_now().ns());
  tick_publisher_->publish(m);

  reservation_->on_published(tick.cycle);
  last_tick_ = tick;
  ++ticks_published_;
  max_lateness_ = std::max(max_lateness_, tick.late);
}

void TimingNode::reserve_cycles() {
  if (const auto ceiling = reservation_->wanted(ticks_->next_cycle())) save(*ceiling);
}

TimingRecord TimingNode::record_now(MissionCycle ceiling) const {
  const MonotonicTime t = monotonic_now();
  return {ceiling, clock_->utc_at(t), t, boot_id_, clock_->time_valid()};
}

void TimingNode::save_time() {
  if (const auto ceiling = reservation_->renewed()) save(*ceiling);
}

void TimingNode::save(MissionCycle ceiling) {
  const TimingRecord record = record_now(ceiling);
  auto ok = std::make_shared<bool>(false);
  const bool taken = worker_->post(
      [this, record, ok] {
        const auto written = store_.save(record);
        *ok = written.has_value();
        if (!written) log::error("the cycle number may repeat after a restart: {}", written.error().message);
      },
      [this, record, ok] { reservation_->on_written(record.cycle_ceiling, *ok); });
  if (!taken) reservation_->on_written(ceiling, false);
}

// ---------------------------------------------------------------- GPS

void TimingNode::on_pulse_input() {
  while (const auto pulse = pulse_->read()) {
    if (pulse->edge > monotonic_now())
      continue;  // no edge can be in the future; it would shut out all true ones
    clock_->on_pulse(pulse->edge);
    last_pulse_ = pulse->edge;
  }
  report_sync_change();
}

void TimingNode::on_serial_input() {
  on_pulse_input();  // the pulse a sentence belongs to comes first
  std::array<std::uint8_t, 512> buffer;
  const auto count = serial_->read(buffer);
  if (!count || *count == 0) return;
  for (const wire::NmeaTime& time : nmea_.push(OctetView(buffer).first(*count))) take_time_of_day(time);
}

void TimingNode::take_time_of_day(const wire::NmeaTime& time) {
  const bool whole_second = time.utc && time.utc->since_epoch() % seconds(1) == nanoseconds(0);
  if (!time.fix_valid || !whole_second) return;
  switch (clock_->on_time_of_day(*time.utc, now())) {
    case TimeOfDayVerdict::set:
      log::info("time set to {}", to_iso8601(*time.utc));
      raise(mission::TimingTimeSetEvent{
          .utc = to_tai(*time.utc, static_cast<int>(get_parameter<std::int64_t>("leap_seconds")))});
      save_time();
      break;
    case TimeOfDayVerdict::jump_refused:
      if (clock_->counters().jumps_refused % refused_jumps_per_event != 1) break;
      log::warn("time of day differs by {} s, not taken over", clock_->refused_jump() / seconds(1));
      raise(mission::TimingTimeJumpRefusedEvent{
          .difference_s = static_cast<double>(clock_->refused_jump().count()) * 1e-9});
      break;
    case TimeOfDayVerdict::agrees:
    case TimeOfDayVerdict::waiting:
    case TimeOfDayVerdict::implausible:
    case TimeOfDayVerdict::no_pulse:
      break;
  }
}

void TimingNode::report_sync_change() {
  if (clock_->state() == reported_state_) return;
  reported_state_ = clock_->state();
  if (reported_state_ == SyncState::locked) {
    const auto offset_us = static_cast<float>(clock_->offset().count()) * 1e-3F;
    log::info("locked to the GPS pulse, offset {:.1f} us, drift {:.2f} ppm", offset_us, clock_->drift_ppm());
    raise(mission::TimingLockedEvent{.offset_us = offset_us});
  } else if (reported_state_ == SyncState::holdover) {
    const nanoseconds silent = monotonic_now() - last_pulse_;
    log::warn("no GPS pulse for {} ms, holdover", silent / milliseconds(1));
    raise(mission::TimingHoldoverEvent{.silent_ms =
                                           as_u32(static_cast<std::uint64_t>(silent / milliseconds(1)))});
  }
}

// ---------------------------------------------------------------- watchdog and housekeeping

/// Whether this process is the first of a new boot, as soon as the watchdog could be asked.
void TimingNode::begin_boot() {
  const hw::WatchdogFacts& facts = watchdog_->facts();
  const auto in_force = watchdog_->timeout();
  if (critical_ && in_force) {
    const ros::RingSettings& ring = deployment().ring;
    const WatchdogBudget budget = watchdog_budget(ring.period, ring.misses, ring.start_deadline);
    // It runs already, so it is fed none the less.
    if (*in_force <= budget.least_timeout)
      log::error("the watchdog's time-out is {} s: it may bite while the ring recovers a node",
                 in_force->count());
  }
  if (boot_) return;
  const std::string boot = facts.boot.empty() ? boot_id_ : boot_id_ + "/" + facts.boot;
  boot_.emplace(
      stored_boot_, BootFacts{boot, facts.reset_by_watchdog},
      BootKeeper::Settings{.healthy_after = seconds(get_parameter<std::int64_t>("healthy_after_s")),
                           .withheld_after = seconds(get_parameter<std::int64_t>("watchdog_timeout_s")) / 2});
  if (boot_->is_new_boot()) {
    const wire::BootRecord& record = boot_->record();
    log::info("boot {}, reset cause {}", record.count, mission::to_text(boot_->cause()));
    raise(mission::TimingBootEvent{.count = record.count, .cause = boot_->cause()});
  }
  save_boot_record();
}

void TimingNode::save_boot_record() {
  if (!boot_) return;
  const auto record = boot_->take_unwritten();
  if (!record) return;
  const auto write = [this](const wire::BootRecord& r) {
    const auto written = boot_store_.save(r);
    if (!written) log::error("the boot record is not durable: {}", written.error().message);
    return written.has_value();
  };
  if (!worker_) {  // at the end
    (void)write(*record);
    return;
  }
  auto ok = std::make_shared<bool>(false);
  const bool taken = worker_->post([write, r = *record, ok] { *ok = write(r); },
                                   [this, ok] {
                                     if (!*ok) boot_->on_write_failed();
                                   });
  if (!taken) boot_->on_write_failed();
}

void TimingNode::feed_watchdog() {
  if (critical_) critical_->ask(monotonic_now());
  const auto missing = feeding_->missing(monotonic_now());
  const auto utc = clock_->time_valid() ? std::optional(clock_->utc_at(monotonic_now())) : std::nullopt;
  boot_->on_feeding(!missing, monotonic_now(), utc);
  save_boot_record();
  if (!missing) {
    if (watchdog_->feed()) ++watchdog_feeds_;
    last_missing_.clear();
    return;
  }
  ++watchdog_withheld_;
  if (*missing == last_missing_) return;
  last_missing_ = *missing;
  log::error("watchdog not fed: {}", *missing);
  raise(mission::TimingWatchdogWithheldEvent{.what = *missing});
}

void TimingNode::publish_housekeeping() {
  const PulseClock::Counters& clock = clock_->counters();
  const wire::NmeaReceiver::Counters& nmea = nmea_.counters();
  const MonotonicTime at = last_tick_ ? last_tick_->due : now();
  const UtcTime utc = clock_->utc_at(at);
  mission::TimingHousekeeping hk;
  hk.cycle = last_tick_ ? last_tick_->cycle : next_cycle_;
  hk.ticks = ticks_published_;
  hk.sync_state = static_cast<mission::SyncState>(clock_->state());
  hk.time_valid = clock_->time_valid();
  hk.utc = to_tai(utc, static_cast<int>(get_parameter<std::int64_t>("leap_seconds")));
  hk.offset_us = static_cast<float>(clock_->offset().count()) * 1e-3F;
  hk.drift_ppm = static_cast<float>(clock_->drift_ppm());
  hk.pulses_seen = as_u32(clock.pulses);
  hk.pulses_rejected = as_u32(clock.outliers + clock.repeated_pulses);
  hk.sentences_seen = as_u32(nmea.times);
  hk.sentences_rejected = as_u32(nmea.bad_checksum + nmea.malformed + nmea.cut_short + nmea.too_long +
                                 clock.implausible_times + clock.sentences_without_pulse);
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
    hk.critical_refused = as_u32(critical.wrong_nonce + critical.wrong_state);
  }
  hk.boot_count = boot_ ? boot_->record().count : 0;
  hk.reset_cause = boot_ ? boot_->cause() : mission::ResetCause::unknown;
  hk.boot_healthy = boot_ && boot_->record().healthy;
  hk.unhealthy_boots = boot_ ? boot_->record().unhealthy_boots : 0;
  hk.dds_malformed = as_u32(malformed_samples());
  hk.events_suppressed = as_u32(suppressed_events());
  publish_telemetry(ros::telemetry_message(name(), hk, hk.cycle, utc, hk.time_valid, at));
  max_lateness_ = nanoseconds(0);
}

}  // namespace srfs
