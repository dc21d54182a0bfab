// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "hw_sim/noise.hpp"
#include "hw_sim/peripheral_model.hpp"
#include "hw_sim/spacecraft_world.hpp"

namespace srfs::sim {

/// Controller of the power supply. Its load switches are latched: they and the charge limit survive a restart
/// and the controller's own loss of power.
class EpsModel final : public PeripheralModel {
 public:
  explicit EpsModel(const ModelContext& context) : world_(context.world), noise_(context.seed) {}
  [[nodiscard]] Octets measure() override;
  [[nodiscard]] wire::PeripheralResult execute(std::uint8_t function, OctetView arguments) override;

 private:
  SpacecraftWorld& world_;
  Noise noise_;
};

}  // namespace srfs::sim
