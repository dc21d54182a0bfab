// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include <mission/structures.hpp>

#include "base/file.hpp"
#include "base/latency_histogram.hpp"
#include "base/result.hpp"
#include "cfdp/transfer_folders.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/command/acceptance_journal.hpp"
#include "nodes/ttc/command/command_forwarder.hpp"
#include "nodes/ttc/command/persistence_gate.hpp"
#include "nodes/ttc/command/telecommand_router.hpp"
#include "nodes/ttc/files/file_exchange.hpp"
#include "nodes/ttc/files/file_service.hpp"
#include "nodes/ttc/imaging/image_outbox.hpp"
#include "nodes/ttc/imaging/imaging_scheduler.hpp"
#include "nodes/ttc/link/downlink_budget.hpp"
#include "nodes/ttc/link/downlink_scheduler.hpp"
#include "nodes/ttc/link/frame_count_file.hpp"
#include "nodes/ttc/link/packet_maker.hpp"
#include "nodes/ttc/link/refused_frames.hpp"
#include "nodes/ttc/link/uplink_chain.hpp"
#include "nodes/ttc/report/beacon_builder.hpp"
#include "nodes/ttc/report/event_reporter.hpp"
#include "nodes/ttc/report/mode_obedience.hpp"
#include "nodes/ttc/services/command_loss_timer.hpp"
#include "nodes/ttc/services/connection_tester.hpp"
#include "nodes/ttc/services/event_action_service.hpp"
#include "nodes/ttc/services/housekeeping_scheduler.hpp"
#include "nodes/ttc/services/key_management_service.hpp"
#include "nodes/ttc/services/mode_causes.hpp"
#include "nodes/ttc/services/monitoring_service.hpp"
#include "nodes/ttc/services/own_functions.hpp"
#include "nodes/ttc/services/parameter_service.hpp"
#include "nodes/ttc/services/schedule_service.hpp"
#include "nodes/ttc/services/time_reporter.hpp"
#include "nodes/ttc/spacecraft_clock.hpp"
#include "nodes/ttc/store/packet_stores.hpp"
#include "nodes/ttc/store/store_control.hpp"
#include "suite/step_down.hpp"

namespace srfs {

// ---- What TtcCore wants done

/// A batch of the journal goes to the disk. Answer: on_journal_written().
struct WriteJournal {
  JournalBatch batch;
};
/// A commanded silence is over; its record would make the next boot silent.
struct SilenceOver {};
/// The computer is restarted once its record is on disk: it must not be restarted for the same step again.
struct RestartWanted {};
/// What a telecommand has changed, or what nobody waits for.
using StateChange =
    std::variant<std::monostate, ModeChange, TransmitterChange, StoreChange, SilenceOver, RestartWanted>;
/// A small file of the node's state. Answer: on_state_written().
struct WriteState {
  std::string name;
  std::string text;
  StateChange change;
};
/// The selection of keys. Answer: on_keys_written().
struct WriteKeys {
  KeySelection selection;
  KeyChange change;
};
/// The session keys. Answer: on_session_keys_written().
struct WriteSessionKeys {
  SessionKeyChange change;
};
/// The record that makes the next start srfs_rescue. Answer: on_rescue_entry_written().
struct WriteRescueEntry {
  RescueEntry entry;
};
/// The table of a service that a telecommand has changed. Answer: on_table_written().
struct WriteTable {
  std::string name;
  TableChange change;
};
/// The second home of the link state, should the journal be damaged.
struct CopyLinkState {
  LinkState state;
};
/// The counters of the uplink have their floor on the disk.
struct ForgetWantedFloor {};
/// Packets of the last second. Answer: on_committed() or on_commit_refused().
struct CommitStores {
  std::vector<StoreItem> items;
  std::vector<std::uint16_t> bounded;
  std::optional<wire::TmFrameCounts> counts;
  std::optional<std::uint64_t> numbers;  ///< the reserve of FrameNumbers
  std::uint64_t told = 0;                ///< serial up to which the ground has, or can ask for, everything
};
/// A batch for the playback channel; items first: what was sent up to now belongs to the period. Answer:
/// on_store_read() or on_read_refused().
struct ReadStore {
  PacketRetrieval::Batch batch;
  bool open_retrieval = false;
  std::vector<StoreItem> items;
};
/// To the node that executes it.
struct PublishTelecommand {
  Telecommand telecommand;
};
struct PublishMode {
  MissionMode mode = MissionMode::safe;
  std::string name;
  std::uint32_t change = 0;
  std::string reason;
};
/// The mode is another one: periods that it sets begin anew.
struct FollowMode {};
/// On the topic of events, where the other nodes hear it and this one too.
struct RaiseEvent {
  mission::EventSeverity severity = mission::EventSeverity::info;
  std::uint16_t event_id = 0;
  Octets data;
};
/// PUS 17: whether a node answers. Answer: on_connection_answer().
struct TestConnection {
  std::string node;
};
/// PUS 20. Answer: one of parameters'.
struct CallParameter {
  ParameterCall call;
};
/// PUS 23. Answer: on_file_outcome() or on_file_refused().
struct ServeFile {
  FileOrder order;
};
/// CFDP. Answer: on_files_turn() or on_files_turn_refused().
struct TakeFilesTurn {
  cfdp::TransferTurn turn;
};
/// A goal of an imaging node. Answers: those of ImagingScheduler.
struct ServeImaging {
  ImagingOrder order;
};
/// What an imaging task wants of the disk; one at a time. Answer: on_imaging_job().
struct ServeImages {
  ImagingOrder order;
};
/// Close the line and open it anew.
struct ReopenLine {};
/// Starve the watchdog.
struct RestartComputer {};
/// A 1,1 or 1,2 is in the downlink's queue. Answer: on_acceptance_sent().
struct AcceptanceSent {
  MonotonicTime received;  ///< when the last octet of its telecommand was read
};
struct LogLine {
  enum class Level : std::uint8_t { info, warn, error };
  Level level = Level::info;
  std::string text;
};

using TtcAction =
    std::variant<WriteJournal, WriteState, WriteKeys, WriteSessionKeys, WriteRescueEntry, WriteTable,
                 CopyLinkState, ForgetWantedFloor, CommitStores, ReadStore, PublishTelecommand, PublishMode,
                 FollowMode, RaiseEvent, TestConnection, CallParameter, ServeFile, TakeFilesTurn,
                 ServeImaging, ServeImages, ReopenLine, RestartComputer, AcceptanceSent, LogLine>;

/// Why the counters of the uplink get a floor as soon as the time is valid.
enum class FloorWanted : std::uint8_t { no, first_start, counters_lost };

/// The spacecraft's end of the link: what telecommands cause, and what of the telemetry of all nodes goes to
/// the store and to the line. Inputs change it; settle() then says everything that is to be done, in its
/// order. Pure.
///
/// What always holds, whenever the process ends: a telecommand is executed only after its record is on the
/// disk (or it is a recovery command), its end is reported only after that is on the disk (while the disk
/// works), and the control word acknowledges a frame only when what it left is.
class TtcCore {
 public:
  using Actions = std::vector<TtcAction>;
  static constexpr std::size_t read_octets = 512;  ///< of the line at most, for one on_octets()

  struct UnusableKey {
    std::uint16_t spi = 0;
    std::uint8_t vc = 0;
    std::string why;
  };
  struct UnusableMaster {
    std::uint16_t id = 0;
    std::string why;
  };
  struct KeyNews {
    std::uint8_t vc = 0;
    KeySet set = KeySet::a;
    std::string why;
  };
  /// What outlives a clean-up of the node.
  struct Remembered {
    bool journal_durable = true;  ///< the journal reaches the disk in time
    bool stores_work = true;
    bool files_work = true;
    std::uint64_t unstored_packets = 0;
    std::uint64_t foreign_samples = 0;  ///< ticks, telemetry and reports that cannot be what they say
  };
  /// What the start found.
  struct Setup {
    const mission::Dictionary& dictionary;  ///< outlives it; its content may be replaced
    std::string node;                       ///< name of this one
    AcceptanceJournal journal;
    UplinkConfig uplink;
    DownlinkConfig downlink;
    std::optional<wire::TmSeal> seal{};  ///< of all frames; nullopt: they have no security
    ModeManager mode;
    TransmitterSwitch transmitter;
    CommandLossTimer command_loss;
    std::string stores;  ///< StoreControl::stored_text()
    FoundTable monitors{};
    FoundTable event_actions{};
    KeySelection keys;
    wire::SessionKeys session_keys{};  ///< @p uplink has them already
    std::vector<KeyEncryptionKey> masters{};
    std::vector<UnusableMaster> unusable_masters{};
    std::string session_keys_lost{};  ///< what is accepted now; empty: they are not
    BootTold boot;
    suite::StepRecord step{};  ///< of the start
    SpacecraftClock clock;
    milliseconds persist_deadline{1000};
    milliseconds schedule_late_max{60'000};
    milliseconds arm_window{30'000};
    seconds lifetime{0};  ///< of a telecommand on a strict link; 0: no end
    FloorWanted floor = FloorWanted::no;
    bool first_start = false;
    std::string journal_damage{};  ///< what it means; empty: none
    std::size_t journal_damaged_octets = 0;
    std::uint64_t copied_generation = 0;  ///< of the link state in its second home
    std::vector<UnusableKey> unusable_keys{};
    std::vector<KeyNews> key_news{};  ///< of the start
    Remembered remembered{};
    ImageLane lane{};
    suite::ModeSettings modes{};
    MonotonicTime begun{};
  };
  explicit TtcCore(Setup setup);
  TtcCore(const TtcCore&) = delete;
  TtcCore& operator=(const TtcCore&) = delete;

  /// What was accepted and has not ended goes on; what may not have reached the ground is reported again.
  void restore(MonotonicTime now);
  /// The node becomes Active: what the start found is reported.
  void activate(MonotonicTime now);
  /// Packets that no commit had.
  [[nodiscard]] std::vector<StoreItem> take_unstored() { return std::exchange(to_store_, {}); }
  /// Before an orderly end: the rest of the journal, synced.
  void flush_journal(MonotonicTime now);

  /// Everything that is to be done after the inputs so far.
  [[nodiscard]] Actions settle(MonotonicTime now);
  /// The same without going on: what inputs of a node that is not Active want done.
  [[nodiscard]] Actions take_actions() { return std::exchange(actions_, {}); }
  /// When settle() has something without another input; nullopt: nothing has.
  [[nodiscard]] std::optional<MonotonicTime> next_due(MonotonicTime now) const;
  void on_deadline(MonotonicTime now);

  // ---- line
  void on_octets(OctetView octets, MonotonicTime now);
  /// The line was found empty.
  void on_line_idle(MonotonicTime now);
  /// The next CADU, if one is due and the transmitter may be on. It counts as sent.
  [[nodiscard]] std::optional<Octets> next_cadu(MonotonicTime now);
  [[nodiscard]] wire::TmFrameCounts frame_counts() const { return downlink_.frame_counts(); }
  /// FrameNumbers::next(); nullopt: frames have no numbers.
  [[nodiscard]] std::optional<std::uint64_t> next_frame_number() const {
    return downlink_.sealed() ? std::optional(downlink_.numbers().next()) : std::nullopt;
  }
  /// To be stored before the first frame.
  [[nodiscard]] wire::TmFrameCounts reserved_counts() {
    return frame_count_reserve_.wanted(downlink_.frame_counts()).value();
  }
  /// To be called before and after next_cadu()s: fills the channels of playback and files.
  void fill_downlink(MonotonicTime now);
  [[nodiscard]] bool wants_playback() const {
    return retrieval_.busy() && downlink_.empty(DownlinkChannel::playback);
  }

  // ---- answers of the disk
  void on_journal_written(const JournalBatch& batch, const Result<void, FileError>& written,
                          std::size_t used_octets, MonotonicTime now);
  void on_state_written(const StateChange& change, bool stored);
  void on_keys_written(const KeyChange& change, bool stored, MonotonicTime now);
  void on_session_keys_written(const SessionKeyChange& change, bool stored, MonotonicTime now);
  void on_rescue_entry_written(const RescueEntry& entry, bool stored);
  void on_table_written(const std::string& name, const TableChange& change, bool stored);
  void on_committed(const CommitStores& commit, const PacketStoresStatus& status,
                    const Result<void, FileError>& counts);
  void on_commit_refused(CommitStores commit);
  void on_store_read(const ReadStore& read, std::optional<RetrievedPackets> packets, MonotonicTime now);
  void on_read_refused(ReadStore read);
  void on_file_outcome(const FileOutcome& outcome, MonotonicTime now);
  void on_file_refused(MonotonicTime now) { file_service_.on_refused(now); }
  void on_files_turn(Result<cfdp::TransferTurnResult, std::string>& result, MonotonicTime now);
  void on_files_turn_refused(MonotonicTime now) { files_.on_turn_refused(now); }
  void on_imaging_job(const ImagingOrder& order, const ImagingOutcome& outcome);

  // ---- other nodes
  /// @return the time it gives is to be told the ground at once: by a beacon
  bool on_tick(const ReceivedTick& tick, std::uint64_t cycle, MonotonicTime now);
  /// @return whether something is to be sent, as on_event()
  bool on_telemetry(const std::string& node, std::uint16_t apid, std::uint16_t structure_id, OctetView data,
                    MonotonicTime now);
  bool on_event(const std::string& node, std::uint16_t event_id, std::uint8_t severity, OctetView data,
                MonotonicTime now);
  void on_telecommand_report(const std::string& from, const StageReached& report, MonotonicTime now) {
    forwarder_.on_report(from, report, now);
  }
  /// When the last telecommand that is with a node now has ended at the latest; nullopt: none is.
  [[nodiscard]] std::optional<MonotonicTime> latest_forwarded_end() const { return forwarder_.latest_end(); }
  void on_acceptance_sent(nanoseconds latency) { acceptance_latency_.add(latency); }
  void on_connection_answer(bool answered) { connections_.on_answer(answered); }
  [[nodiscard]] ParameterService& parameters() { return parameters_; }
  [[nodiscard]] ImagingScheduler& imaging() { return imaging_; }
  [[nodiscard]] BeaconBuilder& beacon() { return beacon_; }
  [[nodiscard]] HousekeepingScheduler& housekeeping() { return housekeeping_; }
  [[nodiscard]] EventReporter& events() { return events_; }
  /// What the structures and events of the dictionary are to the services 3 and 5.
  void add_reports();
  /// A structure of the dictionary that a node samples.
  [[nodiscard]] static bool is_sampled(const mission::Structure& structure);
  void add_structure(const mission::Structure& structure);
  /// The content of the dictionary was replaced.
  void on_dictionary_changed() {
    monitoring_.monitoring().resolve();
    event_actions_.check_again();
  }
  /// settle() has something to decide.
  [[nodiscard]] bool has_waiting_actions() const { return event_actions_.waiting() > 0; }
  void set_repeat_window(milliseconds window) { journal_.set_repeat_window(window); }
  void set_lifetime(seconds lifetime) { lifetime_ = lifetime; }
  // ---- mode
  void set_ignored_causes(std::vector<std::string> names) { causes_.set_ignored(std::move(names)); }
  void on_node_state(const std::string& node, bool active, MonotonicTime now) {
    causes_.on_node(node, active, now);
  }
  /// What the mode asks of ttc itself.
  [[nodiscard]] suite::ModeReaction reaction() const { return causes_.reaction(mode_.mode(), node_); }
  /// One report of mode, why, and what comes next.
  void send_health(MonotonicTime now);
  /// Beside each health.
  void send_boot_step(MonotonicTime now);
  void set_command_loss(seconds patience) { command_loss_.set_patience(patience); }

  // ---- periodic
  void commit_stores(bool line_empty, MonotonicTime now);
  void copy_link_state();
  /// Open retrieval's place, now and then.
  void store_open_progress();
  void publish_mode();
  void send_beacon(std::uint8_t farm_channel, MonotonicTime now);
  /// Counts of the adapter.
  struct AdapterCounters {
    std::uint64_t suppressed_events = 0;
    std::uint64_t publish_drops = 0;
    std::uint64_t malformed_samples = 0;
    std::uint64_t lost_frames = 0;  ///< sent while the line was gone
  };
  void send_own_housekeeping(const AdapterCounters& adapter, MonotonicTime now);
  void send_files_housekeeping(MonotonicTime now);
  void send_schedule_housekeeping(MonotonicTime now);
  void send_imaging_housekeeping(MonotonicTime now);
  void send_monitoring_housekeeping(MonotonicTime now);
  template <class Structure>
  void send_housekeeping(const Structure& h, MonotonicTime now) {
    send_sample(h.apid, h.structure_id, h.encoded(), now);
  }

  // ---- what others want to know
  [[nodiscard]] const std::string& node() const { return node_; }
  [[nodiscard]] const AcceptanceJournal& journal() const { return journal_; }
  [[nodiscard]] const Remembered& remembered() const { return remembered_; }
  [[nodiscard]] bool waits_for_time() const { return !schedule_.schedule().empty() || imaging_.tasks() > 0; }

 private:
  void act(TtcAction action) { actions_.push_back(std::move(action)); }
  template <class Event>
  void raise(const Event& event) {
    act(RaiseEvent{event.severity, event.event_id, event.encoded()});
  }
  /// An event that must not be held back by the rate limit of the event topic.
  template <class Event>
  void send_event(const Event& event) {
    if (const auto report = own_event(event.severity, event.event_id, event.encoded())) send(*report);
  }
  /// The same, after the ends that wait for the disk.
  template <class Event>
  void send_behind_ends(const Event& event) {
    if (auto report = own_event(event.severity, event.event_id, event.encoded()))
      gate_.hold(std::move(*report), journal_.revision(), now_);
  }
  [[nodiscard]] std::optional<Report> own_event(mission::EventSeverity severity, std::uint16_t event_id,
                                                OctetView data);

  // Uplink
  void take_uplinked(std::vector<UplinkedPacket> packets);
  void take_packet(UplinkedPacket packet);
  void tell_uplink_the_time();
  /// What was refused, for the disk and for the ground after a kill.
  void record_refusal(JudgedTelecommand& judged, const LinkState& link);
  /// @param sync_all also what need not be on disk before something is executed
  void persist_journal(bool sync_all = false);
  void execute_passed();
  void send_released();
  void note_journal_late();
  /// What was reported since the last call goes into the journal.
  void record_progress();
  void raise_counters();
  void report_counters(std::uint64_t floor, const std::string& why);
  // Schedule
  void run_schedule();
  /// @return false: no room for it now
  bool release(const ScheduledActivity& activity);
  void fill_next_scheduled(BeaconInputs& inputs) const;
  // Monitoring and event-action
  void monitor(std::uint16_t structure_id, OctetView data);
  void run_monitoring();
  void report_transitions();
  /// @param id  of an event of a monitor; 0: none
  void send_monitor_event(std::uint16_t id, OctetView content);
  void run_event_actions();
  /// @return false: no room for it now
  bool release_action(const EventActionService::Due& due);
  void settle_action(const JudgedTelecommand& judged);
  /// A telecommand under way orders the same function, or request, with other arguments.
  void report_contradiction(const EventActionService::Due& due, const Telecommand& released);
  /// Why a telecommand cannot be an action; nullopt: it can.
  [[nodiscard]] std::optional<std::uint16_t> why_no_action(OctetView packet) const;
  void store_tables();
  void report_damaged_tables();
  // Command loss
  void on_contact();
  void run_command_loss();
  /// A change of mode by no telecommand.
  void change_mode(MissionMode mode, ModeWhy why);
  void run_mode_causes();
  void on_mode_changed();
  [[nodiscard]] std::optional<UtcTime> valid_utc() const;
  [[nodiscard]] std::optional<std::uint32_t> mode_since_s() const;
  void fall_back_keys();
  // Services
  void serve_files();
  void ask_nodes();
  void test_connection();
  void begin_imaging_tasks();
  void carry_out_imaging_orders();
  void run_imaging_job();
  template <class Change>
  void write_state(const char* name, Change change) {
    std::string text = change.stored_text;
    act(WriteState{name, std::move(text), std::move(change)});
  }
  void store_mode_change();
  void store_key_change();
  void store_session_keys();
  void follow_confirmed_keys();
  void store_transmitter_change();
  void store_rescue_entry();
  void store_stores_change();
  void end_silence();
  // Reports
  void send_reports(const std::vector<Report>& reports, std::optional<MonotonicTime> received);
  void send(const Report& report);
  void send_sample(std::uint16_t apid, std::uint16_t structure_id, OctetView data, MonotonicTime now);
  void send_time_report();
  void report_rejections();
  void report_hazards();
  void report_refused_frames();
  void report_keys_at_start();
  void report_keys(std::uint8_t vc, KeySet set, const std::string& why);
  void report_rekeyed(std::uint16_t spi, std::uint16_t key, const std::string& why);
  void tell_of_file(const cfdp::News& news);
  void feed_playback();
  /// What files may take of the downlink: room in its queue, and in the mode's budget.
  [[nodiscard]] FilesRoom files_room(MonotonicTime now) const;
  void fill_files();
  /// Of a commit or batch that its worker did not take: they go first.
  void take_back(std::vector<StoreItem> items);
  void on_store_status(const PacketStoresStatus& status);
  /// @param known what was known before; only a change is reported
  /// @param what of the storage, for people
  void note_storage(bool& known, bool works, const std::string& why, const std::string& what);
  void log(LogLine::Level level, std::string text) { act(LogLine{level, std::move(text)}); }
  [[nodiscard]] ImagingTime imaging_time(MonotonicTime now) const;
  void add_link_counters(mission::TtcHousekeeping& h) const;
  void add_store_counters(mission::TtcHousekeeping& h) const;
  void add_latency(mission::TtcHousekeeping& h) const;

  const mission::Dictionary& dictionary_;
  std::string node_;
  MonotonicTime now_;  ///< of the input
  Actions actions_;

  AcceptanceJournal journal_;
  ReportQueue report_queue_;
  ModeManager mode_;
  ModeCauses causes_;
  ModeObedience obedience_;
  TransmitterSwitch transmitter_;
  CommandLossTimer command_loss_;
  HazardGuard hazards_;
  AvailableKeySets key_sets_;
  CommandForwarder forwarder_;
  // The services of ttc itself
  HousekeepingScheduler housekeeping_;
  EventReporter events_;
  ModeService mode_service_;
  ArmingService arming_;
  KeyService key_service_;
  KeyManagementService key_management_;
  RescueService rescue_service_;
  TransmitterService transmitter_service_;
  TimeReporter time_reports_;
  ScheduleService schedule_;
  PacketRetrieval retrieval_;
  StoreControl stores_;
  ConnectionTester connections_;
  ParameterService parameters_;
  FileService file_service_;
  ImagingScheduler imaging_;
  MonitoringService monitoring_;
  EventActionService event_actions_;
  TelecommandRouter router_;
  UplinkChain uplink_;
  PersistenceGate gate_;
  DownlinkScheduler downlink_;
  DownlinkBudget budget_;
  FileExchange files_;
  BeaconBuilder beacon_;
  PacketMaker packets_;
  SpacecraftClock clock_;
  Remembered remembered_;
  LatencyHistogram acceptance_latency_;  ///< last octet read to 1,1 handed to the framer

  std::vector<StoreItem> to_store_;  ///< since the last commit, bounded
  PacketStoresStatus store_status_;
  bool commit_running_ = false;
  int commits_missed_ = 0;
  FrameCountReserve frame_count_reserve_;
  bool frame_counts_stored_ = true;  ///< the last time they were written; only a change is reported
  mission::TtcFilesHousekeeping files_status_;  ///< as of the last turn
  std::uint64_t copied_generation_ = 0;         ///< of the link state in its second home
  std::size_t journal_damaged_octets_ = 0;
  std::string journal_damage_;
  BootTold boot_;
  suite::StepRecord step_;
  MonotonicTime begun_;
  std::uint64_t cycle_ = 0;
  bool first_start_ = false;
  FloorWanted floor_wanted_ = FloorWanted::no;
  seconds lifetime_{0};
  RefusedFrames refused_frames_;
  /// Of the link state with their floor, until it is stored.
  std::optional<std::uint64_t> raised_generation_;
  KeySelection key_selection_;
  std::vector<UnusableKey> unusable_keys_;  ///< their associations are left out
  std::vector<KeyNews> key_news_;           ///< of the start, to be reported
  std::vector<UnusableMaster> unusable_masters_;
  std::string session_keys_lost_;                 ///< of the start, to be reported
  std::vector<std::string_view> damaged_tables_;  ///< of the start, to be reported
  std::deque<ImagingOrder> imaging_jobs_;         ///< for the disk; a few for each task
  bool imaging_job_runs_ = false;
};

}  // namespace srfs
