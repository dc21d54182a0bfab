// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <lifecycle_msgs/msg/transition_event.hpp>
#include <lifecycle_msgs/srv/get_state.hpp>
#include <rcl_interfaces/srv/get_parameters.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>

#include <mission/structures.hpp>
#include <srfs_msgs/action/capture_image.hpp>
#include <srfs_msgs/action/process_image.hpp>

#include "base/latency_histogram.hpp"
#include "hw/open.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/command/acceptance_journal.hpp"
#include "nodes/ttc/command/command_forwarder.hpp"
#include "nodes/ttc/command/journal_file.hpp"
#include "nodes/ttc/command/persistence_gate.hpp"
#include "nodes/ttc/command/telecommand_router.hpp"
#include "nodes/ttc/files/file_exchange.hpp"
#include "nodes/ttc/files/file_manager.hpp"
#include "nodes/ttc/files/file_service.hpp"
#include "nodes/ttc/imaging/image_outbox.hpp"
#include "nodes/ttc/imaging/imaging_scheduler.hpp"
#include "nodes/ttc/link/downlink_scheduler.hpp"
#include "nodes/ttc/link/frame_count_file.hpp"
#include "nodes/ttc/link/frame_count_page.hpp"
#include "nodes/ttc/link/link_state_file.hpp"
#include "nodes/ttc/link/packet_maker.hpp"
#include "nodes/ttc/link/uplink_chain.hpp"
#include "nodes/ttc/report/beacon_builder.hpp"
#include "nodes/ttc/report/event_reporter.hpp"
#include "nodes/ttc/report/report_queue.hpp"
#include "nodes/ttc/services/connection_tester.hpp"
#include "nodes/ttc/services/housekeeping_scheduler.hpp"
#include "nodes/ttc/services/mode_manager.hpp"
#include "nodes/ttc/services/own_functions.hpp"
#include "nodes/ttc/services/parameter_service.hpp"
#include "nodes/ttc/services/schedule_service.hpp"
#include "nodes/ttc/services/time_reporter.hpp"
#include "nodes/ttc/spacecraft_clock.hpp"
#include "nodes/ttc/store/packet_retrieval.hpp"
#include "nodes/ttc/store/packet_stores.hpp"
#include "nodes/ttc/store/store_control.hpp"
#include "ros/node.hpp"

namespace srfs {

/// What became of an imaging task's order to the disk.
struct ImagingOutcome {
  std::optional<std::vector<std::string>> frames;
  QueuedProducts products{.failure = mission::failure::disk_failed};  ///< queued, or taken out again
};

/// The spacecraft's end of the link: telecommands go from the RS422 line to the nodes, telemetry of all nodes
/// to the store and to the line. The classes above decide; this class feeds them and carries out their
/// decisions.
class TtcNode : public ros::LifecycleNode {
 public:
  explicit TtcNode(ros::NodeContext& context);
  void on_deployment_changed() override;

 protected:
  ros::CallbackReturn on_configure() override;
  ros::CallbackReturn on_activate() override;
  ros::CallbackReturn on_deactivate() override;
  ros::CallbackReturn on_cleanup() override;
  ros::CallbackReturn on_shutdown() override;
  ros::CallbackReturn on_error() override;

 private:
  /// What is there from configure to cleanup. Order matters: later members use earlier ones.
  struct Link {
    Link(const mission::Dictionary& dictionary, AcceptanceJournal restored, UplinkConfig uplink_config,
         DownlinkConfig downlink_config, ModeManager mode_manager, TransmitterSwitch transmitter_switch,
         std::string_view stored_stores, milliseconds persist_deadline, milliseconds schedule_late_max,
         milliseconds arm_window, SpacecraftClock start, const std::string& own_name);

    AcceptanceJournal journal;
    ReportQueue report_queue;
    ModeManager mode;
    TransmitterSwitch transmitter;
    HazardGuard hazards;
    AvailableKeySets key_sets;
    CommandForwarder forwarder;
    // The services of ttc itself
    HousekeepingScheduler housekeeping;
    EventReporter events;
    ModeService mode_service;
    ArmingService arming;
    KeyService key_service;
    TransmitterService transmitter_service;
    TimeReporter time_reports;
    ScheduleService schedule;
    PacketRetrieval retrieval;
    StoreControl stores;
    ConnectionTester connections;
    ParameterService parameters;
    FileService file_service;
    ImagingScheduler imaging;
    TelecommandRouter router;
    UplinkChain uplink;
    PersistenceGate gate;
    DownlinkScheduler downlink;
    FileExchange files;
    BeaconBuilder beacon;
    PacketMaker packets;
    SpacecraftClock clock;
    LatencyHistogram acceptance_latency;  ///< last octet read to 1,1 handed to the framer
  };

  // Set-up (ttc_setup.cpp)
  [[nodiscard]] Result<UplinkConfig, std::string> read_channels();
  [[nodiscard]] Result<wire::SdlsKey, std::string> read_key(const std::string& file) const;
  [[nodiscard]] Result<DownlinkConfig, std::string> read_downlink() const;
  [[nodiscard]] ModeManager load_mode(bool ran_before);
  [[nodiscard]] TransmitterSwitch load_transmitter() const;
  [[nodiscard]] std::string load_stores() const;
  [[nodiscard]] BootTold load_boot() const;
  [[nodiscard]] bool ran_before() const;
  /// @param nothing no state of the link was found. @param ran although there was one
  void note_missing_counters(bool nothing, bool ran);
  void report_counters(std::uint64_t floor, const std::string& why);
  void raise_counters();
  void forget_wanted_floor();
  /// @param ran something is left of an earlier start
  [[nodiscard]] AcceptanceJournal load_journal(bool ran);
  void restore_telecommands();
  void fill_from_dictionary();
  void subscribe();
  void say_how_the_link_is_secured() const;

  // Uplink
  /// @return whether the line was found empty; false: more may wait
  bool read_line();
  void take_uplinked(std::vector<UplinkedPacket> packets);
  void take_packet(UplinkedPacket packet, MonotonicTime received);
  /// @param sync_all also what need not be on disk before something is executed
  void persist_journal(bool sync_all = false);
  void on_journal_written(const JournalBatch& batch, const Result<void, FileError>& written,
                          std::size_t used_octets);
  /// What was reported since the last call goes into the journal.
  void record_progress();
  /// The second home of the counters, should the journal be damaged.
  void copy_link_state();
  void execute_passed();
  void send_released();
  /// What was refused, for the disk and for the ground after a kill.
  void record_refusal(JudgedTelecommand& judged, const LinkState& link);
  void report_findings();
  /// PUS 17 of other nodes: asks the next one.
  void test_connection();

  // Schedule (ttc_schedule.cpp)
  /// Releases what is due.
  void run_schedule();
  /// @return false: no room for it now
  bool release(const ScheduledActivity& activity, MonotonicTime at);
  void report_dropped();
  void fill_next_scheduled(BeaconInputs& inputs);
  void send_schedule_housekeeping();
  void send_time_report();

  // Outputs: everything the logic wants done after an input
  void settle();
  void publish_telecommands();
  void send_reports(const std::vector<Report>& reports, std::optional<MonotonicTime> received);
  void store_mode_change();
  /// Writes a file of the node's state on its worker. @param tell called with whether it is on the disk;
  /// here, at once, when the worker is full
  void write_state(const char* name, std::string text, std::function<void(bool)> tell);
  void publish_mode();
  void report_rejections();
  // Arming and keys (ttc_security.cpp)
  void report_hazards();
  /// Chooses the set of each channel: as it was stored, else one that can be used.
  void load_key_selection(UplinkConfig& config);
  /// @return the TM frame counters to go on with
  [[nodiscard]] wire::TmFrameCounts open_frame_counts();
  void on_frame_counts_stored(const wire::TmFrameCounts& counts, const Result<void, FileError>& stored);
  void store_key_change();
  void store_transmitter_change();
  // Packet stores (ttc_stores.cpp)
  void store_stores_change();
  /// Open retrieval's place, now and then.
  void store_open_progress();
  using BatchTaker =
      std::function<std::vector<Octets>(std::uint64_t request, std::optional<RetrievedPackets> read)>;
  /// Sends what @p take makes of the batch. @return false: the worker is full
  bool read_batch(const PacketRetrieval::Batch& batch, BatchTaker take);
  void end_silence();
  void report_keys_at_start();
  void report_keys(std::uint8_t vc, KeySet set, const std::string& why);
  void send(const Report& report, bool live, bool stored, bool urgent);
  void feed_playback();
  void pump_downlink();
  void pump_files();
  void on_files_turn(Result<cfdp::TransferTurnResult, std::string>& result);
  void tell_of_file(const cfdp::News& news);
  /// PUS 23 (ttc_files.cpp)
  void serve_files();
  /// PUS 20 (ttc_parameters.cpp)
  void ask_nodes();
  void ask_for_value(const ParameterCall& call);
  void set_value(const ParameterCall& call);
  /// Imaging (ttc_imaging.cpp)
  template <class A>
  struct ImageGoals {
    std::shared_ptr<ros::ActionClient<A>> client;
    std::map<std::uint64_t, std::shared_ptr<ros::ClientGoal<A>>> under_way;  ///< by telecommand
  };
  [[nodiscard]] ImagingTime imaging_time() const;
  void begin_imaging_tasks();
  void carry_out_imaging_orders();
  template <class A>
  void send_image_goal(ImageGoals<A>& goals, ImageServer server, std::uint64_t id,
                       const typename A::Goal& goal);
  void send_capture_goal(const ImagingOrder& order);
  void send_process_goal(const ImagingOrder& order);
  void cancel_image_goal(const ImagingOrder& order);
  void cancel_left_goals(ImageServer server);
  void run_imaging_job();
  void on_imaging_job(const ImagingOrder& order, const ImagingOutcome& outcome);
  void look_at_imaging_nodes();
  void connect_imaging();
  void disconnect_imaging();
  void send_imaging_housekeeping();
  bool write_outgoing();
  void arm_timer();

  // Added nodes (ttc_added_nodes.cpp)
  struct LoadedDictionary {
    std::optional<mission::Dictionary> dictionary;
    std::vector<mission::RefusedFragment> refused;
    std::string problem;  ///< nothing could be loaded
  };
  [[nodiscard]] std::vector<mission::Fragment> fragments() const;
  /// Reads the dictionary anew on a worker; what refers to the old one goes on with it.
  void load_dictionary();
  void take_dictionary(LoadedDictionary loaded);
  /// What the structures and events of the dictionary are to the services 3 and 5, in place of @p old's.
  void fill_from_dictionary_again(const mission::Dictionary& old);
  void add_structure(const mission::Structure& structure);
  void report_refused_fragments();
  void report_added_problems();
  /// Follows the list of added nodes. @param tell whether to report new ones
  void meet_added_nodes(bool tell);
  void listen_to(const std::string& node);
  void drop_retired_dictionaries();
  void send_added_nodes();

  // Inputs from other nodes
  void on_tick(const srfs_msgs::msg::TimeTick& tick);
  void publish_telemetry(const srfs_msgs::msg::PayloadTelemetry& sample) override;
  void on_telemetry(const srfs_msgs::msg::PayloadTelemetry& message);
  void on_event_message(const srfs_msgs::msg::Event& message);
  void on_telecommand_report(const srfs_msgs::msg::TelecommandReport& message);

  // Periodic work
  void start_periods();
  void on_parameter_changed(const std::string& parameter);
  void commit_stores();
  void on_store_status(const PacketStoresStatus& status);
  void send_own_housekeeping();
  void send_files_housekeeping();
  void add_link_counters(mission::TtcHousekeeping& h) const;
  void add_store_counters(mission::TtcHousekeeping& h) const;
  void add_latency(mission::TtcHousekeeping& h) const;
  void send_beacon();
  void look_at_nodes();
  void ask_for_state(const std::string& node);
  /// An event that must not be held back by the rate limit of the event topic.
  template <class Event>
  void send_event(const Event& event) {
    send_event(event.severity, event.event_id, event.encoded());
  }
  /// The same, after the ends that wait for the disk.
  template <class Event>
  void send_behind_ends(const Event& event) {
    send_behind_ends(event.severity, event.event_id, event.encoded());
  }
  void send_event(mission::EventSeverity severity, std::uint16_t event_id, const Octets& data);
  void send_behind_ends(mission::EventSeverity severity, std::uint16_t event_id, const Octets& data);
  /// @param known what was known before; only a change is reported
  /// @param what of the storage, for people
  void note_storage(bool& known, bool works, const std::string& why, const std::string& what);

  /// The folder of files, opened again after the disk failed. Used on its worker only.
  struct Files {
    std::filesystem::path root;
    std::filesystem::path checkpoint;
    std::uint64_t uplink_quota_octets = 0;
    std::uint64_t free_floor_octets = 0;
    std::unique_ptr<cfdp::TransferFolders> transfer_folders;
    std::optional<FileManager> manager;
    std::optional<ImageOutbox> images;
    [[nodiscard]] Result<cfdp::TransferTurnResult, std::string> take_turn(const cfdp::TransferTurn& turn);
    [[nodiscard]] FileOutcome serve(const FileOrder& order);
    [[nodiscard]] ImagingOutcome serve(const ImagingOrder& order);
    [[nodiscard]] Result<void, std::string> open();
  };

  std::vector<mission::RefusedFragment> refused_fragments_;  ///< to be reported
  mission::Dictionary dictionary_;
  struct RetiredDictionary {
    MonotonicTime since;
    std::unique_ptr<mission::Dictionary> dictionary;
  };
  std::vector<RetiredDictionary> retired_dictionaries_;  ///< commands under way may point into them
  std::uint32_t dictionary_revision_ = 0;                ///< of the list of added nodes it was read with
  bool dictionary_loads_ = false;
  struct JoinedNode {
    std::string name;
    std::uint16_t apid = 0;  ///< 0: none
    NodeFacts facts;
    std::optional<std::uint8_t> state;  ///< last reported
    std::vector<std::shared_ptr<void>> subscriptions;
  };
  std::vector<JoinedNode> joined_nodes_;  ///< the added ones of the deployment
  std::unique_ptr<Link> link_;
  std::unique_ptr<hw::SerialPort> line_;

  // Used on their worker threads only, one job at a time; shared so that a late job never outlives what it
  // uses.
  struct JournalOnDisk {
    explicit JournalOnDisk(std::filesystem::path path) : file(std::move(path)), log(file) {}
    JournalFile file;
    JournalLog log;
  };
  std::shared_ptr<JournalOnDisk> journal_file_;
  std::shared_ptr<LinkStateFile> link_file_;
  std::shared_ptr<PacketStores> stores_;
  std::shared_ptr<Files> files_;
  std::shared_ptr<ros::Worker> files_worker_;    ///< CFDP: files and their checkpoint
  std::shared_ptr<ros::Worker> journal_worker_;  ///< telecommands wait for it
  std::shared_ptr<ros::Worker> state_worker_;    ///< small synced writes: mode, copy of the link state
  std::shared_ptr<ros::Worker> store_worker_;    ///< packet stores

  std::vector<StoreItem> to_store_;  ///< since the last commit, bounded
  PacketStoresStatus store_status_;
  bool commit_running_ = false;
  int commits_missed_ = 0;
  std::optional<FrameCountPage> frame_counts_;
  std::shared_ptr<FrameCountFile> frame_count_file_;  ///< used on the worker of the stores
  FrameCountReserve frame_count_reserve_;
  bool frame_counts_stored_ = true;  ///< the last time they were written; only a change is reported
  Octets outgoing_;                  ///< of a CADU the line did not take whole
  std::uint64_t lost_frames_ = 0;    ///< sent while the line was gone
  std::uint64_t unstored_packets_ = 0;
  bool journal_durable_ = true;  ///< the journal reaches the disk in time
  MonotonicTime flags_written_;  ///< of FARM-1, without data
  bool stores_work_ = true;
  bool files_work_ = true;
  mission::TtcFilesHousekeeping files_status_;  ///< as of the last turn
  std::uint64_t foreign_samples_ = 0;           ///< ticks, telemetry and reports that cannot be what they say
  std::uint64_t next_telecommand_id_ = 0;       ///< after the last clean-up, 0: none yet
  std::uint64_t copied_generation_ = 0;         ///< of the link state in its second home
  std::size_t journal_damaged_octets_ = 0;
  std::string journal_damage_;  ///< what it means, to be reported; empty: none
  BootTold boot_{.count = 1, .cause = mission::ResetCause::unknown};
  std::uint64_t cycle_ = 0;
  bool first_start_ = false;  ///< to be reported
  /// Why the counters of the uplink get a floor as soon as the time is valid.
  enum class FloorWanted : std::uint8_t { no, first_start, counters_lost };
  FloorWanted floor_wanted_ = FloorWanted::no;
  std::optional<std::uint64_t>
      raised_generation_;  ///< of the link state with their floor, until it is stored
  KeySelection key_selection_;
  struct UnusableKey {
    std::uint16_t spi = 0;
    std::uint8_t vc = 0;
    std::string why;
  };
  std::vector<UnusableKey> unusable_keys_;  ///< their associations are left out
  struct KeyNews {
    std::uint8_t vc = 0;
    KeySet set = KeySet::a;
    std::string why;
  };
  std::vector<KeyNews> key_news_;                        ///< of the start, to be reported
  std::map<std::uint8_t, std::uint32_t> not_authentic_;  ///< per TC channel, for the event

  std::shared_ptr<ros::Publisher<srfs_msgs::msg::Telecommand>> telecommands_;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::SystemMode>> mode_publisher_;
  std::vector<std::shared_ptr<void>> subscriptions_;
  std::map<std::string, std::shared_ptr<ros::Client<lifecycle_msgs::srv::GetState>>> state_clients_;
  std::map<std::string, std::shared_ptr<ros::Client<lifecycle_msgs::srv::GetState>>> connection_clients_;
  std::map<std::string, std::shared_ptr<ros::Client<rcl_interfaces::srv::GetParameters>>> get_clients_;
  std::map<std::string, std::shared_ptr<ros::Client<rcl_interfaces::srv::SetParameters>>> set_clients_;
  ImageGoals<srfs_msgs::action::CaptureImage> capture_goals_;
  ImageGoals<srfs_msgs::action::ProcessImage> process_goals_;
  std::deque<ImagingOrder> imaging_jobs_;  ///< for the disk; a few for each task
  bool imaging_job_runs_ = false;
  std::vector<std::string> answered_;  ///< nodes whose client has done its work
  std::vector<ros::Timer> timers_;
  ros::Timer housekeeping_timer_;
  ros::Timer beacon_timer_;
  ros::Timer wake_up_;
  std::optional<MonotonicTime> wake_up_at_;
  ros::Executor::Handle line_watch_;
};

}  // namespace srfs
