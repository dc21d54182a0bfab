// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Telemetry: reports to the stores and to the line, playback, files, events, housekeeping, beacon.
#include <algorithm>
#include <array>
#include <numeric>

#include "base/excerpt.hpp"
#include "base/saturate.hpp"
#include "nodes/ttc/ttc_core.hpp"

namespace srfs {
namespace {

/// Between two commits; beyond, packets are not stored (counted).
constexpr std::size_t max_items_to_store = 4096;
constexpr int patience_commits = 10;  ///< a commit that misses so many of its seconds is a failing disk
constexpr const char* stores_name = "packet stores";
constexpr std::uint8_t function_service = 8;
constexpr std::size_t most_health_text = 80;

}  // namespace

// ---- to the stores and to the line

void TtcCore::send(const Report& report) {
  const TaiTime tai = clock_.tai_at(now_);
  Octets packet = packets_.make(report, tai, clock_.reference_at(now_));
  const std::uint16_t store =
      report.stored ? store_of_service(dictionary_, report.service) : std::uint16_t{0};
  if (store != 0 && stores_.take_packet(store)) {
    if (to_store_.size() < max_items_to_store) {
      to_store_.push_back(StoreItem{.store = store,
                                    .stamp = {.tai = tai,
                                              .time_valid = clock_.valid(),
                                              .boot_id = static_cast<std::uint16_t>(boot_.count),
                                              .monotonic = now_},
                                    .packet = packet});
    } else {
      ++remembered_.unstored_packets;
    }
  }
  if (report.live) downlink_.push(DownlinkChannel::live, std::move(packet), report.urgent, now_);
}

void TtcCore::send_sample(std::uint16_t apid, std::uint16_t structure_id, OctetView data, MonotonicTime now) {
  now_ = now;
  const auto report = housekeeping_.on_sample(apid, structure_id, data, now);
  if (!report) return;
  send(*report);
  monitor(structure_id, data);
}

std::optional<Report> TtcCore::own_event(mission::EventSeverity severity, std::uint16_t event_id,
                                         OctetView data) {
  const std::uint16_t apid = dictionary_.apid_of_node(node_)->apid;
  event_actions_.on_event(apid, event_id, now_);
  return events_.on_event(apid, event_id, static_cast<std::uint8_t>(severity), data, now_);
}

std::optional<Octets> TtcCore::next_cadu(MonotonicTime now) {
  now_ = now;
  if (!transmitter_.may_transmit(now)) return std::nullopt;
  auto cadu = downlink_.next(
      now, [this] { return uplink_.next_clcw(); }, valid_utc());
  if (cadu) send_time_report();
  return cadu;
}

void TtcCore::send_time_report() {
  if (auto packet = time_reports_.on_frames(downlink_.live_frames(), clock_.tai_at(now_)))
    downlink_.push(DownlinkChannel::live, std::move(*packet), false, now_);
}

void TtcCore::fill_downlink(MonotonicTime now) {
  now_ = now;
  feed_playback();
  fill_files();
  end_silence();
}

// ---- packet stores

void TtcCore::commit_stores(bool line_empty, MonotonicTime now) {
  now_ = now;
  if (commit_running_) {  // a slow disk: what comes meanwhile waits, bounded
    if (++commits_missed_ == patience_commits)
      note_storage(remembered_.stores_work, false, "the packet stores do not answer", stores_name);
    return;
  }
  commits_missed_ = 0;
  persist_journal(true);
  // What has left and is in this commit, the ground has or can ask for.
  const bool all_left = downlink_.empty(DownlinkChannel::live) && line_empty;
  commit_running_ = true;
  act(CommitStores{.items = std::exchange(to_store_, {}),
                   .bounded = stores_.bounded(),
                   .counts = frame_count_reserve_.wanted(downlink_.frame_counts()),
                   .numbers = downlink_.sealed() ? downlink_.numbers().wanted(valid_utc()) : std::nullopt,
                   .told = all_left ? journal_.said() : 0});
}

void TtcCore::on_committed(const CommitStores& commit, const PacketStoresStatus& status,
                           const Result<void, FileError>& counts) {
  commit_running_ = false;
  if (commit.counts || commit.numbers) {
    if (counts && commit.counts) frame_count_reserve_.on_stored(*commit.counts);
    if (counts && commit.numbers) downlink_.numbers().on_reserved(*commit.numbers);
    if (!counts && frame_counts_stored_)
      log(LogLine::Level::warn,
          counts.error().message + ": a reset of the computer may use counters of TM frames twice");
    frame_counts_stored_ = counts.has_value();
  }
  if (status.failure.empty()) journal_.on_told(commit.told);
  on_store_status(status);
}

void TtcCore::on_commit_refused(CommitStores commit) {
  commit_running_ = false;
  take_back(std::move(commit.items));
}

void TtcCore::take_back(std::vector<StoreItem> items) {
  items.insert(items.end(), std::make_move_iterator(to_store_.begin()),
               std::make_move_iterator(to_store_.end()));
  to_store_ = std::move(items);
}

void TtcCore::on_store_status(const PacketStoresStatus& status) {
  for (const auto& [id, store] : status.stores) {
    const auto before = std::find_if(store_status_.stores.begin(), store_status_.stores.end(),
                                     [id = id](const auto& known) { return known.first == id; });
    const std::uint64_t known =
        before == store_status_.stores.end() ? 0 : before->second.counters.damaged_octets;
    if (stores_.on_status(id, store)) {
      mission::TtcStoreFullEvent event;
      event.store = id;
      raise(event);
    }
    if (store.counters.damaged_octets == known) continue;
    mission::TtcStoreDamagedEvent event;
    event.store = id;
    event.skipped = as_u32(store.counters.damaged_octets - known);
    raise(event);
  }
  store_status_ = status;
  note_storage(remembered_.stores_work, status.failure.empty(), status.failure, stores_name);
}

void TtcCore::feed_playback() {
  retrieval_.on_playback(downlink_.empty(DownlinkChannel::playback));
  stores_.on_left(downlink_.framed_octets(DownlinkChannel::playback));
  send_reports(report_queue_.take(), std::nullopt);  // the completion, before its event
  for (const RetrievalDone& done : retrieval_.take_done()) {
    mission::TtcRetrievalDoneEvent event;
    event.store = done.store;
    event.packets = done.packets;
    event.octets = done.octets;
    send_behind_ends(event);
  }
  persist_journal();
  const std::size_t room =
      budget_.room(DownlinkBudget::Share::playback, downlink_.room_octets(DownlinkChannel::playback), now_);
  if (const auto batch = retrieval_.next_batch(room))
    act(ReadStore{.batch = *batch, .open_retrieval = false, .items = std::exchange(to_store_, {})});
  if (!reaction().open_retrieval) return;
  if (const auto batch = stores_.next_batch(room))
    act(ReadStore{.batch = *batch, .open_retrieval = true, .items = std::exchange(to_store_, {})});
}

void TtcCore::on_store_read(const ReadStore& read, std::optional<RetrievedPackets> packets,
                            MonotonicTime now) {
  now_ = now;
  std::vector<Octets> to_send;
  if (read.open_retrieval) {
    to_send = stores_.on_batch(read.batch.request, std::move(packets));
  } else if (packets) {
    to_send = retrieval_.on_batch(read.batch.request, std::move(*packets));
  } else {
    retrieval_.fail(read.batch.request);
  }
  for (Octets& packet : to_send) {
    budget_.spend(DownlinkBudget::Share::playback, packet.size(), now);
    downlink_.push(DownlinkChannel::playback, std::move(packet), false, now);
  }
  stores_.on_pushed(downlink_.pushed_octets(DownlinkChannel::playback));
}

void TtcCore::on_read_refused(ReadStore read) {
  take_back(std::move(read.items));
  read.open_retrieval ? stores_.on_batch_refused() : retrieval_.on_batch_refused();
}

// ---- files

FilesRoom TtcCore::files_room(MonotonicTime now) const {
  const std::size_t queue = downlink_.room_octets(DownlinkChannel::files);
  return {queue, budget_.room(DownlinkBudget::Share::files, queue, now)};
}

void TtcCore::fill_files() {
  auto turn = files_.next_turn(
      files_room(now_), now_,
      {.octets = downlink_.field_octets(), .filled = downlink_.begun_octets(DownlinkChannel::files)});
  if (turn) act(TakeFilesTurn{std::move(*turn)});
}

void TtcCore::on_files_turn(Result<cfdp::TransferTurnResult, std::string>& result, MonotonicTime now) {
  now_ = now;
  note_storage(remembered_.files_work, result.has_value(), result ? "" : result.error(), "files");
  if (!result) return files_.on_turn_refused(now);
  for (Octets& packet : files_.on_turn(*result)) {
    budget_.spend(DownlinkBudget::Share::files, packet.size(), now);
    downlink_.push(DownlinkChannel::files, std::move(packet), false, now);
  }
  for (const cfdp::News& news : result->news) tell_of_file(news);
  const cfdp::Counters& c = result->counters;
  files_status_.transactions = static_cast<std::uint8_t>(result->transactions);
  files_status_.resting = static_cast<std::uint8_t>(result->resting);
  const std::uint64_t malformed = std::accumulate(c.malformed.begin(), c.malformed.end(), std::uint64_t{0});
  files_status_.pdus_malformed = as_u32(malformed + files_.counters().malformed);
  files_status_.pdus_refused =
      as_u32(c.class_1 + c.not_for_us + c.no_room + c.no_transaction + c.late + c.unexpected);
  files_status_.data_repeated = as_u32(c.duplicate_data);
  files_status_.data_dropped = as_u32(c.dropped_data);
  files_status_.checkpoints = as_u32(c.checkpoints);
  files_status_.checkpoint_failures = as_u32(c.checkpoint_failures);
}

void TtcCore::tell_of_file(const cfdp::News& news) {
  constexpr std::size_t name_octets_max = 120;
  const std::string name = news.file.destination_file.substr(0, name_octets_max);
  const bool down = news.event.role == cfdp::Role::sending;
  const auto direction = down ? mission::FileDirection::down : mission::FileDirection::up;
  const auto condition = static_cast<mission::FileCondition>(news.event.outcome.condition);
  if (news.event.kind == cfdp::EventKind::fault) {
    mission::FileFaultEvent event;
    event.name = name;
    event.direction = direction;
    event.condition = condition;
    event.reaction = cfdp::to_string(news.event.handler);
    return raise(event);
  }
  if (news.event.kind != cfdp::EventKind::finished) return;
  if (news.event.outcome.condition != wire::CfdpCondition::no_error || news.event.outcome.incomplete) {
    ++files_status_.failed;
    mission::FileFailedEvent event;
    event.name = name;
    event.direction = direction;
    event.condition = condition;
    return raise(event);
  }
  const auto say = [&](auto event) {
    event.name = name;
    event.octets = news.file.file_octets.value_or(0);
    raise(event);
  };
  if (down) {
    ++files_status_.sent;
    if (outbox_image(name)) imaging_.on_product_sent();
    say(mission::FileSentEvent{});
  } else {
    ++files_status_.received;
    say(mission::FileReceivedEvent{});
  }
}

// ---- events

void TtcCore::note_storage(bool& known, bool works, const std::string& why, const std::string& what) {
  if (!works && known) {
    log(LogLine::Level::error, "storage unavailable: " + why);
    mission::TtcStorageUnavailableEvent event;
    event.what = why;
    raise(event);
  } else if (works && !known) {
    log(LogLine::Level::info, "storage is available again: " + what);
    mission::TtcStorageAvailableEvent event;
    event.what = what;
    raise(event);
  }
  known = works;
}

void TtcCore::report_rejections() {
  for (const auto& event : router_.take_rejected()) raise(event);
  for (const auto& event : forwarder_.take_expired()) raise(event);
}

void TtcCore::report_hazards() {
  const auto tell = [this](const HazardName& name, auto event) {
    event.apid = name.apid;
    event.service = name.service;
    event.subtype = name.subtype;
    event.digest = name.digest;
    send_event(event);
  };
  for (const HazardNews& news : hazards_.take_news()) {
    if (news.reason) {
      mission::TtcDisarmedEvent event;
      event.reason = *news.reason;
      tell(news.name, event);
    } else {
      mission::TtcArmedEvent event;
      event.window_ms = static_cast<std::uint32_t>(hazards_.window().count());
      tell(news.name, event);
    }
  }
}

void TtcCore::report_refused_frames() {
  const auto sum = refused_frames_.take_due(uplink_.counters(), now_);
  if (!sum) return;
  mission::TtcFramesRefusedEvent event;
  event.not_authentic = sum->not_authentic;
  event.replayed = sum->replayed;
  event.too_old = sum->too_old;
  event.counter_out_of_range = sum->counter_out_of_range;
  event.counter = sum->newest_counter;
  event.since_s = as_u32(static_cast<std::uint64_t>(sum->since.count()));
  raise(event);
}

void TtcCore::report_keys_at_start() {
  for (const UnusableKey& key : unusable_keys_) {
    log(LogLine::Level::error, "association " + std::to_string(key.spi) + " is not used: " + key.why);
    mission::TtcKeyUnusableEvent event;
    event.spi = key.spi;
    event.why = key.why;
    send_event(event);
  }
  for (const KeyNews& news : std::exchange(key_news_, {})) report_keys(news.vc, news.set, news.why);
  for (const UnusableMaster& master : unusable_masters_) {
    log(LogLine::Level::error, fmt::format("key-encryption key {} is not used: {}", master.id, master.why));
    mission::KeysMasterUnusableEvent event;
    event.key = master.id;
    event.why = master.why;
    send_event(event);
  }
  if (session_keys_lost_.empty()) return;
  mission::KeysLostEvent event;
  event.what = std::exchange(session_keys_lost_, {});
  log(LogLine::Level::error, "the stored session keys are damaged: " + event.what);
  send_event(event);
}

void TtcCore::report_rekeyed(std::uint16_t spi, std::uint16_t key, const std::string& why) {
  log(LogLine::Level::warn, fmt::format("association {} takes key {}: {}", spi, key, why));
  mission::KeysAssociationRekeyedEvent event;
  event.spi = spi;
  event.key = key;
  event.why = why;
  send_event(event);
}

void TtcCore::report_keys(std::uint8_t vc, KeySet set, const std::string& why) {
  log(LogLine::Level::warn,
      "TC virtual channel " + std::to_string(vc) + " uses keys " + std::string(to_text(set)) + ": " + why);
  mission::TtcKeysSelectedEvent event;
  event.vc = vc;
  event.set = set;
  event.why = why;
  send_event(event);
}

// ---- other nodes

bool TtcCore::on_tick(const ReceivedTick& tick, std::uint64_t cycle, MonotonicTime now) {
  now_ = now;
  if (!clock_.on_tick(tick, now)) {
    ++remembered_.foreign_samples;
    return false;
  }
  cycle_ = cycle;
  if (floor_wanted_ == FloorWanted::no || !tick.time_valid) return false;
  raise_counters();
  return true;  // a ground station with lower counters sees at once where they go on
}

bool TtcCore::on_telemetry(const std::string& node, std::uint16_t apid, std::uint16_t structure_id,
                           OctetView data, MonotonicTime now) {
  now_ = now;
  const mission::ApplicationProcess* source = dictionary_.apid_of_node(node);
  if (source == nullptr || source->apid != apid) {
    ++remembered_.foreign_samples;
    return false;
  }
  const auto report = housekeeping_.on_sample(apid, structure_id, data, now);
  if (!report) return false;
  beacon_.on_telemetry(node, structure_id, data, now);
  causes_.on_telemetry(structure_id, data, now);
  obedience_.on_telemetry(node, structure_id, data);
  boot_ = beacon_.boot().value_or(boot_);
  send(*report);
  monitor(structure_id, data);
  return true;
}

bool TtcCore::on_event(const std::string& node, std::uint16_t event_id, std::uint8_t severity, OctetView data,
                       MonotonicTime now) {
  now_ = now;
  const mission::ApplicationProcess* source = dictionary_.apid_of_node(node);
  const std::uint16_t apid = source != nullptr ? source->apid : std::uint16_t{1};
  const mission::Event* event = dictionary_.event(event_id);
  if (event != nullptr && node != node_ && !may_raise(source != nullptr ? apid : std::uint16_t{0}, *event)) {
    ++remembered_.foreign_samples;
    return false;
  }
  // Also of an event that is disabled or comes too often: what is reported is another matter.
  const bool sound = event != nullptr && events_.takes(event_id, severity) &&
                     dictionary_.decode(event->fields, data).has_value();
  if (source != nullptr && sound) event_actions_.on_event(apid, event_id, now);
  const auto report = events_.on_event(apid, event_id, severity, data, now);
  obedience_.on_event(node, event_id, data);
  if (report) send(*report);
  return report.has_value();
}

// ---- housekeeping

bool TtcCore::is_sampled(const mission::Structure& structure) {
  return structure.kind == mission::StructureKind::housekeeping && structure.id != 0;
}

void TtcCore::add_structure(const mission::Structure& structure) {
  // What ttc samples itself already comes at its period.
  const bool own = structure.node == node_;
  std::size_t text_octets = 0;
  for (const mission::Field& field : structure.fields) {
    if (field.type == mission::FieldType::text) text_octets += field.max_text * field.count;
  }
  housekeeping_.add_structure(structure.id, structure.apid, structure.max_size() - text_octets,
                              structure.max_size(),
                              {.enabled = true, .interval = own ? milliseconds(0) : structure.interval});
}

void TtcCore::add_reports() {
  for (const mission::Structure& structure : dictionary_.structures()) {
    if (is_sampled(structure)) add_structure(structure);
  }
  for (const mission::Event& event : dictionary_.events()) events_.add_event(event.id);
  events_.add_essential_event(mission::event::ttc_retrieval_done);
}

void TtcCore::add_latency(mission::TtcHousekeeping& h) const {
  const LatencyHistogram& latency = acceptance_latency_;
  const auto us = [](nanoseconds d) { return as_u32(static_cast<std::uint64_t>(d.count() / 1000)); };
  h.transmitter_off_s = as_u32(static_cast<std::uint64_t>(transmitter_.rest(now_) / seconds(1)));
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

void TtcCore::add_link_counters(mission::TtcHousekeeping& h) const {
  const UplinkCounters& up = uplink_.counters();
  const wire::CltuDecoder::Counters& cltu = uplink_.cltu_counters();
  const VerificationCounters& verification = report_queue_.counters();
  const DownlinkCounters down = downlink_.counters();
  const ForwardingCounters& forwarded = forwarder_.counters();
  const GateCounters& gate = gate_.counters();
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
  const AcceptanceJournalCounters& journal = journal_.counters();
  h.tc_open = as_u32(journal_.open());
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
  h.sdls_too_old = up.too_old;
  h.sdls_oldest_counter = uplink_.oldest_counter(now_).value_or(0);
  h.sdls_contingency_spi = uplink_.associations().contingency;
  h.sdls_contingency_counter = uplink_.counter(h.sdls_contingency_spi).value_or(0);
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
}

void TtcCore::add_store_counters(mission::TtcHousekeeping& h) const {
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
  h.store_failures = as_u32(sum.refused + remembered_.unstored_packets);
  h.store_dropped = as_u32(sum.overwritten);
  h.store_write_failures = as_u32(sum.write_failures);
  h.store_damaged = as_u32(sum.damaged);
  h.store_unreadable = as_u32(sum.unreadable);
  h.store_cut_octets = as_u32(sum.cut_octets);
  h.store_written_octets = sum.written_octets;
  h.retrievals_incomplete = as_u32(retrieval_.incomplete());
}

void TtcCore::send_own_housekeeping(const AdapterCounters& adapter, MonotonicTime now) {
  now_ = now;
  mission::TtcHousekeeping h;
  h.cycle = cycle_;
  add_link_counters(h);
  add_store_counters(h);
  h.housekeeping_samples = as_u32(housekeeping_.counters().samples);
  h.housekeeping_live = as_u32(housekeeping_.counters().live);
  h.events_reported = as_u32(events_.counters().reported);
  h.events_disabled = as_u32(events_.counters().disabled);
  h.events_suppressed = as_u32(events_.counters().suppressed + adapter.suppressed_events);
  h.publish_drops = as_u32(adapter.publish_drops);
  h.dds_malformed = as_u32(adapter.malformed_samples);
  h.dds_foreign = as_u32(housekeeping_.counters().unknown + events_.counters().unknown +
                         forwarder_.counters().stray_reports + remembered_.foreign_samples);
  h.tm_lost = as_u32(adapter.lost_frames);
  add_latency(h);
  send_housekeeping(h, now);
}

void TtcCore::send_files_housekeeping(MonotonicTime now) {
  mission::TtcFilesHousekeeping h = files_status_;
  const FileExchangeCounters& link = files_.counters();
  h.pdus_received = as_u32(link.received);
  h.pdus_sent = as_u32(link.sent);
  h.pdus_dropped = as_u32(link.dropped);
  send_housekeeping(h, now);
}

void TtcCore::send_schedule_housekeeping(MonotonicTime now) {
  const TimeSchedule& schedule = schedule_.schedule();
  const ScheduleCounters& counters = schedule_.counters();
  mission::TtcScheduleHousekeeping h;
  h.enabled = schedule.enabled() ? mission::ScheduleStatus::enabled : mission::ScheduleStatus::disabled;
  h.activities = static_cast<std::uint16_t>(schedule.activities().size());
  h.octets = static_cast<std::uint32_t>(schedule.octets());
  h.groups = static_cast<std::uint8_t>(schedule.groups().size());
  h.inserted = counters.inserted;
  h.released = counters.released;
  h.late = counters.late;
  h.disabled = counters.disabled;
  h.refused = counters.refused;
  send_housekeeping(h, now);
}

void TtcCore::send_imaging_housekeeping(MonotonicTime now) {
  send_housekeeping(imaging_.housekeeping(), now);
}

// ---- mode

std::optional<std::uint32_t> TtcCore::mode_since_s() const {
  const auto utc = valid_utc();
  if (!utc || !mode_.since() || *utc < *mode_.since()) return std::nullopt;
  return as_u32(static_cast<std::uint64_t>((*utc - *mode_.since()) / seconds(1)));
}

void TtcCore::send_health(MonotonicTime now) {
  now_ = now;
  mission::HealthHousekeeping h;
  h.mode = mode_.mode();
  h.cause = mode_.why().cause;
  h.reason = mode_.reason();
  if (mode_.since()) h.since = to_tai(*mode_.since());
  h.change = mode_.change_count();
  h.commanded = mode_.commanded();
  const auto obeys = obedience_.of(mode_.change_count(), node_);
  h.node_obeys.resize(std::min<std::size_t>(obeys.size(), mission::most_nodes));
  std::copy_n(obeys.begin(), h.node_obeys.size(), h.node_obeys.begin());
  const auto shed = causes_.settings().shed.find(causes_.name_of(mode_.mode()));
  if (shed != causes_.settings().shed.end()) h.shed = shed->second;
  std::string present = causes_.present_text();
  if (step_.step != suite::BootStep::normal)
    present = fmt::format("start step {}{}{}", to_text(step_.step), present.empty() ? "" : ", ", present);
  h.present = excerpt(present, most_health_text);
  h.next = excerpt(causes_.way_back(mode_), most_health_text);
  if (h.next.empty()) {
    const auto next_s = as_u32(static_cast<std::uint64_t>(command_loss_.until_next(now) / seconds(1)));
    h.next = fmt::format("command loss: {}", to_text(command_loss_.next_step()));
    h.next_in_s = next_s;
  }
  send_housekeeping(h, now);
  send_boot_step(now);
}

void TtcCore::send_boot_step(MonotonicTime now) {
  mission::BootStepHousekeeping h;
  h.step = static_cast<mission::BootStep>(step_.step);
  h.cause = static_cast<mission::BootStepCause>(step_.cause);
  h.unhealthy_starts = step_.unhealthy_starts();
  h.set_aside = step_.set_aside;
  h.detail = step_.detail;
  h.uptime_s = as_u32(static_cast<std::uint64_t>((now - begun_) / seconds(1)));
  h.suite_in_s = UINT32_MAX;
  h.storage_writable = remembered_.journal_durable;
  h.free_mib = store_status_.free_mib;
  send_housekeeping(h, now);
}

// ---- beacon

void TtcCore::fill_next_scheduled(BeaconInputs& inputs) const {
  const auto next = schedule_.next();
  if (!next) return;
  const auto packet = wire::parse_tc_packet(next->activity->packet);
  if (packet && packet->service == function_service)
    inputs.next_scheduled_function = OctetReader(packet->application).u16();
  if (next->in) {
    const auto whole = std::chrono::duration_cast<seconds>(*next->in).count();
    inputs.next_scheduled_in_s = static_cast<std::uint32_t>(std::min<std::int64_t>(whole, UINT32_MAX - 1));
  }
}

void TtcCore::send_beacon(std::uint8_t farm_channel, MonotonicTime now) {
  now_ = now;
  BeaconInputs in;
  in.cycle = cycle_;
  in.boot = boot_;
  in.mode = mode_.mode();
  in.mode_reason = mode_.reason();
  in.mode_since_s = mode_since_s();
  const auto obeys = obedience_.of(mode_.change_count(), node_);
  in.mode_pending =
      static_cast<std::uint8_t>(std::count(obeys.begin(), obeys.end(), mission::ModeObedience::pending));
  in.mode_causes = causes_.present_bits();
  in.time_valid = clock_.valid();
  in.storage_free_mib = store_status_.free_mib;
  for (const auto& [id, store] : store_status_.stores) in.store_records += as_u32(store.records);
  in.last_telecommand = report_queue_.last();
  const UplinkChain::Associations used = uplink_.associations();
  in.sdls_spi = {used.bd, used.ad};
  for (std::size_t i = 0; i < in.sdls_spi.size(); ++i)
    in.sdls_counter[i] = uplink_.counter(in.sdls_spi[i]).value_or(0);
  in.storage_state = static_cast<mission::StorageState>((remembered_.journal_durable ? 0 : 1) +
                                                        (remembered_.stores_work ? 0 : 2));
  const wire::FarmState& farm = uplink_.farm(farm_channel);
  in.farm_vr = farm.vr;
  in.farm_lockout = farm.lockout;
  in.command_loss_s = as_u32(static_cast<std::uint64_t>(command_loss_.until_next(now) / seconds(1)));
  schedule_.on_time(clock_.tai_at(now), clock_.valid());
  fill_next_scheduled(in);
  using mission::Beacon;
  const Octets content = beacon_.build(in, now);
  auto report = housekeeping_.on_sample(Beacon::apid, Beacon::structure_id, content, now);
  if (!report) return;
  report->live = true;  // unasked and in every mode: it cannot be switched off
  send(*report);
  monitor(Beacon::structure_id, content);
}

}  // namespace srfs
