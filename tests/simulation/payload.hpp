// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <optional>
#include <set>

#include "base/action_queue.hpp"
#include "base/bounded_queue.hpp"
#include "nodes/payload/flag_check.hpp"
#include "nodes/payload/mode_orders.hpp"
#include "nodes/payload/payload_cycle.hpp"
#include "nodes/payload/payload_profile.hpp"
#include "nodes/payload/peripheral_link.hpp"
#include "suite/mission_time.hpp"
#include "tests/simulation/can_line.hpp"
#include "tests/simulation/disk.hpp"
#include "tests/simulation/mode_following.hpp"
#include "tests/simulation/topics.hpp"

namespace srfs::simulation {

/// Power line of a peripheral, as the GPIO chip switches it.
class PowerLine {
 public:
  virtual ~PowerLine() = default;
  /// @return whether it obeyed
  virtual bool switch_power(bool on) = 0;
  [[nodiscard]] virtual bool is_on() const = 0;
};

/// What a payload node has around it.
struct PayloadSurroundings {
  Topics& topics;
  Network& network;
  CanLine& can;
  Disk& disk;
  PowerLine& power;
  bool& ids_lost;                   ///< the mark on tmpfs
  std::set<std::uint64_t>& opened;  ///< the newest grants with which the bus was opened, by whomever
  const std::vector<suite::Slot>& slots;
  Host& switcher;
  Host& ttc;  ///< reports wait until it hears them
  std::uint8_t can_address = 0;
  std::string boot_id;
  std::function<std::unique_ptr<PayloadProfile>()> make_profile;
  const mission::Dictionary& dictionary;
  const suite::ModeSettings& modes;
};

/// A payload node's logic (PayloadCycle, PeripheralLink, FlagCheck, its profile) with what PayloadNode
/// translates, over played surroundings.
class Payload final : public Program {
 public:
  Payload(Host& host, PayloadSurroundings surroundings);
  ~Payload() override;
  void start() override;

  /// It may write to the bus now, as far as its handle lets it.
  [[nodiscard]] bool may_write() const { return leased_.granted(host_.now()) && cycle_->holds_bus(); }
  [[nodiscard]] const PayloadCycle& cycle() const { return *cycle_; }
  [[nodiscard]] const ModeFollowing& mode() const { return mode_; }

 private:
  void restore();
  void open_topics();
  void on_flags(const srfs_msgs::msg::TaskFlags& flags, Host& writer);
  void on_can_input();
  void on_can_frame(const hw::CanFrame& frame);
  void pump();
  void check_quiet();
  void arm_timer();
  void run(PayloadActions actions);
  void carry_out(const PublishStatus& action);
  void carry_out(const OpenBus& action);
  void carry_out(const CloseBus& action);
  void carry_out(const SendRequest& action);
  void carry_out(const AbortRequest& action);
  void carry_out(const AwaitQuiet& action);
  void carry_out(const ProcessMeasurement& action);
  void carry_out(const CommandDone& action);
  void carry_out(const OrdersObeyed& action);
  void carry_out(const OrderRefused& /*action*/) {}
  void carry_out(const WriteTelecommands& action);
  void carry_out(const SwitchPower& action);
  void carry_out(const WithdrawFrames& action);
  void carry_out(const RememberKeptOff& action);
  void carry_out(const RememberIdsLost& action);
  void carry_out(const PayloadEvent& action);
  void carry_out(const StageReport& action);
  void carry_out(const Activity& action);
  void write_journal();
  void flush_reports();
  void hold_to_mode();
  void remember_once_done(std::optional<std::uint32_t> change);

  Host& host_;
  PayloadSurroundings around_;
  Random random_;
  std::unique_ptr<PayloadProfile> profile_;
  std::unique_ptr<PeripheralLink> link_;
  std::unique_ptr<CanHandle> can_;
  hw::LeasedCanBus leased_;
  FlagCheck flag_check_;
  std::optional<PayloadCycle> cycle_;
  ModeOrders mode_orders_;
  OnceDone once_done_;
  ModeFollowing mode_;
  suite::MissionTime time_;
  ActionQueue<PayloadAction> actions_;
  Deadline timer_;
  std::uint64_t grant_ = 0;
  bool awaiting_quiet_ = false;
  std::uint32_t frames_sent_ = 0;
  std::uint32_t frames_received_ = 0;
  std::uint64_t bus_offs_seen_ = 0;
  bool journal_writing_ = false;
  std::uint64_t journal_wanted_ = 0;
  unsigned processing_ = 0;
  BoundedQueue<srfs_msgs::msg::TelecommandReport> unheard_{64, Overflow::drop_oldest};
};

}  // namespace srfs::simulation
