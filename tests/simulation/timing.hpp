// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "base/action_queue.hpp"
#include "hw_sim/gps_receiver.hpp"
#include "nodes/timing/boot_recorder.hpp"
#include "nodes/timing/critical_answers.hpp"
#include "nodes/timing/cycle_reservation.hpp"
#include "nodes/timing/mission_clock.hpp"
#include "nodes/timing/tick_generator.hpp"
#include "nodes/timing/timekeeper.hpp"
#include "nodes/timing/watchdog_feeding.hpp"
#include "tests/simulation/disk.hpp"
#include "tests/simulation/topics.hpp"

namespace srfs::simulation {

/// The hardware watchdog: armed by its first feeding, and then by nothing disarmed.
struct WatchdogTimer {
  static constexpr nanoseconds timeout = seconds(10);
  std::optional<MonotonicTime> fed;
  bool bit = false;  ///< it caused the present start of the computer
};

/// hw_sim's GPS receiver in the true time of the run.
struct Gps {
  sim::GpsReceiver receiver;
  sim::TrueTime truth;
  Host* reader = nullptr;
  std::function<void(MonotonicTime edge)> on_pulse;
  std::function<void(const Octets& sentences)> on_sentences;
};

struct TimingSurroundings {
  Topics& topics;
  Network& network;
  Disk& disk;
  Gps& gps;
  WatchdogTimer& watchdog;
  std::vector<Host*> critical;  ///< beside timing itself
  std::string boot_id;
  MissionCycle& newest_cycle;    ///< ever published
  MissionCycle& reserved_cycle;  ///< the newest that was covered by what was on disk
};

/// timing's logic (Timekeeper, MissionClock, TickGenerator, CycleReservation, WatchdogFeeding,
/// CriticalAnswers, BootRecorder) with what TimingNode translates, over played surroundings.
class Timing final : public Program {
 public:
  Timing(Host& host, TimingSurroundings surroundings);
  ~Timing() override;
  void start() override;
  [[nodiscard]] const TimeDiscipline& time() const { return timekeeper_->time(); }

 private:
  [[nodiscard]] ClockStart read_records();
  void begin();
  void on_tick_due();
  void publish(const Tick& tick);
  void ask_critical();
  void feed();
  void note_feeding(bool fed);
  [[nodiscard]] Octets record_now(MissionCycle ceiling) const;
  void save(MissionCycle ceiling);
  void run(const ReservationActions& actions);
  void run(BootActions actions);
  void run(TimeActions actions);

  Host& host_;
  TimingSurroundings around_;
  std::optional<MissionClock> clock_;
  std::optional<Timekeeper> timekeeper_;
  wire::GnssTimeStream gnss_;
  std::optional<CycleReservation> reservation_;
  std::optional<TickGenerator> ticks_;
  WatchdogFeeding feeding_;
  CriticalAnswers critical_;
  std::optional<wire::BootRecord> stored_boot_;
  std::optional<BootRecorder> boot_;
  Deadline tick_;
  nanoseconds waited_{0};
};

}  // namespace srfs::simulation
