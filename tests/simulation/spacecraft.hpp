// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "hw_sim/isotp_peripheral_channel.hpp"
#include "hw_sim/peripheral.hpp"
#include "hw_sim/peripheral_endpoint.hpp"
#include "hw_sim/spacecraft_world.hpp"
#include "tests/simulation/can_line.hpp"
#include "tests/simulation/disk.hpp"
#include "tests/simulation/maintenance.hpp"
#include "tests/simulation/mode_following.hpp"
#include "tests/simulation/payload.hpp"
#include "tests/simulation/ring.hpp"
#include "tests/simulation/station.hpp"
#include "tests/simulation/switcher.hpp"
#include "tests/simulation/timing.hpp"
#include "tests/simulation/topics.hpp"

namespace srfs::simulation {

/// One peripheral: hw_sim's model behind its end of the CAN bus, with its power line.
class Device final : public PowerLine {
 public:
  Device(Kernel& kernel, CanLine& can, std::uint8_t address, std::unique_ptr<sim::PeripheralModel> model);

  bool switch_power(bool on) override;
  [[nodiscard]] bool is_on() const override { return peripheral_.powered(); }
  void set_fault(sim::PeripheralFault fault, milliseconds delay, sim::FaultCure cure);
  void set_stuck(bool stuck) { stuck_ = stuck; }
  void step(nanoseconds dt) { model_->step(dt); }
  /// Called for each telecommand that it carries out.
  void on_executed(std::function<void(std::uint32_t telecommand_id)> callback) {
    on_executed_ = std::move(callback);
  }
  [[nodiscard]] const sim::Peripheral& peripheral() const { return peripheral_; }

 private:
  void service();
  [[nodiscard]] sim::RunningTime now() const { return sim::RunningTime(kernel_.now().since_epoch()); }

  Kernel& kernel_;
  std::unique_ptr<sim::PeripheralModel> model_;
  sim::Peripheral peripheral_;
  std::unique_ptr<CanHandle> can_;
  sim::PeripheralEndpoint endpoint_;
  Deadline timer_;
  bool stuck_ = false;
  std::uint64_t executed_ = 0;
  std::function<void(std::uint32_t telecommand_id)> on_executed_;
};

struct SpacecraftSettings {
  seconds command_loss{259'200};  ///< ttc's parameter command_loss_s
  suite::ModeSettings modes = flown_modes();
};

/// The nine nodes of launch_config/sim.yaml with what is around them. The logic of the nodes, the ring and
/// the models of hw_sim are the real ones; DDS, disk, processes and clocks are played.
class Spacecraft {
 public:
  static constexpr std::size_t payload_count = 3;

  explicit Spacecraft(Kernel& kernel, const SpacecraftSettings& settings = {});
  ~Spacecraft();
  Spacecraft(const Spacecraft&) = delete;
  Spacecraft& operator=(const Spacecraft&) = delete;

  [[nodiscard]] Host& host(Lane lane) { return *hosts_[static_cast<std::size_t>(lane)]; }
  [[nodiscard]] std::size_t node_count() const { return hosts_.size(); }
  [[nodiscard]] Device& device(std::size_t payload) { return *devices_[payload]; }
  [[nodiscard]] Network& network() { return network_; }
  [[nodiscard]] CanLine& can() { return can_; }
  [[nodiscard]] Disk& disk() { return disk_; }
  [[nodiscard]] Gps& gps() { return gps_; }
  [[nodiscard]] TtcFlash& ttc_flash() { return ttc_flash_; }
  [[nodiscard]] Station& station() { return *station_; }
  /// Files of the transactions of both ends, the ground's first.
  [[nodiscard]] std::array<FileRecord::Names, 2> files_under_way();
  [[nodiscard]] Topics& topics() { return topics_; }
  /// The mode that a node obeys; nullopt: it is down, or follows none.
  [[nodiscard]] std::optional<suite::ModeInForce> mode_of(Lane lane);
  [[nodiscard]] const Versions& versions() const { return *versions_; }
  [[nodiscard]] PackageRecord& packages() { return maintenance_flash_.packages; }
  [[nodiscard]] CommandRecord& commands() { return commands_; }
  [[nodiscard]] Ring& ring() { return *ring_; }
  [[nodiscard]] const SwitcherSurroundings::Ledger& ledger() const { return ledger_; }
  [[nodiscard]] sim::SpacecraftWorld& world() { return world_; }
  /// Everything that is up ends; some seconds later the computer starts again.
  void cut_power(const char* why, bool by_watchdog);
  [[nodiscard]] static const mission::Dictionary& dictionary();
  [[nodiscard]] std::uint32_t boots() const { return boots_; }
  [[nodiscard]] MissionCycle newest_cycle() const { return newest_cycle_; }

 private:
  [[nodiscard]] std::unique_ptr<Program> make_program(Host& host);
  [[nodiscard]] std::unique_ptr<Program> make_logic(Host& host);
  void on_process(Host& host);
  void work_on_packages();
  void work_on_versions();
  /// Runs on maintenance, if it is up.
  void with_maintenance(std::function<void(Maintenance& maintenance)> work);
  void rest_maintenance(bool rests);
  [[nodiscard]] MaintenanceSurroundings maintenance_surroundings();
  void step_world();
  void step_battery();
  void check_writer(Lane writer);
  void schedule_pulse();
  [[nodiscard]] Payload* payload(std::size_t i);
  [[nodiscard]] TtcSurroundings ttc_surroundings();

  Kernel& kernel_;
  SpacecraftSettings settings_;
  Network network_{kernel_};
  Topics topics_{kernel_, network_};
  CanLine can_{kernel_};
  Disk disk_{kernel_};
  sim::SpacecraftWorld world_;
  Gps gps_;
  WatchdogTimer watchdog_;
  HolderWord holder_word_;
  SwitcherSurroundings::Ledger ledger_;
  std::array<bool, payload_count> ids_lost_{};  ///< marks on tmpfs, by payload
  std::vector<suite::Slot> slots_;
  std::vector<std::unique_ptr<Device>> devices_;
  std::vector<std::unique_ptr<Host>> hosts_;
  std::unique_ptr<Versions> versions_;
  std::unique_ptr<Ring> ring_;
  std::string boot_id_;
  std::uint32_t boots_ = 0;
  bool powered_ = false;
  MissionCycle newest_cycle_ = 0;
  MissionCycle reserved_cycle_ = 0;
  suite::LinkSettings link_;
  wire::SdlsKey key_;
  TtcFlash ttc_flash_;
  MaintenanceFlash maintenance_flash_;
  Random packages_operator_{kernel_.random("operator of packages")};
  Random versions_operator_{kernel_.random("operator of versions")};
  std::string package_;             ///< file of the newest one
  bool maintenance_rests_ = false;  ///< by the mode
  CommandRecord commands_;
  std::unique_ptr<Station> station_;
  std::set<std::uint64_t> opened_;  ///< grants with which a payload opened the bus
};

}  // namespace srfs::simulation
