// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "base/result.hpp"
#include "hw_sim/camera_device.hpp"
#include "hw_sim/can_hub.hpp"
#include "hw_sim/can_log.hpp"
#include "hw_sim/can_peripheral.hpp"
#include "hw_sim/gpio_bank.hpp"
#include "hw_sim/gps_device.hpp"
#include "hw_sim/peripheral_model.hpp"
#include "hw_sim/rs422_device.hpp"
#include "hw_sim/settings.hpp"
#include "hw_sim/watchdog_device.hpp"

namespace srfs::sim {

/// All devices around the computer, built from one deployment, running in one EventLoop. Everything it
/// creates below VAR goes with it.
class Simulator {
 public:
  /// @param models  of the peripherals; one without is silent
  /// @param restart_command  for the watchdog when the deployment names none
  /// @param kill_computer  ends every process of the suite at once, as a loss of power does  Error: ready to
  /// print.
  [[nodiscard]] static Result<std::unique_ptr<Simulator>, std::string> create(
      EventLoop& loop, const SimulationSettings& settings, const PeripheralModels& models,
      const std::filesystem::path& var, const std::vector<std::string>& restart_command,
      std::function<void()> kill_computer);
  ~Simulator();
  Simulator(const Simulator&) = delete;
  Simulator& operator=(const Simulator&) = delete;

  /// One request of the control socket (hw_sim/README.md, "Faults"), as JSON text; always gives one reply:
  /// {"ok": true, ...} or {"ok": false, "error": "..."}.
  [[nodiscard]] std::string on_control(const std::string& request, MonotonicTime now);

 private:
  /// One peripheral of the deployment that has a model.
  struct Station {
    std::string name;  ///< of its payload, without "payload_"
    suite::Peripheral place;
    std::unique_ptr<PeripheralModel> model;
    std::unique_ptr<Peripheral> peripheral;
    std::unique_ptr<CanPeripheral> on_bus;
  };
  struct SimulatedBus {
    std::string uri;
    std::unique_ptr<CanLog> log;  ///< of the simulated bus, if there is to be one
    std::unique_ptr<CanHub> hub;  ///< none when the bus is a real interface
  };
  Simulator(EventLoop& loop, const SimulationSettings& settings, MonotonicTime now);
  void make_stations(const SimulationSettings& settings, const PeripheralModels& models);
  void switch_power(std::size_t line, bool on);
  [[nodiscard]] std::string station_names() const;
  [[nodiscard]] Result<void, std::string> open_can(const SimulationSettings& settings,
                                                   const std::filesystem::path& var);
  [[nodiscard]] Result<void, std::string> open_hub(const std::string& name,
                                                   const SimulationSettings& settings,
                                                   const std::filesystem::path& var);
  [[nodiscard]] Result<void, std::string> open_gps(const SimulationSettings& settings,
                                                   const std::filesystem::path& var, MonotonicTime now);
  [[nodiscard]] Result<void, std::string> open_line(const SimulationSettings& settings,
                                                    const std::filesystem::path& var);
  [[nodiscard]] Result<void, std::string> open_gpio(const SimulationSettings& settings,
                                                    const std::filesystem::path& var);
  [[nodiscard]] Result<void, std::string> open_others(const SimulationSettings& settings,
                                                      const std::filesystem::path& var,
                                                      const std::vector<std::string>& restart_command);
  [[nodiscard]] Result<void, std::string> open_camera(const SimulationSettings& settings,
                                                      const std::filesystem::path& var, MonotonicTime now);
  void point_camera(MonotonicTime now);
  [[nodiscard]] Result<void, std::string> open_watchdog(const SimulationSettings& settings,
                                                        const std::filesystem::path& var,
                                                        const std::vector<std::string>& restart_command);
  void step(MonotonicTime now);
  void follow_computer_power(MonotonicTime now);
  void switch_computer(bool on);

  // Control requests, one per key. Each throws std::invalid_argument with what was expected.
  void set_peripheral_fault(const nlohmann::json& request);
  void set_bus_faults(const std::string& bus, const nlohmann::json& faults, MonotonicTime now);
  void force_bus_off(const std::string& bus, const std::string& station, MonotonicTime now);
  void set_line_faults(const nlohmann::json& faults);
  void set_gps(const nlohmann::json& wanted);
  void set_gpio_inputs(const nlohmann::json& bank);
  void set_camera(const nlohmann::json& wanted);
  [[nodiscard]] nlohmann::json query(const std::string& what) const;
  [[nodiscard]] nlohmann::json counters() const;
  /// Telecommands that the peripherals carried out: how many ever, and the last ids in order.
  [[nodiscard]] nlohmann::json executed() const;
  [[nodiscard]] nlohmann::json apply(const nlohmann::json& request, MonotonicTime now);

  EventLoop& loop_;
  SpacecraftWorld world_;
  std::map<std::string, SimulatedBus, std::less<>> buses_;
  std::vector<Station> stations_;
  GpioBank gpio_;
  std::unique_ptr<SeqpacketServer> gpio_socket_;
  std::unique_ptr<GpsDevice> gps_;        // none when the receiver is real
  std::unique_ptr<Rs422Device> rs422_;    // none when the line is real
  std::unique_ptr<CameraDevice> camera_;  // none when the deployment has another
  bool camera_switched_ = false;          ///< it follows its load switch
  std::unique_ptr<WatchdogDevice> watchdog_;
  std::unique_ptr<SeqpacketServer> watchdog_socket_;
  std::unique_ptr<SeqpacketServer> control_socket_;
  std::function<void()> kill_computer_;
  bool computer_on_ = true;
  MonotonicTime killed_;
  EventLoop::Timer step_timer_;
  MonotonicTime stepped_;
  MonotonicTime flushed_;
  std::uint64_t late_steps_ =
      0;  // the process stood still for more than a second: that time is not simulated
};

}  // namespace srfs::sim
