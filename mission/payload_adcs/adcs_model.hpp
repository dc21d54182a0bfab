// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "hw_sim/noise.hpp"
#include "hw_sim/peripheral_model.hpp"
#include "hw_sim/spacecraft_world.hpp"

namespace srfs::sim {

/// Attitude control unit. A restart or loss of power puts it to idle with the identity as its target; wheels
/// run on.
class AdcsModel final : public PeripheralModel {
 public:
  explicit AdcsModel(const ModelContext& context) : world_(context.world), noise_(context.seed) {}
  [[nodiscard]] Octets measure() override;
  [[nodiscard]] wire::PeripheralResult execute(std::uint8_t function, OctetView arguments) override;
  void restart() override { world_.attitude().restart_controller(); }
  void set_power(bool on) override;

 private:
  SpacecraftWorld& world_;
  Noise noise_;
};

}  // namespace srfs::sim
