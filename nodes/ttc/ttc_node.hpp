// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <lifecycle_msgs/msg/transition_event.hpp>
#include <lifecycle_msgs/srv/change_state.hpp>
#include <lifecycle_msgs/srv/get_state.hpp>
#include <rcl_interfaces/srv/get_parameters.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>

#include "base/action_queue.hpp"
#include "hw/open.hpp"
#include "nodes/ttc/added_nodes.hpp"
#include "nodes/ttc/link/frame_count_page.hpp"
#include "nodes/ttc/ttc_core.hpp"
#include "nodes/ttc/ttc_disk.hpp"
#include "nodes/ttc/ttc_imaging.hpp"
#include "suite/commanding/command_authority.hpp"
#include "suite/node.hpp"

namespace srfs {

/// The added nodes of a deployment.
[[nodiscard]] AddedNodes::List list_of(const suite::Deployment& deployment);

/// The spacecraft's end of the link: telecommands go from the RS422 line to the nodes, telemetry of all nodes
/// to the store and to the line. TtcCore decides; this class feeds it and carries out what it wants done.
class TtcNode : public suite::Node {
 public:
  explicit TtcNode(suite::NodeContext& context);
  void on_deployment_changed() override;
  /// It says which mode it is.
  [[nodiscard]] bool follows_mode() const override { return false; }

 protected:
  ros::CallbackReturn on_configure() override;
  ros::CallbackReturn on_activate() override;
  ros::CallbackReturn on_deactivate() override;
  ros::CallbackReturn on_cleanup() override;
  ros::CallbackReturn on_shutdown() override;
  ros::CallbackReturn on_error() override;

 private:
  // Set-up (ttc_setup.cpp)
  [[nodiscard]] TtcCore::Setup read_setup(TtcDisk::Parts& parts, UplinkConfig channels,
                                          DownlinkConfig downlink);
  void subscribe();
  [[nodiscard]] std::vector<std::shared_ptr<void>> listen_to(const std::string& node);
  void start_periods();
  void watch_line();

  // Inputs and outputs
  /// Carries out what the inputs so far have caused, then sends.
  void advance();
  /// @return false: an outer call carries them out
  bool run(TtcCore::Actions actions);
  void pump_downlink();
  void note_frame();
  bool write_outgoing();
  /// @return whether the line was found empty; false: more may wait
  bool read_line();
  void arm_timer(MonotonicTime at);
  void publish_telemetry(const srfs_msgs::msg::PayloadTelemetry& sample) override;
  void on_tick(const srfs_msgs::msg::TimeTick& tick);
  void on_telemetry(const srfs_msgs::msg::PayloadTelemetry& message);
  void on_telecommand_report(const srfs_msgs::msg::TelecommandReport& message);
  void reject(const srfs_msgs::msg::TelecommandReport& message);
  void send_own_housekeeping();
  void send_beacon();
  void look_at_nodes();
  void on_node_state(const std::string& node, std::uint8_t state);
  void ask_for_state(const std::string& node);

  // What is neither for the disk nor a goal
  void carry_out(const PublishTelecommand& action);
  void carry_out(const PublishMode& action);
  void carry_out(const FollowMode& action);
  void carry_out(const RaiseEvent& action);
  void carry_out(const TestConnection& action);
  void carry_out(const CallParameter& action);
  void carry_out(const ReopenLine& action);
  void carry_out(const RestartComputer& action);
  void carry_out(const AcceptanceSent& action);
  void carry_out(const LogLine& action);

  // Added nodes
  /// Reads the dictionary anew on a worker, if the list is another one.
  void load_dictionary();
  [[nodiscard]] ImageLane image_lane() const;
  /// Listens to those of the list. @param tell whether to report new ones
  void follow_added_nodes(bool tell);
  void raise_added_events();

  AddedNodes added_;
  /// Of the added nodes.
  std::map<std::string, std::vector<std::shared_ptr<void>>> added_subscriptions_;
  std::unique_ptr<TtcCore> core_;  ///< from configure to cleanup, as the next
  std::unique_ptr<TtcDisk> disk_;
  std::unique_ptr<ImagingGoals> imaging_goals_;
  ActionQueue<TtcAction> actions_;
  std::unique_ptr<hw::SerialPort> line_;

  std::optional<FrameCountPage> frame_counts_;
  Octets outgoing_;                        ///< of a CADU the line did not take whole
  std::uint64_t lost_frames_ = 0;          ///< sent while the line was gone
  std::uint64_t next_telecommand_id_ = 0;  ///< after the last clean-up, 0: none yet
  TtcCore::Remembered remembered_;

  std::optional<CommandSigner> signer_;  ///< as long as the next
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::Telecommand>> telecommands_;
  RejectionLog rejected_reports_;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::SystemMode>> mode_publisher_;
  std::vector<std::shared_ptr<void>> subscriptions_;
  std::map<std::string, std::shared_ptr<ros::Client<lifecycle_msgs::srv::GetState>>> state_clients_;
  std::map<std::string, std::shared_ptr<ros::Client<lifecycle_msgs::srv::GetState>>> connection_clients_;
  std::map<std::string, std::shared_ptr<ros::Client<rcl_interfaces::srv::GetParameters>>> get_clients_;
  std::map<std::string, std::shared_ptr<ros::Client<rcl_interfaces::srv::SetParameters>>> set_clients_;
  std::shared_ptr<ros::Client<lifecycle_msgs::srv::ChangeState>> restart_client_;
  std::vector<std::string> answered_;  ///< nodes whose client has done its work
  std::vector<ros::Timer> timers_;
  ros::Timer housekeeping_timer_;
  ros::Timer beacon_timer_;
  ros::Timer wake_up_;
  std::optional<MonotonicTime> wake_up_at_;
  ros::Executor::Handle line_watch_;
};

}  // namespace srfs
