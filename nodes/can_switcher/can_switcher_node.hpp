// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <vector>

#include "base/action_queue.hpp"
#include "base/latency_histogram.hpp"
#include "nodes/can_switcher/bus_listener.hpp"
#include "nodes/can_switcher/holder_fence.hpp"
#include "nodes/can_switcher/holder_record.hpp"
#include "nodes/can_switcher/power_cut.hpp"
#include "nodes/can_switcher/task_flag_rotation.hpp"
#include "nodes/can_switcher/tick_holdover.hpp"
#include "nodes/can_switcher/transmit_drain.hpp"
#include "suite/mission_time.hpp"
#include "suite/node.hpp"
#include "suite/ring/process_cpu.hpp"

namespace srfs {

/// On each tick grants the CAN bus to one payload (README.md).
class CanSwitcherNode : public suite::Node {
 public:
  explicit CanSwitcherNode(suite::NodeContext& context);
  /// The rotation's deadline that has passed.
  [[nodiscard]] suite::WorkStatus work_status() const override;
  [[nodiscard]] std::optional<mission::WorkThreadStructure> work_structure() const override;
  /// Payloads that were added get their slot from the next grant on, those that were removed lose it.
  void on_deployment_changed() override;

 protected:
  ros::CallbackReturn on_configure() override;
  ros::CallbackReturn on_activate() override;
  ros::CallbackReturn on_deactivate() override;
  ros::CallbackReturn on_cleanup() override;
  ros::CallbackReturn on_shutdown() override;
  ros::CallbackReturn on_error() override;

 private:
  void apply_parameters();
  /// The deployment's payloads in the order of their turns, or those of the parameter.
  [[nodiscard]] std::vector<std::string> turns() const;
  void take_plan();
  void place_peripherals();
  [[nodiscard]] const suite::Bus& bus() const { return deployment().bus_of(name()); }
  void on_tick(const srfs_msgs::msg::TimeTick& tick, MonotonicTime received);
  void run(HoldoverActions actions);
  void carry_out(const Beat& action);
  void carry_out(const ReportTicksMissing& action);
  void carry_out(const ReportTicksBack& action);
  void arm_substitute();
  void on_tick_missing();
  /// Timing is Inactive by command, or the suite is being stopped: then no tick is to be expected.
  [[nodiscard]] bool ticks_were_stopped() const;
  void on_bus_status(const srfs_msgs::msg::BusStatus& status);
  void on_deadline();
  void arm_deadline();
  void make_rotation();
  void open_topics();
  void open_bus();
  /// A grant that was not monitored since, judged by the process that runs now.
  [[nodiscard]] std::optional<InheritedGrant> inherited(
      const std::optional<HolderRecord::Holder>& holder) const;
  /// After each change of the rotation, and before a flag goes out.
  void record_holder();
  void watch_holder();
  [[nodiscard]] std::optional<HolderCpu> holder_cpu();
  void watch_simulator(bool is_repeated);
  [[nodiscard]] std::optional<nanoseconds> read_simulator();
  void run(RotationActions actions);
  void carry_out(const Grant& action);
  void carry_out(const OrderReset& action);
  void carry_out(const Fence& action);
  void carry_out(const Recall& action);
  void carry_out(const ReportDoubt& action);
  void run(FenceActions actions);
  void carry_out(const KillHolder& action);
  void carry_out(const AwaitExit& action);
  void carry_out(const HolderGone& action);
  void carry_out(const FenceUnproven& action);
  srfs_msgs::msg::TaskFlags& flag_of(GrantId id, MonotonicTime tick_received);
  /// The process of the fenced holder is gone: the bus goes on when nothing of it waits to be sent.
  void drain_transmit_queue();
  void step_drain();
  void report_unproven(const std::string& why);
  void listen();
  void run(PowerActions actions);
  void carry_out(const CutPower& action);
  void carry_out(const GiveBackLines& action);
  void carry_out(const ReportPowerCut& action);
  void carry_out(const ReportCutFailed& action);
  void report_failed_slot(const srfs_msgs::msg::BusStatus& status);
  void note_slot_use(const srfs_msgs::msg::BusStatus& status);
  void read_payloads();
  /// Nothing: an added payload, or a free position.
  [[nodiscard]] std::optional<std::size_t> place_in_telemetry(std::size_t slot) const;
  void publish_housekeeping();
  void publish_bus_statistics();
  /// Under the APID of this node. @param structure  parameter that says which of the dictionary's it is
  /// Its number in the dictionary, that this parameter says.
  [[nodiscard]] std::uint16_t of_dictionary(const char* parameter) const;
  void publish_as(const char* structure, srfs_msgs::msg::PayloadTelemetry message);
  void report_flood(BusMeter::Flood flood);
  void close();
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::TaskFlags>> flags_;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::PeripheralReset>> resets_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::TimeTick>> ticks_;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::BusStatus>> statuses_;
  TickHoldover holdover_;
  ActionQueue<HoldoverAction> holdover_actions_;
  ros::Timer substitute_timer_;
  std::optional<MonotonicTime> substitute_armed_;
  ros::Timer deadline_timer_;
  std::optional<MonotonicTime> armed_;
  ros::Timer housekeeping_timer_;
  std::unique_ptr<BusListener> listener_;
  ros::Timer listen_timer_;

  struct SlotUse {
    nanoseconds used{0};      ///< in this window
    nanoseconds allotted{0};  ///< in this window
    nanoseconds longest{0};
    std::uint32_t late = 0;  ///< released after the allotted time
  };
  std::vector<SlotUse> slot_use_;
  std::vector<std::string> payloads_;  ///< in the order of telemetry fields per payload
  /// The work thread of the process that holds the bus, as of its grant.
  struct HolderWatch {
    std::uint32_t process = 0;  ///< its incarnation; 0: not known
    std::optional<suite::ProcessCpu> cpu{};
    GrantId grant{};  ///< or recall
    CpuTotals at_grant{};
  };
  std::vector<HolderWatch> holders_;  ///< by slot
  struct SimulatorWatch {
    pid_t process = 0;                    ///< 0: a real bus
    std::optional<ThreadCpuFiles> cpu{};  ///< of its first thread, which plays the bus
    CpuWait wait{};
    bool is_runnable = false;
    GrantId grant{};  ///< or recall
    nanoseconds waited_at_grant{0};
  };
  SimulatorWatch simulator_;
  bool plan_waits_ = false;  ///< for the end of a slot whose place changes

  /// Lives as long as the process: its grant counter must never start again.
  std::optional<TaskFlagRotation> rotation_;
  ActionQueue<RotationAction> rotation_actions_;
  srfs_msgs::msg::TaskFlags flag_;             ///< the last
  std::optional<HolderRecord> holder_record_;  ///< none: it could not be opened
  std::optional<HolderFence> fence_;
  ActionQueue<FenceAction> fence_actions_;
  Fd holder_pidfd_;  ///< of the process that is being fenced
  ros::Executor::Handle exit_watch_;
  ros::Timer fence_timer_;
  bool draining_ = false;  ///< also while this node is unconfigured
  std::optional<TransmitDrain> drain_;
  ros::Timer drain_timer_;
  std::shared_ptr<ros::Worker> gpio_worker_;  ///< none: the deployment has no GPIO
  /// By power line; the worker's alone.
  std::array<std::unique_ptr<hw::GpioLines>, suite::Peripheral::power_lines> power_lines_;
  PowerCut power_cut_;
  ActionQueue<PowerAction> power_actions_;
  suite::MissionTime time_;
  LatencyHistogram flag_latency_;
  std::uint32_t resets_sent_ = 0;
  std::uint32_t meaningless_statuses_ = 0;  ///< with a status outside its enumeration
  std::vector<std::optional<MonotonicTime>> failure_reported_;
};

}  // namespace srfs
