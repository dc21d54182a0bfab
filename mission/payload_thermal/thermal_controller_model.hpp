// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "hw_sim/noise.hpp"
#include "hw_sim/peripheral_model.hpp"
#include "hw_sim/spacecraft_world.hpp"

namespace srfs::sim {

/// Thermal controller. A restart keeps modes and setpoints; loss of power switches the heaters off and resets
/// them.
class ThermalControllerModel final : public PeripheralModel {
 public:
  explicit ThermalControllerModel(const ModelContext& context)
      : world_(context.world), noise_(context.seed) {}
  [[nodiscard]] Octets measure() override;
  [[nodiscard]] wire::PeripheralResult execute(std::uint8_t function, OctetView arguments) override;
  void set_power(bool on) override;

 private:
  SpacecraftWorld& world_;
  Noise noise_;
};

}  // namespace srfs::sim
