// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "hw_sim/peripheral_model.hpp"
#include "hw_sim/spacecraft_world.hpp"

namespace srfs::sim {

/// Attitude control unit, address 0x11. A restart or loss of power puts it to idle with the identity as its
/// target; wheels run on.
class AdcsApplication final : public PeripheralModel {
 public:
  explicit AdcsApplication(SpacecraftWorld& world) : world_(world) {}
  [[nodiscard]] Octets measure() override { return world_.measure_adcs(); }
  [[nodiscard]] wire::PeripheralResult execute(std::uint8_t function, OctetView arguments) override;
  void restart() override { world_.attitude().restart_controller(); }
  void set_power(bool on) override;

 private:
  SpacecraftWorld& world_;
};

/// Controller of the power supply, address 0x12. Its load switches are latched: they and the charge limit
/// survive a restart and the controller's own loss of power.
class EpsApplication final : public PeripheralModel {
 public:
  explicit EpsApplication(SpacecraftWorld& world) : world_(world) {}
  [[nodiscard]] Octets measure() override { return world_.measure_eps(); }
  [[nodiscard]] wire::PeripheralResult execute(std::uint8_t function, OctetView arguments) override;
  void set_power(bool) override {}

 private:
  SpacecraftWorld& world_;
};

/// Thermal controller, address 0x13. A restart keeps modes and setpoints; loss of power switches the heaters
/// off and resets them.
class ThermalApplication final : public PeripheralModel {
 public:
  explicit ThermalApplication(SpacecraftWorld& world) : world_(world) {}
  [[nodiscard]] Octets measure() override { return world_.measure_thermal(); }
  [[nodiscard]] wire::PeripheralResult execute(std::uint8_t function, OctetView arguments) override;
  void set_power(bool on) override;

 private:
  SpacecraftWorld& world_;
};

}  // namespace srfs::sim
