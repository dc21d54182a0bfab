// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/timing.hpp"

#include "base/text.hpp"
#include "ros/lifecycle.hpp"
#include "ros/time_message.hpp"

namespace srfs::simulation {
namespace {

// As launch_config/sim.yaml and the defaults of TimingNode's parameters.
constexpr nanoseconds tick_period = milliseconds(100);
constexpr nanoseconds late_tick = milliseconds(50);
constexpr nanoseconds save_period = seconds(60);
constexpr nanoseconds discipline_period = milliseconds(500);
constexpr nanoseconds feed_period = seconds(1);
constexpr nanoseconds healthy_after = seconds(120);

std::vector<std::string> names_of(const std::vector<Host*>& hosts) {
  std::vector<std::string> names;
  for (const Host* host : hosts) names.push_back(host->name());
  return names;
}

}  // namespace

Timing::Timing(Host& host, TimingSurroundings surroundings)
    : host_(host),
      around_(std::move(surroundings)),
      feeding_(tick_period, late_tick),
      critical_(names_of(around_.critical), host.incarnation(),
                watchdog_budget(milliseconds(100), 5, milliseconds(3000)).evidence_lifetime),
      tick_(host.kernel(), host.guard(), [this] { on_tick_due(); }) {}

void Timing::start() {
  const ClockStart start = read_records();
  clock_.emplace(start.utc, host_.now());
  timekeeper_.emplace(PulseClockSettings{}, start, host_.now(), *clock_);
  // The first reservation is on disk before the first tick.
  for (const ReservationAction& action : reservation_->reserve(reservation_->first_cycle())) {
    const MissionCycle ceiling = std::get<SaveCycles>(action).ceiling;
    reservation_->on_written(ceiling, around_.disk.write_now("timing/time", record_now(ceiling)));
  }
  begin();
}

Timing::~Timing() {
  around_.gps.reader = nullptr;
}

ClockStart Timing::read_records() {
  TimingRecord record;
  if (const auto content = around_.disk.read("timing/time")) {
    const auto decoded = decode_timing_record(std::string(as_text(*content)));
    if (!decoded) throw Violation{"T1", "the record of the time cannot be read"};
    record = *decoded;
  }
  if (const auto content = around_.disk.read("boot")) {
    if (auto decoded = wire::decode_boot_record(std::string(as_text(*content)))) stored_boot_ = *decoded;
  }
  reservation_.emplace(record.cycle_ceiling);
  const CarriedTime carried = carry_on(record, around_.boot_id, host_.now());
  return {carried.utc, carried.valid, carried.error, carried.drift_ppm};
}

void Timing::begin() {
  for (std::size_t i = 0; i < around_.critical.size(); ++i) {
    feeding_.add_evidence({around_.critical[i]->name() + " is not Active",
                           [this, i](MonotonicTime now) { return critical_.holds(i, now); }});
  }
  boot_.emplace(
      stored_boot_, BootFacts{around_.boot_id, around_.watchdog.bit},
      BootRecorder::Settings{.healthy_after = healthy_after, .withheld_after = WatchdogTimer::timeout / 2});
  run(boot_->begin());
  if (!around_.watchdog.fed) around_.watchdog.fed = host_.now();
  ask_critical();
  ticks_.emplace(tick_period, reservation_->first_cycle(), host_.now() + milliseconds(1));
  tick_.arm(ticks_->next_due());
  host_.every(feed_period, [this] { feed(); });
  host_.every(discipline_period, [this] { run(timekeeper_->on_time_passing(host_.now())); });
  host_.every(save_period, [this] { run(reservation_->renew()); });
  Gps& gps = around_.gps;
  gps.reader = &host_;
  gps.on_pulse = [this](MonotonicTime edge) {
    run(timekeeper_->on_pulse(edge, host_.now()));
    run(timekeeper_->review_state(host_.now()));
  };
  gps.on_sentences = [this](const Octets& sentences) {
    for (const wire::GnssTime& time : gnss_.push(sentences))
      run(timekeeper_->on_time_of_day(time, host_.now()));
  };
}

void Timing::on_tick_due() {
  if (const auto grid = time().pulse_clock().grid()) ticks_->follow(*grid);
  const auto tick = ticks_->on_wakeup(host_.now());
  if (tick) publish(*tick);
  tick_.arm(ticks_->next_due());
  if (!tick) return;
  feeding_.on_tick(tick->late, host_.waited() - std::exchange(waited_, host_.waited()), host_.now());
  run(reservation_->reserve(ticks_->next_cycle()));
}

void Timing::publish(const Tick& tick) {
  // While the disk fails the tick goes on without a reservation, and is counted; those numbers may come
  // again.
  if (tick.cycle <= around_.reserved_cycle && around_.reserved_cycle != 0)
    throw Violation{"T1", "cycle " + std::to_string(tick.cycle) + " was published before"};
  srfs_msgs::msg::TimeTick m;
  m.cycle = tick.cycle;
  m.utc = ros::to_message(time().utc_at(tick.due));
  m.time_valid = time().pulse_clock().time_valid();
  m.monotonic_ns = static_cast<std::uint64_t>(tick.due.ns());
  m.sync_state = static_cast<std::uint8_t>(time().pulse_clock().state());
  host_.kernel().coverage().note(StateTable::sync, host_.incarnation(), m.sync_state);
  m.period_us = static_cast<std::uint32_t>(tick_period / microseconds(1));
  m.incarnation = host_.incarnation();
  m.published_ns = static_cast<std::uint64_t>(host_.now().ns());
  host_.action_point();
  around_.topics.time_tick.publish(host_, std::move(m));
  around_.newest_cycle = std::max(around_.newest_cycle, tick.cycle);
  const std::uint64_t unreserved = reservation_->unreserved();
  reservation_->on_published(tick.cycle);
  if (reservation_->unreserved() == unreserved) around_.reserved_cycle = tick.cycle;
}

void Timing::ask_critical() {
  for (std::size_t i = 0; i < around_.critical.size(); ++i) {
    Host& node = *around_.critical[i];
    if (node.pid() != 0)
      critical_.on_cpu(i, node.pid(), CpuTotals{node.waited(), nanoseconds(0), node.waited()}, host_.now());
    const std::uint64_t nonce = critical_.ask(i, host_.now());
    if (!around_.network.hears(host_, node)) continue;
    node.later(around_.network.delay(), [this, i, nonce, &node, pid = host_.pid(), &own = host_] {
      if (own.pid() != pid || !around_.network.hears(node, own)) return;
      own.later(around_.network.delay(), [this, i, nonce] {
        critical_.on_answer(i, nonce, static_cast<std::uint8_t>(ros::State::active));
      });
    });
  }
}

void Timing::feed() {
  ask_critical();
  for (const FeedingAction& action : feeding_.on_due(host_.now())) {
    host_.action_point();
    if (std::holds_alternative<FeedWatchdog>(action)) {
      note_feeding(true);
      host_.output([this, now = host_.now()] { around_.watchdog.fed = now; });
    } else if (std::holds_alternative<WithholdWatchdog>(action)) {
      note_feeding(false);
      host_.trace(Lane::world, "watchdog withheld");
    }
  }
}

void Timing::note_feeding(bool fed) {
  const bool valid = time().pulse_clock().time_valid();
  run(boot_->on_feeding(fed, host_.now(), valid ? std::optional(time().utc_at(host_.now())) : std::nullopt));
}

Octets Timing::record_now(MissionCycle ceiling) const {
  const MonotonicTime now = host_.now();
  const PulseClock& pulses = time().pulse_clock();
  TimingRecord record{ceiling,         time().utc_at(now),  now,
                      around_.boot_id, pulses.time_valid(), time().error_at(now).value_or(seconds(1000))};
  if (pulses.drift_known()) record.drift_ppm = pulses.drift_ppm();
  return octets_of_text(encode_timing_record(record));
}

void Timing::save(MissionCycle ceiling) {
  around_.disk.write(host_, "timing/time", record_now(ceiling),
                     [this, ceiling](bool ok) { reservation_->on_written(ceiling, ok); });
}

void Timing::run(const ReservationActions& actions) {
  for (const ReservationAction& action : actions) save(std::get<SaveCycles>(action).ceiling);
}

void Timing::run(BootActions actions) {
  for (const BootAction& action : actions) {
    host_.action_point();
    if (const auto* boot = std::get_if<ReportBoot>(&action))
      host_.trace(host_.lane(), "boot", boot->count, static_cast<std::uint64_t>(boot->cause));
    const auto* saved = std::get_if<SaveBootRecord>(&action);
    if (saved == nullptr) continue;
    around_.disk.write(host_, "boot", octets_of_text(wire::encode_boot_record(saved->record)),
                       [this](bool ok) {
                         if (!ok) boot_->on_write_failed();
                       });
  }
}

void Timing::run(TimeActions actions) {
  for (const TimeAction& action : actions) {
    host_.trace(host_.lane(), "time", action.index());
    if (std::holds_alternative<ReportTimeSet>(action)) run(reservation_->renew());
  }
}

}  // namespace srfs::simulation
