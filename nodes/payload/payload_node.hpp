// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>

#include "base/action_queue.hpp"
#include "base/bounded_queue.hpp"
#include "hw/can_bus.hpp"
#include "hw/gpio.hpp"
#include "nodes/payload/flag_check.hpp"
#include "nodes/payload/mode_orders.hpp"
#include "nodes/payload/payload_cycle.hpp"
#include "nodes/payload/payload_profile.hpp"
#include "nodes/payload/peripheral_link.hpp"
#include "nodes/payload/sensor_inputs.hpp"
#include "suite/commanding/command_authority.hpp"
#include "suite/mission_time.hpp"
#include "suite/node.hpp"

namespace srfs {

/// The adapter of every payload node: topics, CAN, GPIO and disk around PayloadCycle (README.md).
class PayloadNode : public suite::Node {
 public:
  PayloadNode(suite::NodeContext& context, std::unique_ptr<PayloadProfile> profile);

  [[nodiscard]] bool is_at_rest() const override { return !cycle_ || !cycle_->holds_bus(); }
  /// The cycle's deadline that has passed: a slot to begin or to end, an answer to give up.
  [[nodiscard]] suite::WorkStatus work_status() const override;
  void on_mode_changed() override;

 protected:
  ros::CallbackReturn on_configure() override;
  ros::CallbackReturn on_activate() override;
  ros::CallbackReturn on_deactivate() override;
  ros::CallbackReturn on_cleanup() override;
  ros::CallbackReturn on_shutdown() override;
  ros::CallbackReturn on_error() override;

 private:
  void declare_parameters();
  [[nodiscard]] PayloadSettings settings() const;
  /// @return false: the parameter names a line that is no input
  bool assign_inputs();
  bool open_devices();
  void open_topics();
  void restore();
  // The mode's orders for the peripheral. The dictionary is read on a worker, when the first are needed.
  void hold_to_mode();
  void resolve_mode_orders();
  void retry_mode_orders();
  void give_orders();
  [[nodiscard]] std::filesystem::path once_done_file() const;
  void raise_order_failed(const std::string& order, const std::string& why);
  /// Number of the change of mode whose orders that count once are done.
  void remember_once_done(std::optional<std::uint32_t> change);
  /// As kept_off_text() has it while the peripheral is kept off.
  [[nodiscard]] std::filesystem::path kept_off_mark() const;
  /// On tmpfs: the disk may have failed. Another boot ends what was pending in any case.
  [[nodiscard]] std::filesystem::path ids_lost_mark() const;
  void close();

  // Input
  [[nodiscard]] bool is_plausible(const srfs_msgs::msg::TaskFlags& flags);
  void on_flags(const srfs_msgs::msg::TaskFlags& flags, const ros::MessageInfo& info);
  void on_telecommand(const srfs_msgs::msg::Telecommand& telecommand);
  void on_can_input();
  void on_can_frame(const hw::CanFrame& frame);
  void on_timer();
  void pump();
  void take_outcomes();
  void check_quiet();

  // Output
  void run(PayloadActions actions);
  void arm_timer();
  void carry_out(const PublishStatus& action);
  void carry_out(const OpenBus& action);
  void carry_out(const CloseBus& action);
  void carry_out(const SendRequest& action);
  void carry_out(const AbortRequest& action);
  void carry_out(const AwaitQuiet& action);
  void carry_out(const ProcessMeasurement& action);
  void carry_out(const CommandDone& action);
  void carry_out(const WriteTelecommands& action);
  void carry_out(const SwitchPower& action);
  void carry_out(const WithdrawFrames& action);
  void carry_out(const RememberKeptOff& action);
  void carry_out(const RememberIdsLost& action);
  void carry_out(const PayloadEvent& action);
  void carry_out(const OrdersObeyed& action);
  void carry_out(const OrderRefused& action);
  void carry_out(const StageReport& action);
  void carry_out(const Activity& action);
  void write_journal();
  void publish_processed(const Processed& processed, MissionCycle cycle, MonotonicTime measured);
  void publish_counters();
  /// Load, slot use and the controller, since the packet before.
  void add_bus_statistics(mission::PayloadCounters& c);
  void read_inputs();
  void publish_structure(std::uint16_t structure_id, Octets data, MissionCycle cycle, MonotonicTime at);
  void flush_reports();
  void say_goodbye();

  std::unique_ptr<PayloadProfile> profile_;
  suite::Peripheral peripheral_;  ///< as the deployment places it
  std::unique_ptr<hw::CanBus> can_;
  std::unique_ptr<hw::LeasedCanBus> leased_;
  std::unique_ptr<hw::GpioLines> gpio_;  ///< used on the gpio worker alone
  ros::Executor::Handle can_watch_;
  std::shared_ptr<ros::Worker> process_worker_;
  std::shared_ptr<ros::Worker> store_worker_;
  std::shared_ptr<ros::Worker> gpio_worker_;

  std::shared_ptr<ros::Publisher<srfs_msgs::msg::BusStatus>> statuses_;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::PayloadActivity>> activities_;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::TelecommandReport>> reports_;
  std::optional<CommandAuthority> authority_;  ///< as long as the topics are open
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::TaskFlags>> flags_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::PeripheralReset>> resets_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::Telecommand>> telecommands_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::TimeTick>> ticks_;

  std::optional<PayloadCycle> cycle_;
  std::unique_ptr<PeripheralLink> link_;
  std::optional<ModeOrders> mode_orders_;
  bool resolving_orders_ = false;
  ros::Timer orders_retry_;
  OnceDone once_done_;
  suite::MissionTime time_;
  ActionQueue<PayloadAction> actions_;
  ros::Timer timer_;
  std::optional<MonotonicTime> armed_;
  std::uint64_t grant_ = 0;
  bool awaiting_quiet_ = false;
  std::uint32_t frames_sent_ = 0;      ///< in this slot
  std::uint32_t frames_received_ = 0;  ///< in this slot
  std::uint32_t frames_outside_slot_ = 0;
  std::uint64_t bits_ = 0;           ///< on the bus, of our exchange with the peripheral
  std::uint64_t bus_offs_seen_ = 0;  ///< reported to a running request

  struct Reported {
    MonotonicTime at;
    std::uint64_t bits = 0;
    nanoseconds used{0};
    nanoseconds granted{0};
  };
  Reported reported_;  ///< with the last packet of counters

  std::uint64_t implausible_flags_ = 0;
  FlagCheck flag_check_;
  bool journal_writing_ = false;
  std::uint64_t journal_wanted_ = 0;
  /// Reports that still had no listener; the oldest is dropped (ttc asks again by repeating the telecommand).
  BoundedQueue<srfs_msgs::msg::TelecommandReport> unheard_{64, Overflow::drop_oldest};
  ros::Timer report_timer_;
  ros::Timer counter_timer_;
  std::vector<std::uint8_t> input_lines_;
  std::optional<SensorInputs> inputs_;
  bool reading_inputs_ = false;
  ros::Timer input_timer_;
  std::uint32_t measurements_dropped_ = 0;
};

/// A payload node with its profile, as run_node wants it.
template <class Profile>
class PayloadNodeOf : public PayloadNode {
 public:
  explicit PayloadNodeOf(suite::NodeContext& context) : PayloadNode(context, std::make_unique<Profile>()) {}
};

}  // namespace srfs
