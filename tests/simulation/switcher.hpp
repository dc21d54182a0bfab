// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "base/action_queue.hpp"
#include "nodes/can_switcher/holder_fence.hpp"
#include "nodes/can_switcher/task_flag_rotation.hpp"
#include "nodes/can_switcher/tick_holdover.hpp"
#include "nodes/can_switcher/transmit_drain.hpp"
#include "suite/deployment.hpp"
#include "tests/simulation/can_line.hpp"
#include "tests/simulation/topics.hpp"

namespace srfs::simulation {

/// The word of the mapped file that outlives the switcher's process (HolderRecord), not the computer.
struct HolderWord {
  std::optional<TaskFlagRotation::Holder> holder;
};

struct SwitcherSurroundings {
  Topics& topics;
  CanLine& can;
  const std::vector<suite::Slot>& slots;
  std::function<Host*(const std::string& payload)> find;
  Host& timing;
  HolderWord& record;
  /// Counts what becomes of the grants, over all processes.
  struct Ledger {
    GrantId newest;               ///< of all flags
    std::optional<GrantId> open;  ///< granted, and its end is not counted
    std::uint32_t not_taken_before = 0;
    std::uint64_t granted = 0;
    std::uint64_t released = 0;
    std::uint64_t failed = 0;
    std::uint64_t not_taken = 0;
    std::uint64_t withdrawn = 0;
    std::uint64_t recalled = 0;
    std::uint64_t fenced = 0;
    std::uint64_t abandoned = 0;  ///< the switcher's process ended
  };
  Ledger& ledger;
};

/// can_switcher's logic (TickHoldover, TaskFlagRotation, HolderFence, TransmitDrain) with what
/// CanSwitcherNode translates, over played surroundings.
class Switcher final : public Program {
 public:
  Switcher(Host& host, SwitcherSurroundings surroundings);
  ~Switcher() override;
  void start() override;
  [[nodiscard]] const TaskFlagRotation& rotation() const { return *rotation_; }
  [[nodiscard]] const TickHoldover& holdover() const { return holdover_; }

 private:
  void make_rotation();
  void on_tick(const srfs_msgs::msg::TimeTick& tick);
  void on_tick_missing();
  void on_bus_status(const srfs_msgs::msg::BusStatus& status);
  void on_deadline();
  void arm();
  void record_holder();
  /// Counts the transitions of the slot of a payload.
  enum class SlotState : std::uint8_t { free, granted, taken, reset_ordered, fencing, recalled };
  void note(const std::string& payload, SlotState state);
  [[nodiscard]] std::optional<HolderCpu> holder_cpu();
  void watch_holder();
  void run(HoldoverActions actions);
  void carry_out(const Beat& action);
  void carry_out(const ReportTicksMissing& action);
  void carry_out(const ReportTicksBack& action);
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
  [[nodiscard]] srfs_msgs::msg::TaskFlags flag_of(GrantId id, MonotonicTime tick_received);
  void drain();
  void step_drain();

  Host& host_;
  SwitcherSurroundings around_;
  std::unique_ptr<CanHandle> can_;
  TickHoldover holdover_;
  ActionQueue<HoldoverAction> holdover_actions_;
  std::optional<TaskFlagRotation> rotation_;
  ActionQueue<RotationAction> rotation_actions_;
  HolderFence fence_{milliseconds(500)};
  ActionQueue<FenceAction> fence_actions_;
  std::optional<TransmitDrain> drain_;
  bool draining_ = false;
  Deadline deadline_;
  Deadline substitute_;
  Deadline fence_wait_;
  MonotonicTime last_heard_;
  MissionCycle cycle_ = 0;
  struct Watch {
    pid_t pid = 0;
    GrantId grant{};
    nanoseconds waited{0};
    MonotonicTime at;
  };
  std::vector<Watch> watches_;
};

}  // namespace srfs::simulation
