// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/ttc.hpp"

#include <mission/structures.hpp>

#include "base/text.hpp"

namespace srfs::simulation {
namespace {

constexpr std::size_t journal_worker_capacity = 2;
constexpr std::uint8_t telecommand_channel = 0;
constexpr std::size_t store_quota_octets = 192U << 10;
constexpr std::size_t store_pending_octets = 64U << 10;
// Of the true time; the first tick corrects it.
const UtcTime unknown_utc{seconds(1'767'225'600)};

std::optional<Stage> to_stage(std::uint8_t number) {
  const auto stage = static_cast<Stage>(number);
  return is_valid(stage) && stage != Stage::routing ? std::optional(stage) : std::nullopt;
}

}  // namespace

void TtcFlash::set_failing(bool failing) {
  journal.failing = failing;
  stores.state().failing = failing;
  files.set_failing(failing);
}

void TtcFlash::lose_power() {
  set_failing(false);
  stores.lose_power();
  files.lose_power();
  journal.lose_at = journal.calls;
  try {
    (void)journal.sync(0);
  } catch (const testing_support::PowerLoss&) {
  }
}

bool EndingMedium::has_ended() {
  return left_ && (*left_ == 0 || (*left_)-- == 0);
}

Result<void, FileError> EndingMedium::write(unsigned segment, std::size_t offset, OctetView octets) {
  if (has_ended()) return Err(FileError{"the process has ended"});
  return medium_.write(segment, offset, octets);
}

Result<void, FileError> EndingMedium::sync(unsigned segment) {
  if (has_ended()) return Err(FileError{"the process has ended"});
  return medium_.sync(segment);
}

Ttc::Ttc(Host& host, TtcSurroundings surroundings)
    : host_(host),
      around_(std::move(surroundings)),
      medium_(around_.flash.journal),
      log_(medium_),
      store_worker_(host, around_.disk),
      file_worker_(host, around_.disk),
      timer_(host.kernel(), host.guard(), [this] {
        core_->on_deadline(host_.now());
        core_->on_line_idle(host_.now());
        advance();
      }) {}

void Ttc::start() {
  core_.emplace(read_setup());
  core_->add_reports();
  open_stores();
  open_files();
  core_->restore(host_.now());
  run(core_->take_actions());
  subscribe();
  start_periods();
  core_->activate(host_.now());
  advance();
}

/// A kill or power cut in the middle of a write: nothing of it was done, or it was not synced, or all was.
Ttc::~Ttc() {
  TtcFlash& flash = around_.flash;
  flash.set_failing(around_.disk.failing());
  try {
    end_work_in_flight();
  } catch (const Violation& violation) {
    host_.kernel().report(violation);
  }
  if (journal_jobs_.empty() || flash.journal.failing) return;
  const auto calls = static_cast<unsigned>(flash.in_flight.below(flash.cut.size()));
  ++flash.cut.at(calls);
  medium_.end_after(calls);
  const JournalBatch& batch = journal_jobs_.front();
  (void)(batch.snapshot ? log_.snapshot(*batch.snapshot) : log_.append(batch.records, batch.sync));
}

/// The first jobs of the workers are done in part.
void Ttc::end_work_in_flight() {
  TtcFlash& flash = around_.flash;
  flash.stores.state().changes_left = static_cast<unsigned>(flash.work_in_flight.below(12));
  store_worker_.finish_first();
  flash.stores.state().changes_left.reset();
  flash.stores.on_end();
  cfdp::MemoryFileStore& files = *flash.files.disk(FileRecord::End::board);
  files.calls_until_kill = flash.work_in_flight.below(6);
  files.kill_after_effect = flash.work_in_flight.one_in(2);
  try {
    file_worker_.finish_first();
  } catch (const cfdp::Killed&) {
  }
  files.calls_until_kill.reset();
  flash.files.on_process_end(FileRecord::End::board);
}

std::string Ttc::text_of(const std::string& name) const {
  const auto content = around_.disk.read("ttc/" + name);
  return content ? std::string(as_text(*content)) : std::string();
}

FoundTable Ttc::table_of(std::string_view name) const {
  const std::string text = text_of(std::string(name));
  if (text.empty()) return {};
  auto table = decode_table(text);
  const bool damaged = !table;
  return {.table = std::move(table), .damaged = damaged};
}

TtcCore::Setup Ttc::read_setup() {
  const std::string mode = text_of("mode");
  const bool ran = around_.disk.read("ttc/mode").has_value();
  DownlinkConfig downlink = around_.downlink;
  downlink.first_counts = around_.flash.frame_counts;
  TtcCore::Setup setup{.dictionary = around_.dictionary,
                       .node = host_.name(),
                       .journal = AcceptanceJournal(around_.boot_id, seconds(60)),
                       .uplink = std::move(around_.uplink),
                       .downlink = downlink,
                       .mode = ModeManager(ran ? StoredModeState::present : StoredModeState::first_start,
                                           mode, MissionMode::nominal),
                       .transmitter = TransmitterSwitch(around_.boot_id, text_of("transmitter"), host_.now()),
                       .command_loss = CommandLossTimer(around_.boot_id, text_of("command_loss"),
                                                        around_.command_loss, host_.now()),
                       .stores = text_of("stores"),
                       .monitors = table_of(MonitoringService::table_name),
                       .event_actions = table_of(EventActionService::table_name),
                       .keys = {},
                       .boot = {.count = around_.boot_count},
                       .clock = SpacecraftClock(unknown_utc, host_.now()),
                       .lifetime = seconds(600),
                       .modes = around_.modes,
                       .begun = host_.now()};
  (void)around_.disk.write_now("ttc/mode", octets_of_text(setup.mode.stored_text()));
  (void)around_.disk.write_now("ttc/transmitter", octets_of_text(setup.transmitter.stored_text()));
  load_journal(setup);
  return setup;
}

/// As StoredState does.
void Ttc::load_journal(TtcCore::Setup& setup) {
  const JournalLog::Found found = log_.load();
  setup.journal_damaged_octets = found.damaged_octets;
  for (const JournalRecord& record : found.records) {
    if (!setup.journal.apply(record)) throw Violation{"L4", "a record of ttc's journal that cannot be read"};
  }
  const LinkState& copy = around_.flash.link_copy;
  setup.copied_generation = copy.generation;
  setup.journal.begin(copy, first_telecommand_id(copy.next_telecommand_id, 0, unknown_utc), host_.now());
  const bool nothing = !setup.journal.has_state() && setup.journal.link().generation == 0;
  setup.first_start = nothing && !found.existed;
  if (!nothing) return;
  const JournalBatch batch = setup.journal.take_batch(true);
  const auto written =
      batch.snapshot ? log_.snapshot(*batch.snapshot) : log_.append(batch.records, batch.sync);
  setup.journal.on_written(batch, written.has_value(), log_.used_octets());
}

void Ttc::subscribe() {
  Topics& topics = around_.topics;
  topics.time_tick.subscribe(host_, [this](const auto& tick, Host&) {
    const ReceivedTick received{.utc_s = static_cast<std::uint32_t>(tick.utc.sec),
                                .utc_ns = tick.utc.nanosec,
                                .monotonic_ns = tick.monotonic_ns,
                                .period_us = tick.period_us,
                                .time_valid = tick.time_valid,
                                .sync_state = tick.sync_state};
    around_.witness.on_time(UtcTime(seconds(received.utc_s) + nanoseconds(received.utc_ns)),
                            received.time_valid);
    if (core_->on_tick(received, tick.cycle, host_.now()) || core_->waits_for_time()) advance();
  });
  topics.event.subscribe(host_, [this](const auto& m, Host&) {
    const bool sends = core_->on_event(m.source, m.event_id, m.severity, m.data, host_.now());
    if (core_->has_waiting_actions()) return advance();
    if (sends) pump_downlink();
  });
  topics.telemetry.subscribe(host_, [this](const auto& m, Host&) {
    const bool sends = core_->on_telemetry(m.source, m.apid, m.structure_id, m.data, host_.now());
    if (core_->has_waiting_actions()) return advance();
    if (sends) pump_downlink();
  });
  topics.telecommand_report.subscribe(host_, [this](const auto& m, Host&) {
    const auto stage = to_stage(m.stage);
    if (!stage) return;
    core_->on_telecommand_report(m.node,
                                 {.id = m.id,
                                  .stage = *stage,
                                  .success = m.success,
                                  .failure_code = m.failure_code,
                                  .step = m.progress_step,
                                  .data = m.data},
                                 host_.now());
    advance();
  });
}

void Ttc::every(nanoseconds period, std::function<void()> work) {
  host_.every(period, [this, work = std::move(work)] {
    work();
    advance();
  });
}

void Ttc::start_periods() {
  every(seconds(1), [this] {
    core_->commit_stores(true, host_.now());
    look_at_nodes();
  });
  every(ModeManager::publish_period, [this] { core_->publish_mode(); });
  every(seconds(30), [this] { core_->send_schedule_housekeeping(host_.now()); });
  every(seconds(30), [this] { core_->send_monitoring_housekeeping(host_.now()); });
  every(seconds(10), [this] {
    core_->copy_link_state();
    core_->store_open_progress();
  });
  every(seconds(30), [this] { core_->send_files_housekeeping(host_.now()); });
  every(seconds(5), [this] { core_->send_own_housekeeping({}, host_.now()); });
  every(seconds(30), [this] { core_->send_beacon(telecommand_channel, host_.now()); });
  every(seconds(30), [this] { core_->send_health(host_.now()); });
}

/// As TtcNode finds it by the lifecycle of the nodes.
void Ttc::look_at_nodes() {
  for (const Host* node : around_.nodes) core_->on_node_state(node->name(), node->runs(), host_.now());
}

// ---------------------------------------------------------------- line

void Ttc::on_line(const Octets& octets) {
  OctetView rest(octets);
  while (!rest.empty()) {
    const std::size_t part = std::min(rest.size(), TtcCore::read_octets);
    core_->on_octets(rest.first(part), host_.now());
    rest = rest.subspan(part);
  }
  advance();
}

void Ttc::pump_downlink() {
  bool again = false;
  do {
    core_->fill_downlink(host_.now());
    run(core_->take_actions());
    while (auto cadu = core_->next_cadu(host_.now())) {
      around_.flash.frame_counts = core_->frame_counts();
      host_.output([this, cadu = std::move(*cadu)] { around_.witness.on_cadu(cadu); });
    }
    again = !again && core_->wants_playback();
  } while (again);
  timer_.arm(core_->next_due(host_.now()));
}

void Ttc::advance() {
  const bool outermost = run(core_->settle(host_.now()));
  if (!core_->remembered().journal_durable) around_.witness.on_storage_lost();
  if (outermost) pump_downlink();
}

bool Ttc::run(TtcCore::Actions actions) {
  return actions_.run(std::move(actions), [this](const TtcAction& action) {
    host_.action_point();
    std::visit([this](const auto& a) { carry_out(a); }, action);
  });
}

// ---------------------------------------------------------------- disk

void Ttc::carry_out(const WriteJournal& action) {
  if (journal_jobs_.size() == journal_worker_capacity) {
    core_->on_journal_written(action.batch, Err(FileError{"the journal's worker is busy"}), 0, host_.now());
    return;
  }
  journal_jobs_.push_back(action.batch);
  if (journal_jobs_.size() == 1) work_on_journal();
}

void Ttc::work_on_journal() {
  host_.later(around_.disk.write_time(), [this] {
    const JournalBatch batch = std::move(journal_jobs_.front());
    journal_jobs_.pop_front();
    around_.flash.set_failing(around_.disk.failing());
    const auto written =
        batch.snapshot ? log_.snapshot(*batch.snapshot) : log_.append(batch.records, batch.sync);
    host_.trace(Lane::world, written ? "journal written" : "journal not written", batch.revision);
    if (!journal_jobs_.empty()) work_on_journal();
    core_->on_journal_written(batch, written, log_.used_octets(), host_.now());
    advance();
  });
}

void Ttc::carry_out(const WriteState& action) {
  around_.disk.write(host_, "ttc/" + action.name, octets_of_text(action.text),
                     [this, change = action.change](bool stored) {
                       core_->on_state_written(change, stored);
                       advance();
                     });
}

void Ttc::carry_out(const WriteKeys& action) {
  core_->on_keys_written(action.change, true, host_.now());
}

void Ttc::carry_out(const WriteSessionKeys& action) {
  core_->on_session_keys_written(action.change, true, host_.now());
}

/// There is no srfs_rescue here: the computer restarts, and the suite with it.
void Ttc::carry_out(const WriteRescueEntry& action) {
  core_->on_rescue_entry_written(action.entry, true);
}

void Ttc::carry_out(const WriteTable& action) {
  around_.disk.write(host_, "ttc/" + action.name, octets_of_text(encode_table(action.change.table)),
                     [this, action](bool stored) {
                       core_->on_table_written(action.name, action.change, stored);
                       advance();
                     });
}

void Ttc::carry_out(const CopyLinkState& action) {
  if (!around_.disk.failing()) around_.flash.link_copy = action.state;
}

void Ttc::carry_out(const ForgetWantedFloor& /*action*/) {}

// ---------------------------------------------------------------- packet stores

/// As TtcDisk does. The stores are small, so that segments are deleted for the quota.
void Ttc::open_stores() {
  around_.flash.set_failing(around_.disk.failing());
  StoreLedger& ledger = around_.flash.stores;
  stores_.emplace(around_.dictionary, [&ledger](const mission::PacketStore& store) {
    return PacketStore({.folder = {},
                        .quota_octets = store_quota_octets,
                        .segment_octets = StoreLedger::usual_segment_octets,
                        .pending_octets = store_pending_octets},
                       std::make_unique<PlayedSegmentFiles>(ledger.disk(store.id)));
  });
  stores_->open();
  ledger.on_open(stores_->status());
}

void Ttc::append(const std::vector<StoreItem>& items) {
  for (const StoreItem& item : items) {
    stores_->append(item);
    around_.flash.stores.on_append(item, stores_->status());
  }
}

void Ttc::commit(const CommitStores& action) {
  around_.flash.set_failing(around_.disk.failing());
  stores_->set_bounded(action.bounded);
  append(action.items);
  stores_->commit();
  around_.flash.stores.on_commit(stores_->status());
}

void Ttc::carry_out(const CommitStores& action) {
  const auto committed = std::make_shared<const CommitStores>(action);
  store_worker_.ask([this, committed] { commit(*committed); },
                    [this, committed] {
                      core_->on_committed(*committed, stores_->status(), {});
                      advance();
                    });
}

void Ttc::carry_out(const ReadStore& action) {
  const auto read = std::make_shared<const ReadStore>(action);
  const auto packets = std::make_shared<std::optional<RetrievedPackets>>();
  store_worker_.ask(
      [this, read, packets] {
        around_.flash.set_failing(around_.disk.failing());
        append(read->items);
        *packets = stores_->read(read->batch.period.store, read->batch.period.range, read->batch.cursor,
                                 PacketRetrieval::batch_octets);
        around_.flash.stores.on_read(*read, *packets, stores_->status());
      },
      [this, read, packets] {
        core_->on_store_read(*read, std::move(*packets), host_.now());
        advance();
      });
}

// ---------------------------------------------------------------- files

/// As FilesFolder does.
void Ttc::open_files() {
  const auto& disk = around_.flash.files.disk(FileRecord::End::board);
  files_ = std::make_unique<cfdp::TransferFolders>(
      disk, disk->checkpoint, cfdp::Settings{.own_entity = 2, .peer_entity = 1, .free_floor_octets = 0},
      first_transaction(host_.now()), host_.now());
  if (files_->damaged()) throw Violation{"L12", "the checkpoint of the files cannot be read"};
}

void Ttc::carry_out(const TakeFilesTurn& action) {
  const auto turn = std::make_shared<const cfdp::TransferTurn>(action.turn);
  const auto result = std::make_shared<Result<cfdp::TransferTurnResult, std::string>>();
  file_worker_.ask(
      [this, turn, result] {
        around_.flash.set_failing(around_.disk.failing());
        *result = cfdp::take_turn(*files_, *turn, host_.now());
        for (const cfdp::News& news : (*result)->news)
          around_.flash.files.on_news(FileRecord::End::board, news);
      },
      [this, result] {
        core_->on_files_turn(*result, host_.now());
        advance();
      });
}

void Ttc::carry_out(const ServeFile& /*action*/) {
  core_->on_file_refused(host_.now());
}

// ---------------------------------------------------------------- other nodes

void Ttc::carry_out(const PublishTelecommand& action) {
  const mission::Command& command = *action.telecommand.command;
  srfs_msgs::msg::Telecommand message;
  message.id = action.telecommand.origin.id;
  message.target = command.node;
  message.apid = command.apid;
  message.function_id = command.function_id;
  message.repeat_class = static_cast<std::uint8_t>(command.repeat_class);
  message.expiry_ns = static_cast<std::uint64_t>(action.telecommand.expiry.ns());
  message.arguments = action.telecommand.arguments;
  around_.witness.on_published(action.telecommand);
  around_.topics.telecommand.publish(host_, std::move(message));
}

void Ttc::carry_out(const PublishMode& action) {
  host_.trace(host_.lane(), "mode", static_cast<std::uint64_t>(action.mode));
  host_.kernel().coverage().note(StateTable::mode, 0, static_cast<std::uint8_t>(action.mode));
  around_.witness.on_mode(action.change);
  srfs_msgs::msg::SystemMode m;
  m.mode = static_cast<std::uint8_t>(action.mode);
  m.name = action.name;
  m.change = action.change;
  m.reason = action.reason;
  m.monotonic_ns = static_cast<std::uint64_t>(host_.now().ns());
  around_.topics.mode.publish(host_, std::move(m));
}

void Ttc::carry_out(const RaiseEvent& action) {
  srfs_msgs::msg::Event m;
  m.source = host_.name();
  m.event_id = action.event_id;
  m.severity = static_cast<std::uint8_t>(action.severity);
  m.data = action.data;
  host_.trace(host_.lane(), "event", action.event_id);
  around_.topics.event.publish(host_, std::move(m));
}

void Ttc::carry_out(const TestConnection& action) {
  bool answers = false;
  for (const Host* node : around_.nodes) answers = answers || (node->name() == action.node && node->runs());
  host_.later(answers ? around_.network.delay() : seconds(2), [this, answers] {
    core_->on_connection_answer(answers);
    advance();
  });
}

void Ttc::carry_out(const CallParameter& action) {
  host_.later(seconds(4), [this, number = action.call.number] {
    core_->parameters().on_error(number, ParameterCallError::no_answer);
    advance();
  });
}

void Ttc::carry_out(const ServeImaging& /*action*/) {}

void Ttc::carry_out(const ServeImages& action) {
  core_->on_imaging_job(action.order, {});
}

void Ttc::carry_out(const ReopenLine& /*action*/) {}

void Ttc::carry_out(const RestartComputer& /*action*/) {
  around_.restart_computer("ttc restarts the computer");
}

void Ttc::carry_out(const AcceptanceSent& action) {
  core_->on_acceptance_sent(host_.now() - action.received);
}

void Ttc::carry_out(const LogLine& /*action*/) {}

}  // namespace srfs::simulation
