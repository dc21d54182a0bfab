// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <lifecycle_msgs/srv/get_state.hpp>
#include <rcl_interfaces/srv/get_parameters.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>

#include <srfs_msgs/action/capture_image.hpp>
#include <srfs_msgs/action/process_image.hpp>

#include "base/action_queue.hpp"
#include "hw/open.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/command/journal_file.hpp"
#include "nodes/ttc/files/file_manager.hpp"
#include "nodes/ttc/link/frame_count_page.hpp"
#include "nodes/ttc/link/link_state_file.hpp"
#include "nodes/ttc/ttc_core.hpp"
#include "suite/node.hpp"

namespace srfs {

/// The spacecraft's end of the link: telecommands go from the RS422 line to the nodes, telemetry of all nodes
/// to the store and to the line. TtcCore decides; this class feeds it and carries out what it wants done.
class TtcNode : public suite::Node {
 public:
  explicit TtcNode(suite::NodeContext& context);
  void on_deployment_changed() override;

 protected:
  ros::CallbackReturn on_configure() override;
  ros::CallbackReturn on_activate() override;
  ros::CallbackReturn on_deactivate() override;
  ros::CallbackReturn on_cleanup() override;
  ros::CallbackReturn on_shutdown() override;
  ros::CallbackReturn on_error() override;

 private:
  // Set-up (ttc_setup.cpp)
  [[nodiscard]] TtcCore::Setup look_at_the_disk(UplinkConfig channels, DownlinkConfig downlink);
  void load_journal(TtcCore::Setup& setup, bool ran);
  [[nodiscard]] wire::TmFrameCounts open_frame_counts();
  void open_files();
  void fill_from_dictionary();
  void subscribe();
  void start_periods();
  void store_rest();

  // Inputs and outputs
  /// Carries out what the inputs so far have caused, then sends.
  void advance();
  /// @return false: an outer call carries them out
  bool run(TtcCore::Actions actions);
  void pump_downlink();
  bool write_outgoing();
  /// @return whether the line was found empty; false: more may wait
  bool read_line();
  void arm_timer(MonotonicTime at);
  void publish_telemetry(const srfs_msgs::msg::PayloadTelemetry& sample) override;
  void on_tick(const srfs_msgs::msg::TimeTick& tick);
  void on_telemetry(const srfs_msgs::msg::PayloadTelemetry& message);
  void on_telecommand_report(const srfs_msgs::msg::TelecommandReport& message);
  void send_own_housekeeping();
  void send_beacon();
  void look_at_nodes();
  void ask_for_state(const std::string& node);
  void look_at_imaging_nodes();

  void carry_out(const WriteJournal& action);
  void carry_out(const WriteState& action);
  void carry_out(const WriteKeys& action);
  void carry_out(const CopyLinkState& action);
  void carry_out(const ForgetWantedFloor& action);
  void carry_out(const CommitStores& action);
  void carry_out(const ReadStore& action);
  void carry_out(const PublishTelecommand& action);
  void carry_out(const PublishMode& action);
  void carry_out(const RaiseEvent& action);
  void carry_out(const TestConnection& action);
  void carry_out(const CallParameter& action);
  void carry_out(const ServeFile& action);
  void carry_out(const TakeFilesTurn& action);
  void carry_out(const ServeImaging& action);
  void carry_out(const ServeImages& action);
  void carry_out(const AcceptanceSent& action);
  void carry_out(const LogLine& action);

  // Goals of the imaging nodes (ttc_imaging.cpp)
  template <class A>
  struct ImageGoals {
    std::shared_ptr<ros::ActionClient<A>> client;
    std::map<std::uint64_t, std::shared_ptr<ros::ClientGoal<A>>> under_way;  ///< by telecommand
  };
  template <class A>
  void send_image_goal(ImageGoals<A>& goals, ImageServer server, std::uint64_t id,
                       const typename A::Goal& goal);
  template <class A>
  void serve(ImageGoals<A>& goals, const ImagingOrder& order);

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
  void send_added_nodes();

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
    MonotonicTime until;
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
  std::unique_ptr<TtcCore> core_;         ///< from configure to cleanup
  ActionQueue<TtcAction> actions_;
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

  std::optional<FrameCountPage> frame_counts_;
  std::shared_ptr<FrameCountFile> frame_count_file_;  ///< used on the worker of the stores
  Octets outgoing_;                                   ///< of a CADU the line did not take whole
  std::uint64_t lost_frames_ = 0;                     ///< sent while the line was gone
  std::uint64_t next_telecommand_id_ = 0;             ///< after the last clean-up, 0: none yet
  TtcCore::Remembered remembered_;

  std::shared_ptr<ros::Publisher<srfs_msgs::msg::Telecommand>> telecommands_;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::SystemMode>> mode_publisher_;
  std::vector<std::shared_ptr<void>> subscriptions_;
  std::map<std::string, std::shared_ptr<ros::Client<lifecycle_msgs::srv::GetState>>> state_clients_;
  std::map<std::string, std::shared_ptr<ros::Client<lifecycle_msgs::srv::GetState>>> connection_clients_;
  std::map<std::string, std::shared_ptr<ros::Client<rcl_interfaces::srv::GetParameters>>> get_clients_;
  std::map<std::string, std::shared_ptr<ros::Client<rcl_interfaces::srv::SetParameters>>> set_clients_;
  ImageGoals<srfs_msgs::action::CaptureImage> capture_goals_;
  ImageGoals<srfs_msgs::action::ProcessImage> process_goals_;
  std::vector<std::string> answered_;  ///< nodes whose client has done its work
  std::vector<ros::Timer> timers_;
  ros::Timer housekeeping_timer_;
  ros::Timer beacon_timer_;
  ros::Timer wake_up_;
  std::optional<MonotonicTime> wake_up_at_;
  ros::Executor::Handle line_watch_;
};

}  // namespace srfs
