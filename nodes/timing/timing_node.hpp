// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>

#include <srfs_msgs/srv/set_time.hpp>

#include <mission/structures.hpp>

#include "base/action_queue.hpp"
#include "hw/pulse_source.hpp"
#include "hw/serial_port.hpp"
#include "hw/watchdog.hpp"
#include "nodes/timing/boot_recorder.hpp"
#include "nodes/timing/critical_watch.hpp"
#include "nodes/timing/cycle_reservation.hpp"
#include "nodes/timing/system_clock.hpp"
#include "nodes/timing/tick_generator.hpp"
#include "nodes/timing/timekeeper.hpp"
#include "nodes/timing/timing_store.hpp"
#include "nodes/timing/watchdog_feeding.hpp"
#include "suite/boot_store.hpp"
#include "suite/commanding/commanded_node.hpp"
#include "wire/gnss_time.hpp"

namespace srfs {

/// Takes the GPS pulse and the time of day, publishes the tick, feeds the watchdog (README.md).
class TimingNode : public CommandedNode {
 public:
  explicit TimingNode(suite::NodeContext& context);

  /// The tick that is due.
  [[nodiscard]] suite::WorkStatus work_status() const override;

 protected:
  ros::CallbackReturn on_configure() override;
  ros::CallbackReturn on_activate() override;
  ros::CallbackReturn on_deactivate() override;
  ros::CallbackReturn on_cleanup() override;
  ros::CallbackReturn on_shutdown() override;
  ros::CallbackReturn on_error() override;

  [[nodiscard]] std::uint16_t check(std::uint16_t function, OctetView arguments) const override;
  void execute(const StoredTelecommand& telecommand) override;

 private:
  void declare_parameters();
  [[nodiscard]] PulseClockSettings clock_settings() const;
  [[nodiscard]] nanoseconds tick_period() const;
  void on_parameter_changed(const std::string& parameter);

  void arm_tick();
  void on_tick_due();
  [[nodiscard]] nanoseconds waited_since_last_tick();
  [[nodiscard]] std::optional<pid_t> pid_of(const std::string& node) const;
  void publish(const Tick& tick);
  [[nodiscard]] const TimeDiscipline& time() const { return timekeeper_->time(); }
  [[nodiscard]] TimingRecord record_now(MissionCycle ceiling) const;
  void on_pulse_input();
  void on_serial_input();
  void start_clock(const TimingRecord& record);
  void on_set_time(const srfs_msgs::srv::SetTime::Request& request,
                   srfs_msgs::srv::SetTime::Response& response);
  [[nodiscard]] SetTimeVerdict set_time(const TimeCommand& command);
  [[nodiscard]] nanoseconds estimated_error(MonotonicTime t) const;
  [[nodiscard]] Result<void, std::string> prepare_critical_watch();
  void start_feeding();
  void begin_boot();
  void feed_watchdog();
  /// Carries out what logic decided.
  template <class Action>
  void run(ActionQueue<Action>& queue, std::vector<Action> actions) {
    queue.run(std::move(actions),
              [this](const Action& action) { std::visit([this](const auto& a) { carry_out(a); }, action); });
  }
  void run(TimeActions actions) { run(time_actions_, std::move(actions)); }
  void run(ReservationActions actions) { run(reservation_actions_, std::move(actions)); }
  void run(BootActions actions) { run(boot_actions_, std::move(actions)); }
  void run(FeedingActions actions) { run(feeding_actions_, std::move(actions)); }
  void carry_out(const ReportPulseMoved& action);
  void carry_out(const ReportTimeSet& action);
  void carry_out(const ReportJumpRefused& action);
  void carry_out(const ReportTimeRejected& action);
  void carry_out(const ReportLocked& action);
  void carry_out(const ReportHoldover& action);
  void carry_out(const SaveCycles& action);
  void carry_out(const ReportBoot& action);
  void carry_out(const SaveBootRecord& action);
  void carry_out(const NoteHealthySuite& action);
  void carry_out(const FeedWatchdog& action);
  void carry_out(const WithholdWatchdog& action);
  void carry_out(const ReportWithheld& action);
  void note_feeding(bool fed);
  void publish_housekeeping();
  void close();
  TimingStore store_;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::TimeTick>> tick_publisher_;
  std::shared_ptr<ros::Worker> worker_;
  std::unique_ptr<hw::PulseSource> pulse_;
  std::unique_ptr<hw::SerialPort> serial_;
  std::unique_ptr<hw::Watchdog> watchdog_;
  ros::Executor::Handle pulse_watch_;
  ros::Executor::Handle serial_watch_;
  ros::Timer tick_timer_;
  ros::Timer feed_timer_;
  ros::Timer housekeeping_timer_;
  ros::Timer save_timer_;
  ros::Timer calm_timer_;  ///< the suite is healthy for long: one step up

  std::unique_ptr<hw::KernelClock> kernel_;  ///< these two where the system clock is disciplined
  SystemClockDiscipline* system_clock_ = nullptr;
  std::unique_ptr<DisciplinedClock> clock_;
  std::optional<Timekeeper> timekeeper_;  ///< refers to clock_
  ActionQueue<TimeAction> time_actions_;
  std::shared_ptr<ros::Service<srfs_msgs::srv::SetTime>> set_time_;
  ros::Timer discipline_timer_;
  std::optional<TickGenerator> ticks_;
  std::optional<CycleReservation> reservation_;
  ActionQueue<ReservationAction> reservation_actions_;
  std::unique_ptr<CriticalWatch> critical_;  ///< none: the deployment has no ring
  std::optional<WatchdogFeeding> feeding_;   ///< refers to critical_
  ActionQueue<FeedingAction> feeding_actions_;
  std::optional<ThreadCpuFiles> own_cpu_;  ///< of the work thread
  nanoseconds own_waited_{0};              ///< at the last tick
  suite::BootStore boot_store_;
  std::optional<wire::BootRecord> stored_boot_;  ///< found at the start
  std::optional<BootRecorder> boot_;             ///< from the first activation on
  ActionQueue<BootAction> boot_actions_;
  wire::GnssTimeStream gnss_;
  std::uint64_t line_reopened_ = 0;
  std::uint32_t times_commanded_ = 0;
  MissionCycle next_cycle_ = 0;
  std::string boot_id_;

  std::optional<Tick> last_tick_;
  std::uint64_t ticks_published_ = 0;
  nanoseconds max_lateness_{0};
  std::uint64_t skipped_before_ = 0;  ///< by generators before the present one
  std::uint32_t watchdog_feeds_ = 0;
  std::uint32_t watchdog_withheld_ = 0;
};

}  // namespace srfs
