// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The way of a telecommand: line, decision, journal, execution, end. Telemetry is in ttc_telemetry.cpp,
// monitoring and event-action in ttc_monitoring.cpp.
#include "nodes/ttc/ttc_core.hpp"

#include <algorithm>
#include <set>

#include <fmt/format.h>

#include "base/saturate.hpp"

namespace srfs {
namespace {

constexpr std::size_t frames_per_read = TtcCore::read_octets / 26 + 2;  ///< the shortest CLTU has 26 octets
constexpr std::uint8_t verification_service = 1;
/// Control commands need no key: what they change is written no more often than this.
constexpr milliseconds schedule_retry_period{50};  ///< what is due and not released waits for room
ModeWhy no_telecommand() {
  return {.cause = ModeCause::command_loss, .reason = "no telecommand came"};
}

constexpr const char* journal_name = "journal of telecommands";

std::vector<std::string> asked_nodes(const suite::ModeSettings& modes) {
  std::set<std::string> nodes;
  for (const auto& [mode, rows] : modes.table) {
    for (const auto& [node, reaction] : rows) nodes.insert(node);
  }
  return {nodes.begin(), nodes.end()};
}

AvailableKeySets key_sets_of(const UplinkConfig& config) {
  AvailableKeySets sets;
  for (const UplinkChannel& channel : config.channels) {
    for (const UplinkAssociation& association : channel.associations) {
      if (association.set) sets.emplace_back(channel.vc, *association.set);
    }
  }
  return sets;
}

}  // namespace

TtcCore::TtcCore(Setup setup)
    : dictionary_(setup.dictionary),
      node_(std::move(setup.node)),
      journal_(std::move(setup.journal)),
      mode_(std::move(setup.mode)),
      causes_(dictionary_, setup.modes, setup.begun),
      obedience_(dictionary_, asked_nodes(setup.modes)),
      transmitter_(std::move(setup.transmitter)),
      command_loss_(std::move(setup.command_loss)),
      hazards_(setup.arm_window),
      key_sets_(key_sets_of(setup.uplink)),
      forwarder_(report_queue_),
      housekeeping_(report_queue_),
      events_(report_queue_),
      mode_service_(mode_, hazards_, report_queue_, &causes_),
      arming_(dictionary_, mode_, hazards_, report_queue_),
      key_service_(key_sets_, report_queue_),
      key_management_(std::move(setup.session_keys), std::move(setup.masters),
                      rekeyable_associations(setup.uplink), uplink_, report_queue_),
      rescue_service_(report_queue_),
      transmitter_service_(transmitter_, report_queue_),
      time_reports_(report_queue_),
      schedule_(journal_, report_queue_, setup.schedule_late_max),
      retrieval_(report_queue_),
      stores_(dictionary_, setup.stores, report_queue_, retrieval_),
      connections_(dictionary_, node_, report_queue_),
      parameters_(dictionary_, report_queue_, mission::apid::ttc),
      file_service_(report_queue_, mission::apid::ttc),
      imaging_(report_queue_, setup.lane),
      monitoring_(dictionary_, setup.monitors, report_queue_),
      event_actions_(dictionary_, report_queue_),
      router_({.dictionary = dictionary_,
               .mode = mode_,
               .hazards = hazards_,
               .forwarder = forwarder_,
               .report_queue = report_queue_,
               .services = {&housekeeping_, &events_, &mode_service_, &arming_, &key_service_,
                            &key_management_, &rescue_service_, &transmitter_service_, &time_reports_,
                            &schedule_, &retrieval_, &stores_, &connections_, &parameters_, &file_service_,
                            &imaging_, &monitoring_, &event_actions_}},
              node_),
      uplink_(std::move(setup.uplink), journal_.link()),
      gate_(setup.persist_deadline, journal_.revision()),
      downlink_(setup.downlink, std::move(setup.seal)),
      files_(setup.downlink.files_queue_octets / 2),
      beacon_(dictionary_),
      clock_(setup.clock),
      remembered_(std::move(setup.remembered)),
      copied_generation_(setup.copied_generation),
      journal_damaged_octets_(setup.journal_damaged_octets),
      journal_damage_(std::move(setup.journal_damage)),
      boot_(setup.boot),
      step_(std::move(setup.step)),
      begun_(setup.begun),
      first_start_(setup.first_start),
      floor_wanted_(setup.floor),
      lifetime_(setup.lifetime),
      key_selection_(std::move(setup.keys)),
      unusable_keys_(std::move(setup.unusable_keys)),
      key_news_(std::move(setup.key_news)),
      unusable_masters_(std::move(setup.unusable_masters)),
      session_keys_lost_(std::move(setup.session_keys_lost)) {
  schedule_.set_request_check([this](OctetView packet) { return router_.check_scheduled(packet); });
  event_actions_.load(setup.event_actions, [this](OctetView packet) { return why_no_action(packet); });
  if (monitoring_.is_damaged()) damaged_tables_.push_back(MonitoringService::table_name);
  if (event_actions_.is_damaged()) damaged_tables_.push_back(EventActionService::table_name);
}

// ---- start and end

void TtcCore::restore(MonotonicTime now) {
  now_ = now;
  journal_.tell_refused_again(report_queue_);
  for (const AcceptedTelecommand* t : journal_.known()) {
    AcceptanceJournal::tell_again(*t, journal_.told(), report_queue_);
    if (t->origin.source_id == EventActionService::on_board_source) event_actions_.on_known_release(*t);
    if (!t->end) router_.restore(*t, now);
  }
  if (journal_.open() > 0)
    log(LogLine::Level::info, fmt::format("{} accepted telecommands go on", journal_.open()));
}

void TtcCore::activate(MonotonicTime now) {
  now_ = now;
  publish_mode();
  on_mode_changed();
  for (const std::string& problem : causes_.problems())
    log(LogLine::Level::error, problem + ": correct the deployment");
  if (!journal_damage_.empty()) {
    mission::TtcJournalDamagedEvent event;
    event.skipped = as_u32(journal_damaged_octets_);
    event.what = std::exchange(journal_damage_, {});
    send_event(event);
  }
  if (std::exchange(first_start_, false)) {
    mission::TtcFirstStartEvent event;
    event.boot_count = boot_.count;
    send_event(event);
  }
  if (floor_wanted_ == FloorWanted::counters_lost) report_counters(0, "any is taken until the time is valid");
  report_keys_at_start();
  report_damaged_tables();
  if (command_loss_.lost() && mode_.mode() != MissionMode::safe)
    change_mode(MissionMode::safe, no_telecommand());
}

void TtcCore::flush_journal(MonotonicTime now) {
  now_ = now;
  record_progress();
  uplink_.keep_flags();
  persist_journal(true);
}

// ---- what is to be done

/// The order: what was decided before goes first, ends come behind their record, and the line gets what all
/// of it has said.
TtcCore::Actions TtcCore::settle(MonotonicTime now) {
  now_ = now;
  run_command_loss();
  run_mode_causes();
  run_schedule();
  run_monitoring();
  run_event_actions();
  persist_journal();
  execute_passed();
  send_released();
  serve_files();
  ask_nodes();
  test_connection();
  begin_imaging_tasks();
  for (Telecommand& telecommand : forwarder_.take_publications())
    act(PublishTelecommand{std::move(telecommand)});
  send_reports(report_queue_.take(), std::nullopt);
  store_mode_change();
  store_key_change();
  store_session_keys();
  store_transmitter_change();
  store_rescue_entry();
  store_stores_change();
  store_tables();
  report_rejections();
  report_hazards();
  report_refused_frames();
  record_progress();
  persist_journal();
  send_released();
  carry_out_imaging_orders();
  uplink_.set_buffer_available(gate_.has_room(frames_per_read));
  return take_actions();
}

/// The soonest of every deadline of the logic.
std::optional<MonotonicTime> TtcCore::next_due(MonotonicTime now) const {
  std::optional<MonotonicTime> due;
  const auto sooner = [&](std::optional<MonotonicTime> t) {
    if (t && (!due || *t < *due)) due = t;
  };
  if (transmitter_.may_transmit(now)) sooner(downlink_.next_due(now));
  sooner(transmitter_.next_due(now));
  sooner(command_loss_.next_due(now));
  sooner(causes_.next_due(now));
  sooner(forwarder_.next_due());
  sooner(gate_.next_due());
  sooner(hazards_.next_due());
  sooner(uplink_.idle_deadline());
  if (const auto in = schedule_.next_due_in())
    sooner(now + (*in > nanoseconds(0) ? *in : schedule_retry_period));
  sooner(refused_frames_.next_due(uplink_.counters()));
  sooner(event_actions_.next_due(now));
  sooner(monitoring_.retry_at());
  sooner(event_actions_.retry_at());
  if (monitoring_.is_reporting() || event_actions_.is_reporting()) sooner(now + schedule_retry_period);
  sooner(file_service_.next_due());
  sooner(imaging_.next_due(imaging_time(now)));
  sooner(files_.next_due(files_room(now)));
  return due;
}

void TtcCore::on_deadline(MonotonicTime now) {
  forwarder_.on_time(now);
  gate_.on_time(now);
  file_service_.on_time(now);
  hazards_.on_time(now);
}

// ---- uplink

void TtcCore::on_octets(OctetView octets, MonotonicTime now) {
  now_ = now;
  tell_uplink_the_time();
  const std::uint64_t frames_before = uplink_.cltu_counters().cltus_decoded;
  take_uplinked(uplink_.push(octets, now));
  uplink_.set_buffer_available(gate_.has_room(frames_per_read));
  if (uplink_.cltu_counters().cltus_decoded != frames_before) downlink_.want_control_word(now);
}

/// When no telecommand came for so long that the command-loss timer acts, the clocks may be what is wrong.
void TtcCore::tell_uplink_the_time() {
  const bool judged = lifetime_ > seconds(0) && !command_loss_.lost();
  const auto utc = valid_utc();
  uplink_.set_age(judged ? std::optional<milliseconds>(lifetime_) : std::nullopt,
                  utc ? std::optional(clock_counter(*utc)) : std::nullopt);
}

void TtcCore::on_line_idle(MonotonicTime now) {
  now_ = now;
  tell_uplink_the_time();
  take_uplinked(uplink_.on_idle(now));
}

void TtcCore::take_uplinked(std::vector<UplinkedPacket> packets) {
  const bool authentic = std::any_of(packets.begin(), packets.end(), [this](const UplinkedPacket& packet) {
    return packet.frame.spi || !uplink_.authenticates();
  });
  if (authentic) on_contact();
  follow_confirmed_keys();
  for (UplinkedPacket& packet : packets) {
    files_.on_contact();
    if (cfdp::is_pdu_packet(packet.packet)) {
      files_.on_packet(packet.packet);  // repeated or lost, it does no harm: nothing waits for the disk
    } else {
      take_packet(std::move(packet));
    }
  }
  for (const UplinkedPacket& refused : uplink_.take_refused()) {
    const AcceptedTelecommand* known = journal_.find_repeated_frame(refused);
    if (known != nullptr) journal_.answer_repeat(*known, now_, report_queue_);
  }
}

void TtcCore::take_packet(UplinkedPacket packet) {
  if (const AcceptedTelecommand* known = journal_.find_repeated_packet(packet, now_)) {
    journal_.on_link(packet.link);
    journal_.answer_repeat(*known, now_, report_queue_);
    return;
  }
  const bool may_wait = gate_.has_room();
  JudgedTelecommand judged = router_.judge(packet.packet, now_, may_wait && journal_.has_room());
  if (!judged.refusal) {
    judged.telecommand.origin.id = journal_.accept(judged.telecommand, packet, now_);
  } else {
    record_refusal(judged, packet.link);
  }
  if (may_wait) {
    gate_.enter(std::move(judged), journal_.revision(), now_);
    return;
  }
  // Refused: its record is on its way to the disk, and is not waited for.
  gate_.refuse();
  const std::uint64_t serial = judged.refusal_serial;
  router_.carry_out(std::move(judged), now_);
  journal_.on_refusal_said(serial);
}

void TtcCore::record_refusal(JudgedTelecommand& judged, const LinkState& link) {
  const Refusal& refusal = *judged.refusal;
  judged.refusal_serial = journal_.refuse(
      judged.telecommand.origin,
      {.stage = refusal.stage, .success = false, .failure_code = refusal.code, .data = refusal.parameter},
      link);
}

// ---- journal

void TtcCore::persist_journal(bool sync_all) {
  journal_.on_link(uplink_.state());  // nothing unless a frame was accepted
  const bool awaited = gate_.wants_write(journal_.revision());
  const bool lazy = journal_.wants_write() || (sync_all && journal_.wants_sync());
  if (!awaited && !(lazy && gate_.may_write())) return;
  JournalBatch batch = journal_.take_batch(awaited || sync_all);
  gate_.on_write_begun(batch.revision);
  act(WriteJournal{std::move(batch)});
}

void TtcCore::on_journal_written(const JournalBatch& batch, const Result<void, FileError>& written,
                                 std::size_t used_octets, MonotonicTime now) {
  now_ = now;
  journal_.on_written(batch, written.has_value(), used_octets);
  // Without storage frames are taken all the same.
  if (uplink_.on_stored(written ? batch.link : uplink_.state())) downlink_.want_control_word(now);
  if (written && raised_generation_ && batch.link.generation >= *raised_generation_) {
    raised_generation_.reset();
    act(ForgetWantedFloor{});
  }
  gate_.on_write_done(written.has_value(), now);
  schedule_.on_written(batch.revision, written.has_value());
  note_storage(remembered_.journal_durable, written.has_value(), written ? "" : written.error().message,
               journal_name);
}

void TtcCore::note_journal_late() {
  note_storage(remembered_.journal_durable, false, "the journal of telecommands is not on disk",
               journal_name);
}

void TtcCore::execute_passed() {
  for (JudgedTelecommand& judged : gate_.take_passed()) {
    if (!judged.durable) {
      note_journal_late();
      uplink_.on_stored(uplink_.state());
    }
    settle_action(judged);
    const std::uint64_t serial = judged.refusal_serial;
    const MonotonicTime received = judged.received;
    router_.carry_out(std::move(judged), now_);
    if (serial != 0) journal_.on_refusal_said(serial);
    send_reports(report_queue_.take(), received);
  }
  for (const std::uint64_t id : router_.take_unstored_runs()) {
    mission::TtcRecoveryWithoutStorageEvent event;
    event.telecommand = id;
    raise(event);
  }
}

void TtcCore::send_released() {
  for (const auto& [report, sure] : gate_.take_released()) {
    if (!sure) note_journal_late();
    send(report);
    if (report.ends != 0) journal_.on_end_said(report.ends);
  }
}

void TtcCore::record_progress() {
  for (const std::uint64_t id : forwarder_.take_taken()) journal_.on_taken(id);
  for (const StageReached& stage : report_queue_.take_stages()) journal_.on_stage(stage);
}

void TtcCore::send_reports(const std::vector<Report>& reports, std::optional<MonotonicTime> received) {
  for (const Report& report : reports) {
    if (report.ends != 0) record_progress();  // its record is what it waits for
    if (report.ends != 0 && remembered_.journal_durable) {
      gate_.hold(report, journal_.revision(), now_);
      continue;
    }
    send(report);
    if (report.ends != 0) journal_.on_end_said(report.ends);
    const bool acceptance = report.service == verification_service && report.subtype <= 2;
    if (received && acceptance) act(AcceptanceSent{*received});
  }
}

void TtcCore::copy_link_state() {
  LinkState state = uplink_.stored_state();
  if (state.generation == copied_generation_) return;
  state.next_telecommand_id = journal_.next_id() + reserved_telecommand_ids;
  copied_generation_ = state.generation;
  act(CopyLinkState{std::move(state)});
}

/// The first valid time came. At a first start a ground station that was heard and counts no clock goes on
/// with its counters: it would be locked out in the middle of its work.
void TtcCore::raise_counters() {
  const bool lost = std::exchange(floor_wanted_, FloorWanted::no) == FloorWanted::counters_lost;
  const LinkState& state = uplink_.state();
  const std::uint64_t before = state.generation;
  const std::uint64_t floor = lost_counter_floor(clock_.utc_at(now_));
  const bool counts_no_clock =
      std::any_of(state.associations.begin(), state.associations.end(),
                  [](const LinkState::Association& a) { return a.counter < lowest_clock_counter; });
  if (lost || !counts_no_clock) uplink_.raise_counters(floor);
  if (state.generation != before) {
    raised_generation_ = state.generation;
  } else {
    act(ForgetWantedFloor{});  // nothing to write
  }
  if (lost) {
    log(LogLine::Level::warn, fmt::format("uplink counters that were lost go on behind {}", floor));
    report_counters(floor, "time is valid");
  } else if (!counts_no_clock) {
    log(LogLine::Level::info, fmt::format("the counters of the uplink begin behind {}", floor));
  } else {
    log(LogLine::Level::info, "the ground station counts no clock: the counters of the uplink get no floor");
  }
}

void TtcCore::report_counters(std::uint64_t floor, const std::string& why) {
  mission::TtcCountersLostEvent event;
  event.floor = floor;
  event.why = why;
  send_event(event);
}

// ---- schedule

void TtcCore::run_schedule() {
  schedule_.on_time(clock_.tai_at(now_), clock_.valid());
  schedule_.drop_overdue();
  for (const auto& event : schedule_.take_dropped()) raise(event);
  // In the order of time: what finds no room holds up what is due after it.
  while (const ScheduledActivity* activity = schedule_.due()) {
    if (!release(*activity)) break;
  }
}

bool TtcCore::release(const ScheduledActivity& activity) {
  if (!gate_.has_room() || !journal_.has_room()) return false;
  JudgedTelecommand judged = router_.judge(activity.packet, now_);
  if (!judged.refusal) {
    // It came in no frame: nothing repeats it.
    const UplinkedPacket packet{.frame = {}, .packet = activity.packet, .link = uplink_.state()};
    judged.telecommand.origin.id = journal_.accept(judged.telecommand, packet, now_, activity.id);
    schedule_.on_released();
  } else if (judged.refusal->code == mission::failure::queue_full) {
    return false;
  } else {
    record_refusal(judged, journal_.link());  // before its place in the schedule goes
    schedule_.on_refused(activity);
  }
  gate_.enter(std::move(judged), journal_.revision(), now_);
  return true;
}

// ---- command loss

void TtcCore::on_contact() {
  const auto loss = command_loss_.on_contact(now_);
  if (!loss) return;
  mission::TtcCommandLossOverEvent event;
  event.silent_s = as_u32(static_cast<std::uint64_t>(loss->silent / seconds(1)));
  event.steps = loss->steps;
  raise(event);
}

void TtcCore::run_command_loss() {
  const auto step = command_loss_.take_step(now_);
  if (!step) {
    if (command_loss_.take_save(now_)) act(WriteState{"command_loss", command_loss_.stored_text(now_), {}});
    return;
  }
  mission::TtcCommandLossEvent event;
  event.step = step->what;
  event.silent_s = as_u32(static_cast<std::uint64_t>(step->silent / seconds(1)));
  event.number = step->number;
  event.next_s = as_u32(static_cast<std::uint64_t>(step->until_next / seconds(1)));
  raise(event);
  log(LogLine::Level::warn, fmt::format("no telecommand for {} s: step {} of the command-loss timer, {}",
                                        event.silent_s, step->number, to_text(step->what)));
  StateChange then;
  if (step->what == CommandLossStep::safe_mode) change_mode(MissionMode::safe, no_telecommand());
  if (step->what == CommandLossStep::line) act(ReopenLine{});
  if (step->what == CommandLossStep::keys) fall_back_keys();
  if (step->what == CommandLossStep::restart) then = RestartWanted{};
  act(WriteState{"command_loss", command_loss_.stored_text(now_), then});
}

// ---- mode

std::optional<UtcTime> TtcCore::valid_utc() const {
  return clock_.valid() ? std::optional(clock_.utc_at(now_)) : std::nullopt;
}

void TtcCore::run_mode_causes() {
  mode_service_.set_utc(valid_utc());
  auto change = causes_.take_change(mode_, now_);
  const bool others = causes_.present() != mode_.present();
  if (others) mode_.set_present(causes_.present());
  if (!change) {
    if (others) act(WriteState{"mode", mode_.stored_text(), {}});
    return;
  }
  log(LogLine::Level::warn,
      fmt::format("mode {} now: {}", causes_.name_of(change->mode), change->why.reason));
  change_mode(change->mode, std::move(change->why));
}

void TtcCore::on_mode_changed() {
  budget_.set_rate(reaction().downlink_octets_s, now_);
  act(FollowMode{});
  send_health(now_);
}

void TtcCore::change_mode(MissionMode mode, ModeWhy why) {
  if (mode_.mode() != mode) hazards_.disarm(mission::DisarmReason::mode_changed);
  std::string text = mode_.change(mode, std::move(why), valid_utc());
  publish_mode();
  on_mode_changed();
  mission::TtcModeChangedEvent event;
  event.mode = mode_.mode();
  event.reason = mode_.reason();
  raise(event);
  act(WriteState{"mode", std::move(text), {}});
}

/// Each channel that has two sets takes the other one; the contingency association works with either.
void TtcCore::fall_back_keys() {
  std::set<std::uint8_t> with_a;
  std::set<std::uint8_t> with_both;
  for (const auto& [vc, set] : key_sets_) {
    if (set == KeySet::a) with_a.insert(vc);
  }
  for (const auto& [vc, set] : key_sets_) {
    if (set == KeySet::b && with_a.contains(vc)) with_both.insert(vc);
  }
  for (const std::uint8_t vc : with_both) {
    KeySet& selected = key_selection_.sets[vc];
    selected = selected == KeySet::a ? KeySet::b : KeySet::a;
    ++key_selection_.generation;
    act(WriteKeys{key_selection_, {.origin = {}, .vc = vc, .set = selected, .commanded = false}});
  }
}

// ---- services that need something done

void TtcCore::serve_files() {
  if (auto order = file_service_.next_order(now_)) act(ServeFile{std::move(*order)});
}

void TtcCore::on_file_outcome(const FileOutcome& outcome, MonotonicTime now) {
  file_service_.on_outcome(outcome, now);
  files_.on_change();
}

void TtcCore::ask_nodes() {
  if (auto call = parameters_.next_call(now_)) act(CallParameter{std::move(*call)});
  for (const auto& event : parameters_.take_refused()) raise(event);
}

void TtcCore::test_connection() {
  if (auto node = connections_.take_question()) act(TestConnection{std::move(*node)});
}

ImagingTime TtcCore::imaging_time(MonotonicTime now) const {
  return {.now = now, .utc = clock_.utc_at(now), .utc_valid = clock_.valid()};
}

void TtcCore::begin_imaging_tasks() {
  imaging_.on_time(imaging_time(now_), mode_.mode() == MissionMode::nominal && reaction().work);
  for (const ImagingScheduler::Failure& failure : imaging_.take_failures()) {
    mission::ImageTaskFailedEvent event;
    event.task = failure.task;
    event.why = failure.why;
    raise(event);
  }
}

/// Behind the record of the progress: a restart must find that a capture was asked for.
void TtcCore::carry_out_imaging_orders() {
  if (!journal_.is_written()) return;
  for (ImagingOrder& order : imaging_.take_orders()) {
    const bool for_the_disk = order.action == ImagingAction::list_frames ||
                              order.action == ImagingAction::queue_products ||
                              order.action == ImagingAction::stop_sending;
    if (for_the_disk) {
      imaging_jobs_.push_back(std::move(order));
    } else {
      act(ServeImaging{std::move(order)});
    }
  }
  run_imaging_job();
}

/// One at a time: the worker has room for it.
void TtcCore::run_imaging_job() {
  if (imaging_job_runs_ || imaging_jobs_.empty()) return;
  imaging_job_runs_ = true;
  act(ServeImages{std::move(imaging_jobs_.front())});
  imaging_jobs_.pop_front();
}

void TtcCore::on_imaging_job(const ImagingOrder& order, const ImagingOutcome& outcome) {
  imaging_job_runs_ = false;
  if (order.action == ImagingAction::list_frames) {
    imaging_.on_frames_listed(order.id, outcome.frames);
  } else if (order.action == ImagingAction::queue_products) {
    imaging_.on_products_queued(order.id, outcome.products.failure, outcome.products.reason,
                                outcome.products.queued);
  } else {
    imaging_.on_sending_stopped(order.id, outcome.products.queued, outcome.products.failure);
  }
  files_.on_change();
}

// ---- state that lasts

void TtcCore::on_state_written(const StateChange& change, bool stored) {
  if (const auto* mode = std::get_if<ModeChange>(&change)) mode_service_.on_stored(*mode, stored);
  if (const auto* off = std::get_if<TransmitterChange>(&change)) transmitter_service_.on_stored(*off, stored);
  if (const auto* stores = std::get_if<StoreChange>(&change)) stores_.change_stored(*stores, stored);
  if (std::holds_alternative<SilenceOver>(change) && !stored)
    log(LogLine::Level::error, "the silence that is over is still on disk");
  if (std::holds_alternative<RestartWanted>(change)) act(RestartComputer{});
}

void TtcCore::publish_mode() {
  act(PublishMode{mode_.mode(), causes_.name_of(mode_.mode()), mode_.change_count(), mode_.reason()});
}

void TtcCore::store_mode_change() {
  auto change = mode_service_.take_change();
  if (!change) return;
  publish_mode();
  on_mode_changed();
  mission::TtcModeChangedEvent event;
  event.mode = change->mode;
  event.reason = mode_.reason();
  raise(event);
  write_state("mode", std::move(*change));
}

/// The old keys work until the change is on disk: a crash before is as if it had not come.
void TtcCore::store_key_change() {
  const auto change = key_service_.take_change();
  if (!change) return;
  ++key_selection_.generation;
  key_selection_.sets[change->vc] = change->set;
  act(WriteKeys{key_selection_, *change});
}

void TtcCore::on_keys_written(const KeyChange& change, bool stored, MonotonicTime now) {
  now_ = now;
  uplink_.select(change.vc, change.set);
  if (change.commanded) key_service_.on_stored(change, stored);
  const std::string why = change.commanded ? "commanded" : "no telecommand came with the others";
  report_keys(change.vc, change.set, stored ? why : why + ", not stored");
}

void TtcCore::follow_confirmed_keys() {
  const auto confirmed = uplink_.take_confirmed();
  key_management_.on_confirmed(confirmed);
  for (const auto& [spi, key] : confirmed) report_rekeyed(spi, key, "alone now, a frame under it came");
}

void TtcCore::store_session_keys() {
  if (auto change = key_management_.take_change()) act(WriteSessionKeys{std::move(*change)});
}

void TtcCore::on_session_keys_written(const SessionKeyChange& change, bool stored, MonotonicTime now) {
  now_ = now;
  key_management_.on_stored(change, stored);
  const auto use = change.rekeyed && stored ? change.keys.use_of(*change.rekeyed) : std::nullopt;
  if (use && use->next) report_rekeyed(use->spi, *use->next, "beside its present key until then");
  if (!stored && !change.origin)
    log(LogLine::Level::error, "the key in use is not stored: after a restart the one before it works too");
}

void TtcCore::store_transmitter_change() {
  auto change = transmitter_service_.take_change();
  if (!change) return;
  if (change->off > seconds(0)) {
    log(LogLine::Level::warn,
        fmt::format("the transmitter goes off for {} s: commanded", change->off.count()));
    mission::TtcTransmitterOffEvent event;
    event.duration_s = static_cast<std::uint32_t>(change->off.count());
    event.why = "commanded";
    raise(event);
  } else {
    mission::TtcTransmitterOnEvent event;
    event.why = "commanded";
    raise(event);
  }
  write_state("transmitter", std::move(*change));
}

void TtcCore::store_rescue_entry() {
  if (const auto entry = rescue_service_.take_change()) act(WriteRescueEntry{*entry});
}

/// Without its record the restart would lead into the suite again.
void TtcCore::on_rescue_entry_written(const RescueEntry& entry, bool stored) {
  rescue_service_.on_stored(entry, stored);
  if (!stored) return log(LogLine::Level::error, "srfs_rescue is not entered: its order is not on the disk");
  log(LogLine::Level::warn, "commanded: the next start is srfs_rescue, the computer restarts now");
  act(RestartComputer{});
}

void TtcCore::end_silence() {
  if (!transmitter_.take_end(now_)) return;
  act(WriteState{"transmitter", "", SilenceOver{}});
  mission::TtcTransmitterOnEvent event;
  event.why = "its time is over";
  raise(event);
}

void TtcCore::store_stores_change() {
  if (auto change = stores_.take_change()) write_state("stores", std::move(*change));
}

void TtcCore::store_open_progress() {
  if (stores_.take_progress()) act(WriteState{"stores", stores_.stored_text(), {}});
}

}  // namespace srfs
