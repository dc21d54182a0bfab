// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/ttc_node.hpp"

#include "base/saturate.hpp"

#include <algorithm>
#include <array>

#include <mission/structures.hpp>

namespace srfs {
namespace {

constexpr std::size_t max_items_to_store =
    4096;                          ///< between two commits; beyond, packets are not stored (counted)
constexpr int reads_per_wake = 8;  ///< so that a flood on the line cannot starve the tick
constexpr std::size_t read_octets = 512;
constexpr std::size_t frames_per_read = read_octets / 26 + 2;  ///< the shortest CLTU has 26 octets
constexpr std::uint8_t verification_service = 1;
/// Control commands need no key: what they change is written no more often than this.
constexpr seconds flags_period{1};
constexpr seconds connection_patience{2};          ///< of a test whether a node is there
constexpr milliseconds schedule_retry_period{50};  ///< what is due and not released waits for room
constexpr const char* journal_name = "journal of telecommands";

std::optional<Stage> to_stage(std::uint8_t stage) {
  switch (stage) {
    case srfs_msgs::msg::TelecommandReport::ACCEPTED:
      return Stage::acceptance;
    case srfs_msgs::msg::TelecommandReport::STARTED:
      return Stage::start;
    case srfs_msgs::msg::TelecommandReport::PROGRESS:
      return Stage::progress;
    case srfs_msgs::msg::TelecommandReport::COMPLETED:
      return Stage::completion;
    default:
      return std::nullopt;
  }
}

}  // namespace

// ---- uplink

bool TtcNode::read_line() {
  std::array<std::uint8_t, read_octets> octets{};
  bool empty = false;
  const std::uint64_t frames_before = link_->uplink.cltu_counters().cltus_decoded;
  for (int i = 0; i < reads_per_wake; ++i) {
    const auto count = line_->read(octets);
    empty = !count || *count == 0;
    if (empty) break;
    take_uplinked(link_->uplink.push(OctetView(octets.data(), *count), monotonic_now()));
    link_->uplink.set_buffer_available(link_->gate.has_room(frames_per_read));
  }
  if (link_->uplink.cltu_counters().cltus_decoded != frames_before) link_->downlink.want_control_word(now());
  return empty;
}

void TtcNode::take_uplinked(std::vector<UplinkedPacket> packets) {
  const MonotonicTime received = monotonic_now();
  for (UplinkedPacket& packet : packets) {
    link_->files.on_contact();
    if (cfdp::is_pdu_packet(packet.packet)) {
      link_->files.on_packet(packet.packet);  // repeated or lost, it does no harm: nothing waits for the disk
    } else {
      take_packet(std::move(packet), received);
    }
  }
  for (const UplinkedPacket& refused : link_->uplink.take_refused()) {
    const AcceptedTelecommand* known = link_->journal.find_repeated_frame(refused);
    if (known != nullptr) link_->journal.answer_repeat(*known, received, link_->report_queue);
  }
}

void TtcNode::take_packet(UplinkedPacket packet, MonotonicTime received) {
  AcceptanceJournal& journal = link_->journal;
  if (const AcceptedTelecommand* known = journal.find_repeated_packet(packet, received)) {
    journal.on_link(packet.link);
    journal.answer_repeat(*known, received, link_->report_queue);
    return;
  }
  const bool may_wait = link_->gate.has_room();
  JudgedTelecommand judged = link_->router.judge(packet.packet, received, may_wait && journal.has_room());
  if (judged.command != nullptr) {
    judged.origin.id =
        journal.accept(packet, judged.origin, judged.command->node, judged.expiry, packet.link, received);
  } else {
    record_refusal(judged, packet.link);
  }
  if (may_wait) {
    link_->gate.enter(std::move(judged), journal.revision(), received);
    return;
  }
  // Refused: its record is on its way to the disk, and is not waited for.
  link_->gate.refuse();
  link_->router.carry_out(judged, true, received);
  journal.on_refusal_said(judged.refusal_serial);
}

void TtcNode::record_refusal(JudgedTelecommand& judged, const LinkState& link) {
  judged.refusal_serial = link_->journal.refuse(judged.origin,
                                                {.stage = judged.refusal.stage,
                                                 .success = false,
                                                 .failure_code = judged.refusal.code,
                                                 .step = 0,
                                                 .data = judged.refusal.parameter},
                                                link);
}

void TtcNode::persist_journal(bool sync_all) {
  AcceptanceJournal& journal = link_->journal;
  const UplinkChain& uplink = link_->uplink;
  if (uplink.has_data_after(journal.link().generation)) {
    journal.on_link(uplink.state());
  } else if (uplink.state().generation != journal.link().generation &&
             (sync_all || monotonic_now() - flags_written_ >= flags_period)) {
    flags_written_ = monotonic_now();
    journal.on_link(uplink.state());
  }
  const bool awaited = link_->gate.wants_write(journal.revision());
  const bool lazy = journal.wants_write() || (sync_all && journal.wants_sync());
  if (!awaited && !(lazy && link_->gate.may_write())) return;
  auto batch = std::make_shared<JournalBatch>(journal.take_batch(awaited || sync_all));
  struct Outcome {
    Result<void, FileError> written;
    std::size_t used_octets = 0;
  };
  link_->gate.on_write_begun(batch->revision);
  const bool taken = journal_worker_->ask(
      [disk = journal_file_, batch] {
        Outcome outcome;
        outcome.written = batch->snapshot ? disk->log.snapshot(*batch->snapshot)
                                          : disk->log.append(batch->records, batch->sync);
        outcome.used_octets = disk->log.used_octets();
        return outcome;
      },
      [this, batch](const Outcome& outcome) {
        on_journal_written(*batch, outcome.written, outcome.used_octets);
      });
  if (!taken) on_journal_written(*batch, Err(FileError{"the journal's worker is busy"}), 0);
}

void TtcNode::on_journal_written(const JournalBatch& batch, const Result<void, FileError>& written,
                                 std::size_t used_octets) {
  link_->journal.on_written(batch, written.has_value(), used_octets);
  // Without storage frames are taken all the same.
  if (link_->uplink.on_stored(written ? batch.link : link_->uplink.state()))
    link_->downlink.want_control_word(now());
  if (written && raised_generation_ && batch.link.generation >= *raised_generation_) forget_wanted_floor();
  link_->gate.on_write_done(written.has_value(), monotonic_now());
  link_->schedule.on_written(batch.revision, written.has_value());
  note_storage(journal_durable_, written.has_value(), written ? "" : written.error().message, journal_name);
  if (is_active()) settle();
}

void TtcNode::execute_passed() {
  for (const GatedTelecommand& gated : link_->gate.take_passed()) {
    if (!gated.durable) {
      note_storage(journal_durable_, false, "the journal of telecommands is not on disk", journal_name);
      link_->uplink.on_stored(link_->uplink.state());
    }
    link_->router.carry_out(gated.judged, gated.durable, now());
    if (gated.judged.refusal_serial != 0) link_->journal.on_refusal_said(gated.judged.refusal_serial);
    send_reports(link_->report_queue.take(), gated.received);
  }
  for (const std::uint64_t id : link_->router.take_unstored_runs()) {
    mission::TtcRecoveryWithoutStorageEvent event;
    event.telecommand = id;
    raise(event);
  }
}

void TtcNode::send_released() {
  for (const HeldReport& held : link_->gate.take_released()) {
    send(held.report, held.live, held.stored, held.urgent);
    if (held.report.ends != 0) link_->journal.on_end_said(held.report.ends);
  }
}

void TtcNode::record_progress() {
  for (const std::uint64_t id : link_->forwarder.take_taken()) link_->journal.on_taken(id);
  for (const StageReached& stage : link_->report_queue.take_stages()) link_->journal.on_stage(stage);
}

void TtcNode::copy_link_state() {
  LinkState state = link_->uplink.stored_state();
  if (state.generation == copied_generation_) return;
  state.next_telecommand_id = link_->journal.next_id() + reserved_telecommand_ids;
  state_worker_->post([file = link_file_, state] {
    if (const auto written = file->store(state); !written) log::warn("{}", written.error().message);
  });
  copied_generation_ = state.generation;
}

void TtcNode::report_findings() {
  for (const SecurityFinding& finding : link_->uplink.take_findings()) {
    if (finding.kind == SecurityFinding::Kind::counter_out_of_range) {
      mission::TtcFrameCounterOutOfRangeEvent event;
      event.vc = finding.vc;
      event.count = link_->uplink.counters().counter_out_of_range;
      raise(event);
    } else if (finding.kind == SecurityFinding::Kind::replayed) {
      mission::TtcFrameReplayedEvent event;
      event.vc = finding.vc;
      event.counter = finding.counter;
      raise(event);
    } else {
      mission::TtcFrameNotAuthenticEvent event;
      event.vc = finding.vc;
      event.count = ++not_authentic_[finding.vc];
      raise(event);
    }
  }
}

void TtcNode::test_connection() {
  const auto node = link_->connections.take_question();
  if (!node) return;
  // The answer comes from the node's work thread: a node that answers is alive.
  auto& client = connection_clients_[*node];
  if (!client) client = create_client<lifecycle_msgs::srv::GetState>("/" + *node + "/get_state");
  client->call({}, connection_patience, 1, [this](const auto& response) {
    link_->connections.on_answer(response.has_value());
    if (is_active()) settle();
  });
}

// ---- outputs

void TtcNode::settle() {
  run_schedule();
  persist_journal();
  execute_passed();
  send_released();
  serve_files();
  ask_nodes();
  test_connection();
  begin_imaging_tasks();
  publish_telecommands();
  send_reports(link_->report_queue.take(), std::nullopt);
  store_mode_change();
  store_key_change();
  store_transmitter_change();
  store_stores_change();
  report_rejections();
  report_hazards();
  report_findings();
  record_progress();
  persist_journal();
  send_released();
  carry_out_imaging_orders();
  link_->uplink.set_buffer_available(link_->gate.has_room(frames_per_read));
  pump_downlink();
}

void TtcNode::publish_telecommands() {
  for (const ForwardedCommand& command : link_->forwarder.take_publications()) {
    srfs_msgs::msg::Telecommand message;
    message.id = command.id;
    message.target = command.target;
    message.apid = command.apid;
    message.function_id = command.function_id;
    message.repeat_class = command.repeat_class;
    message.expiry_ns = static_cast<std::uint64_t>(command.expiry.ns());
    message.arguments = command.arguments;
    telecommands_->publish(message);
  }
}

void TtcNode::send_reports(const std::vector<Report>& reports, std::optional<MonotonicTime> received) {
  for (const Report& report : reports) {
    // Verification reports are stored; answers to requests (17,2, a one-shot) are not.
    const bool verification = report.service == verification_service;
    if (report.ends != 0) record_progress();  // its record is what it waits for
    if (report.ends != 0 && journal_durable_) {
      link_->gate.hold({.report = report}, link_->journal.revision(), now());
      continue;
    }
    send(report, true, verification && !report.again, true);
    if (report.ends != 0) link_->journal.on_end_said(report.ends);
    const bool acceptance = verification && report.subtype <= 2;
    if (received && acceptance) link_->acceptance_latency.add(monotonic_now() - *received);
  }
}

void TtcNode::send(const Report& report, bool live, bool stored, bool urgent) {
  const MonotonicTime at = now();
  const TaiTime tai = link_->clock.tai_at(at);
  Octets packet = link_->packets.make(report, tai, link_->clock.reference_at(at));
  const std::uint16_t store = stored ? store_of_service(dictionary_, report.service) : std::uint16_t{0};
  if (store != 0 && link_->stores.take_packet(store)) {
    if (to_store_.size() < max_items_to_store) {
      to_store_.push_back(StoreItem{.store = store,
                                    .stamp = {.tai = tai,
                                              .time_valid = link_->clock.valid(),
                                              .boot_id = static_cast<std::uint16_t>(boot_.count),
                                              .monotonic = at},
                                    .packet = packet});
    } else {
      ++unstored_packets_;
    }
  }
  if (live) link_->downlink.push(DownlinkChannel::live, std::move(packet), urgent, at);
}

void TtcNode::store_mode_change() {
  const auto change = link_->mode_service.take_change();
  if (!change) return;
  publish_mode();
  mission::TtcModeChangedEvent event;
  event.mode = change->mode;
  event.reason = link_->mode.reason();
  raise(event);
  write_state("mode", change->stored_text,
              [this, change = *change](bool stored) { link_->mode_service.on_stored(change, stored); });
}

void TtcNode::write_state(const char* name, std::string text, std::function<void(bool)> tell) {
  const bool taken = state_worker_->ask(
      [path = state_dir() / name, text = std::move(text)] {
        const auto written = write_file_atomically(path, text);
        if (!written) log::warn("{}", written.error().message);
        return written.has_value();
      },
      [this, tell](bool stored) {
        tell(stored);
        if (is_active()) settle();
      });
  if (!taken) tell(false);
}

void TtcNode::store_transmitter_change() {
  const auto change = link_->transmitter_service.take_change();
  if (!change) return;
  if (change->off > seconds(0)) {
    log::warn("the transmitter goes off for {} s: commanded", change->off.count());
    mission::TtcTransmitterOffEvent event;
    event.duration_s = static_cast<std::uint32_t>(change->off.count());
    event.why = "commanded";
    raise(event);
  } else {
    mission::TtcTransmitterOnEvent event;
    event.why = "commanded";
    raise(event);
  }
  write_state("transmitter", change->stored_text, [this, change = *change](bool stored) {
    link_->transmitter_service.on_stored(change, stored);
  });
}

void TtcNode::end_silence() {
  if (!link_->transmitter.take_end(monotonic_now())) return;
  // Its record would make the next boot silent.
  const bool taken = state_worker_->post([path = state_dir() / "transmitter"] {
    if (const auto written = write_file_atomically(path, ""); !written)
      log::error("the silence that is over is still on disk: {}", written.error().message);
  });
  if (!taken) log::error("the silence that is over is still on disk");
  mission::TtcTransmitterOnEvent event;
  event.why = "its time is over";
  raise(event);
}

void TtcNode::publish_mode() {
  srfs_msgs::msg::SystemMode message;
  message.mode = static_cast<std::uint8_t>(link_->mode.mode());
  message.reason = link_->mode.reason();
  message.monotonic_ns = static_cast<std::uint64_t>(now().ns());
  mode_publisher_->publish(message);
}

void TtcNode::report_rejections() {
  for (const RejectedTelecommand& rejected : link_->router.take_rejected()) {
    mission::TtcTelecommandRejectedEvent event;
    event.apid = rejected.apid;
    event.sequence = rejected.sequence_count;
    event.code = rejected.code;
    raise(event);
  }
  for (const ExpiredCommand& expired : link_->forwarder.take_expired()) {
    mission::TtcTelecommandExpiredEvent event;
    event.telecommand = expired.id;
    event.node = expired.target;
    raise(event);
  }
}

bool TtcNode::write_outgoing() {
  while (!outgoing_.empty()) {
    const auto written = line_->write(outgoing_);
    if (!written) {  // no line: what is sent now is lost, as on the air
      ++lost_frames_;
      outgoing_.clear();
      return true;
    }
    if (*written == 0) return false;
    outgoing_.erase(outgoing_.begin(), outgoing_.begin() + static_cast<std::ptrdiff_t>(*written));
  }
  return true;
}

void TtcNode::pump_downlink() {
  if (!is_active() && state() != ros::State::activating) return;
  feed_playback();
  pump_files();
  end_silence();
  while (write_outgoing() && link_->transmitter.may_transmit(monotonic_now())) {
    auto cadu = link_->downlink.next(monotonic_now(), [this] { return link_->uplink.next_clcw(); });
    if (!cadu) break;
    outgoing_ = std::move(*cadu);
    if (frame_counts_) frame_counts_->write(link_->downlink.frame_counts());
    send_time_report();
  }
  // The last playback frame may just have left.
  if (link_->retrieval.busy() && link_->downlink.empty(DownlinkChannel::playback)) feed_playback();
  arm_timer();
}

/// One timer serves every deadline of the logic: the soonest.
void TtcNode::arm_timer() {
  std::optional<MonotonicTime> due;
  const auto sooner = [&](std::optional<MonotonicTime> t) {
    if (t && (!due || *t < *due)) due = t;
  };
  const MonotonicTime at = monotonic_now();
  if (link_->transmitter.may_transmit(at)) sooner(link_->downlink.next_due(at));
  sooner(link_->transmitter.next_due(at));
  sooner(link_->forwarder.next_due());
  sooner(link_->gate.next_due());
  sooner(link_->hazards.next_due());
  sooner(link_->uplink.idle_deadline());
  if (const auto in = link_->schedule.next_due_in())
    sooner(at + (*in > nanoseconds(0) ? *in : schedule_retry_period));
  sooner(link_->file_service.next_due());
  sooner(link_->imaging.next_due(imaging_time()));
  sooner(link_->files.next_due(link_->downlink.room_octets(DownlinkChannel::files)));
  if (!outgoing_.empty()) due = at + milliseconds(2);  // the driver is full: look again soon
  if (due == wake_up_at_) return;
  wake_up_at_ = due;
  wake_up_.reset();
  if (!due) return;
  wake_up_ = create_one_shot(
      *due,
      [this] {
        wake_up_at_.reset();
        // A silence of the line counts, not one of this thread: what waits in the driver is read first.
        const bool line_empty = read_line();
        const MonotonicTime t = monotonic_now();
        link_->forwarder.on_time(t);
        link_->gate.on_time(t);
        link_->file_service.on_time(t);
        link_->hazards.on_time(t);
        if (line_empty) take_uplinked(link_->uplink.on_idle(t));
        settle();
      },
      "deadlines");
}

// ---- inputs from other nodes

void TtcNode::on_tick(const srfs_msgs::msg::TimeTick& tick) {
  const ReceivedTick received{.utc_s = static_cast<std::uint32_t>(tick.utc.sec),
                              .utc_ns = tick.utc.nanosec,
                              .monotonic_ns = tick.monotonic_ns,
                              .period_us = tick.period_us,
                              .time_valid = tick.time_valid,
                              .sync_state = tick.sync_state};
  if (!link_->clock.on_tick(received, monotonic_now())) {
    ++foreign_samples_;
    return;
  }
  cycle_ = tick.cycle;
  if (floor_wanted_ != FloorWanted::no && tick.time_valid) {
    raise_counters();
    if (is_active()) send_beacon();  // a ground station with lower counters sees at once where they go on
  }
  // The time may have become valid, or have made a step.
  const bool waited_for = !link_->schedule.schedule().empty() || link_->imaging.tasks() > 0;
  if (is_active() && waited_for) settle();
}

void TtcNode::publish_telemetry(const srfs_msgs::msg::PayloadTelemetry& sample) {
  on_telemetry(sample);  // only ttc itself uses it
}

void TtcNode::on_telemetry(const srfs_msgs::msg::PayloadTelemetry& message) {
  if (!is_active()) return;
  const mission::ApplicationProcess* source = dictionary_.apid_of_node(message.source);
  if (source == nullptr || source->apid != message.apid) {
    ++foreign_samples_;
    return;
  }
  const auto report = link_->housekeeping.on_sample(message.apid, message.structure_id, message.data, now());
  if (!report) return;
  link_->beacon.on_telemetry(message.source, message.structure_id, message.data, now());
  boot_ = link_->beacon.boot().value_or(boot_);
  send(report->report, report->live, true, false);
  pump_downlink();
}

void TtcNode::on_event_message(const srfs_msgs::msg::Event& message) {
  if (!is_active()) return;
  const mission::ApplicationProcess* source = dictionary_.apid_of_node(message.source);
  const auto report = link_->events.on_event(source != nullptr ? source->apid : std::uint16_t{1},
                                             message.event_id, message.severity, message.data, now());
  if (!report) return;
  send(report->report, report->live, true, false);
  pump_downlink();
}

void TtcNode::on_telecommand_report(const srfs_msgs::msg::TelecommandReport& message) {
  const auto stage = to_stage(message.stage);
  if (!is_active() || !stage) return;
  NodeReport report;
  report.id = message.id;
  report.node = message.node;
  report.stage = *stage;
  report.success = message.success;
  report.failure_code = message.failure_code;
  report.step = message.progress_step;
  report.data = message.data;
  link_->forwarder.on_report(report, now());
  settle();
}

// ---- periodic work

void TtcNode::note_storage(bool& known, bool works, const std::string& why, const std::string& what) {
  if (!works && known) {
    log::error("storage unavailable: {}", why);
    mission::TtcStorageUnavailableEvent event;
    event.what = why;
    raise(event);
  } else if (works && !known) {
    log::info("storage is available again: {}", what);
    mission::TtcStorageAvailableEvent event;
    event.what = what;
    raise(event);
  }
  known = works;
}

void TtcNode::send_event(mission::EventSeverity severity, std::uint16_t event_id, const Octets& data) {
  const auto report = link_->events.on_event(dictionary_.apid_of_node(name())->apid, event_id,
                                             static_cast<std::uint8_t>(severity), data, now());
  if (report) send(report->report, report->live, true, false);
}

void TtcNode::send_behind_ends(mission::EventSeverity severity, std::uint16_t event_id, const Octets& data) {
  auto report = link_->events.on_event(dictionary_.apid_of_node(name())->apid, event_id,
                                       static_cast<std::uint8_t>(severity), data, now());
  if (!report) return;
  link_->gate.hold(
      {.report = std::move(report->report), .live = report->live, .stored = true, .urgent = false},
      link_->journal.revision(), now());
}

void TtcNode::add_latency(mission::TtcHousekeeping& h) const {
  const LatencyHistogram& latency = link_->acceptance_latency;
  const auto us = [](nanoseconds d) { return as_u32(static_cast<std::uint64_t>(d.count() / 1000)); };
  h.transmitter_off_s =
      as_u32(static_cast<std::uint64_t>(link_->transmitter.rest(monotonic_now()) / seconds(1)));
  h.acceptance_latency_p50_us = us(latency.quantile(0.5));
  h.acceptance_latency_p99_us = us(latency.quantile(0.99));
  h.acceptance_latency_max_us = us(latency.max());
  // The classes of the dictionary (labels of acceptance_latency), each without its lower bound.
  static constexpr std::array bounds{microseconds(500),   microseconds(1000),  microseconds(2000),
                                     microseconds(5000),  microseconds(10000), microseconds(20000),
                                     microseconds(50000), microseconds(100000)};
  static_assert(std::tuple_size_v<decltype(h.acceptance_latency)> == bounds.size() + 1);
  std::uint64_t below = 0;
  for (std::size_t i = 0; i < bounds.size(); ++i) {
    const std::uint64_t up_to = latency.count_up_to(bounds[i]);
    h.acceptance_latency[i] = as_u32(up_to - below);
    below = up_to;
  }
  h.acceptance_latency.back() = as_u32(latency.count() - below);
}

void TtcNode::add_link_counters(mission::TtcHousekeeping& h) const {
  const UplinkCounters& up = link_->uplink.counters();
  const wire::CltuDecoder::Counters& cltu = link_->uplink.cltu_counters();
  const VerificationCounters& verification = link_->report_queue.counters();
  const DownlinkCounters down = link_->downlink.counters();
  const ForwardingCounters& forwarded = link_->forwarder.counters();
  const GateCounters& gate = link_->gate.counters();
  h.octets_received = up.octets;
  h.noise_octets = cltu.noise_octets;
  h.control_commands = up.control_commands;
  h.packets_up = up.packets;
  h.gate_passed = as_u32(gate.passed);
  h.gate_undurable = as_u32(gate.passed_undurable);
  h.gate_refused = as_u32(gate.refused);
  h.tc_forwarded = as_u32(forwarded.submitted);
  h.tc_queue_full = as_u32(forwarded.refused);
  h.tc_published = as_u32(forwarded.published);
  h.tc_forwarded_completed = as_u32(forwarded.completed);
  h.tc_forwarded_failed = as_u32(forwarded.failed);
  h.tc_expired = as_u32(forwarded.expired);
  h.reports_repeated = as_u32(forwarded.duplicate_reports);
  const AcceptanceJournalCounters& journal = link_->journal.counters();
  h.tc_open = as_u32(link_->journal.open());
  h.tc_restored = as_u32(journal.restored);
  h.tc_repeats = as_u32(journal.repeats);
  h.tc_repeats_unanswered = as_u32(journal.unanswered);
  h.journal_octets = journal.written_octets;
  h.journal_syncs = as_u32(journal.syncs);
  h.journal_write_failures = as_u32(journal.failed_writes);
  h.journal_damaged_octets = as_u32(journal_damaged_octets_);
  h.start_sequences = as_u32(cltu.start_sequences);
  h.cltus = as_u32(cltu.cltus_decoded);
  h.bch_corrected = as_u32(cltu.corrected_bits);
  h.bch_rejects = as_u32(cltu.blocks_rejected);
  h.crc_rejects = as_u32(cltu.bad_fecf);
  h.wrong_scid = up.wrong_scid;
  h.wrong_length = as_u32(cltu.bad_length + cltu.cut_short + up.wrong_header);
  h.wrong_vc = up.wrong_vc;
  h.sdls_mac_failures = up.not_authentic;
  h.sdls_replays = up.replayed;
  h.sdls_counters_out_of_range = up.counter_out_of_range;
  h.sdls_contingency_spi = link_->uplink.associations().contingency;
  h.sdls_contingency_counter = link_->uplink.counter(h.sdls_contingency_spi).value_or(0);
  h.sdls_keys_unusable = static_cast<std::uint8_t>(unusable_keys_.size());
  h.farm_rejects = up.farm_discarded + up.bad_control_command;
  h.packets_bad = up.bad_segment;
  h.tc_accepted = verification.accepted;
  h.tc_rejected = verification.rejected;
  h.tc_started = verification.started;
  h.tc_completed = verification.completed;
  h.tc_failed = verification.failed;
  h.tm_frames = down.frames;
  h.tm_idle_frames = down.idle_frames;
  for (std::size_t i = 0; i < down.packets.size(); ++i) {
    h.tm_packets[i] = as_u32(down.packets[i]);
    h.tm_dropped[i] = as_u32(down.dropped[i]);
  }
  h.tm_lost = as_u32(lost_frames_);
}

void TtcNode::add_store_counters(mission::TtcHousekeeping& h) const {
  PacketStoreCounters sum;
  for (std::size_t i = 0; i < store_status_.stores.size(); ++i) {
    const PacketStoreCounters& counters = store_status_.stores[i].second.counters;
    if (i < h.store_records.size()) h.store_records[i] = as_u32(counters.stored);
    sum.refused += counters.refused;
    sum.overwritten += counters.overwritten;
    sum.write_failures += counters.write_failures;
    sum.damaged += counters.damaged;
    sum.unreadable += counters.unreadable;
    sum.cut_octets += counters.cut_octets;
    sum.written_octets += counters.written_octets;
  }
  h.store_failures = as_u32(sum.refused + unstored_packets_);
  h.store_dropped = as_u32(sum.overwritten);
  h.store_write_failures = as_u32(sum.write_failures);
  h.store_damaged = as_u32(sum.damaged);
  h.store_unreadable = as_u32(sum.unreadable);
  h.store_cut_octets = as_u32(sum.cut_octets);
  h.store_written_octets = sum.written_octets;
  h.retrievals_incomplete = as_u32(link_->retrieval.incomplete());
}

void TtcNode::send_own_housekeeping() {
  mission::TtcHousekeeping h;
  h.cycle = cycle_;
  add_link_counters(h);
  add_store_counters(h);
  h.housekeeping_samples = as_u32(link_->housekeeping.counters().samples);
  h.housekeeping_live = as_u32(link_->housekeeping.counters().live);
  h.events_reported = as_u32(link_->events.counters().reported);
  h.events_disabled = as_u32(link_->events.counters().disabled);
  h.events_suppressed = as_u32(link_->events.counters().suppressed + suppressed_events());
  h.publish_drops = as_u32(telecommands_->refused());
  h.dds_malformed = as_u32(malformed_samples());
  h.dds_foreign = as_u32(link_->housekeeping.counters().unknown + link_->events.counters().unknown +
                         link_->forwarder.counters().stray_reports + foreign_samples_);
  add_latency(h);
  if (const auto report = link_->housekeeping.on_sample(h.apid, h.structure_id, h.encoded(), now())) {
    send(report->report, report->live, true, false);
  }
  settle();
}

void TtcNode::send_files_housekeeping() {
  mission::TtcFilesHousekeeping h = files_status_;
  const FileExchangeCounters& link = link_->files.counters();
  h.pdus_received = as_u32(link.received);
  h.pdus_sent = as_u32(link.sent);
  h.pdus_dropped = as_u32(link.dropped);
  if (const auto report = link_->housekeeping.on_sample(h.apid, h.structure_id, h.encoded(), now())) {
    send(report->report, report->live, true, false);
  }
  settle();
}

void TtcNode::send_beacon() {
  BeaconInputs in;
  in.cycle = cycle_;
  in.boot = boot_;
  in.mode = link_->mode.mode();
  in.mode_reason = link_->mode.reason();
  in.time_valid = link_->clock.valid();
  in.storage_free_mib = store_status_.free_mib;
  for (const auto& [id, store] : store_status_.stores) in.store_records += as_u32(store.records);
  in.last_telecommand = link_->report_queue.last();
  const UplinkChain::Associations used = link_->uplink.associations();
  in.sdls_spi = {used.bd, used.ad};
  for (std::size_t i = 0; i < in.sdls_spi.size(); ++i)
    in.sdls_counter[i] = link_->uplink.counter(in.sdls_spi[i]).value_or(0);
  in.storage_state = static_cast<mission::StorageState>((journal_durable_ ? 0 : 1) + (stores_work_ ? 0 : 2));
  const wire::FarmState& farm =
      link_->uplink.farm(static_cast<std::uint8_t>(deployment().link.channels.front().virtual_channel));
  in.farm_vr = farm.vr;
  in.farm_lockout = farm.lockout;
  fill_next_scheduled(in);
  using mission::Beacon;
  const auto report = link_->housekeeping.on_sample(Beacon::apid, Beacon::structure_id,
                                                    link_->beacon.build(in, now()), now());
  // Unasked and in every mode: it cannot be switched off.
  if (report) send(report->report, true, true, false);
  send_added_nodes();
  settle();
}

void TtcNode::look_at_nodes() {
  for (const std::string& node : std::exchange(answered_, {})) state_clients_.erase(node);
  using Facts = std::vector<std::pair<std::string, NodeFacts>>;
  std::vector<std::string> names = link_->beacon.nodes();
  for (const JoinedNode& joined : joined_nodes_) names.push_back(joined.name);
  state_worker_->ask(
      [paths = var(), names = std::move(names)] {
        Facts facts;
        for (const std::string& node : names) {
          NodeFacts known;
          if (const auto instance = ros::find_instance(paths, node)) {
            known.running = true;
            known.version = instance->version;
          }
          known.restarts = ros::read_start_record(paths, node).restarts;
          facts.emplace_back(node, known);
        }
        return facts;
      },
      [this](const Facts& facts) {
        for (const auto& [node, known] : facts) {
          link_->beacon.on_facts(node,
                                 node == name() ? NodeFacts{true, known.restarts, ros::version()} : known);
          for (JoinedNode& joined : joined_nodes_) {
            if (joined.name != node) continue;
            joined.facts = known;
            if (!known.running) joined.state.reset();  // the next process starts anew
          }
        }
        link_->beacon.on_lifecycle(name(), static_cast<std::uint8_t>(state()));
        for (const std::string& node : link_->beacon.nodes_to_ask()) ask_for_state(node);
        for (const JoinedNode& joined : joined_nodes_) {
          if (joined.facts.running && !joined.state) ask_for_state(joined.name);
        }
      });
}

/// A node that came up before ttc has published its transitions already.
void TtcNode::ask_for_state(const std::string& node) {
  if (!is_active() || state_clients_.contains(node)) return;
  auto client = create_client<lifecycle_msgs::srv::GetState>("/" + node + "/get_state");
  state_clients_[node] = client;
  client->call({}, seconds(2), 1, [this, node](const auto& response) {
    if (response) link_->beacon.on_lifecycle(node, response->current_state.id);
    for (JoinedNode& joined : joined_nodes_) {
      if (response && joined.name == node) joined.state = response->current_state.id;
    }
    answered_.push_back(node);  // a client cannot be dropped within its own callback
  });
}

}  // namespace srfs
