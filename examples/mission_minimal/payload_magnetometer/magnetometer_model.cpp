// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include <mission/structures.hpp>

#include "hw_sim/noise.hpp"
#include "hw_sim/peripheral_model.hpp"
#include "hw_sim/spacecraft_world.hpp"

namespace srfs::sim {
namespace {

constexpr double noise_t = 2e-8;
constexpr double fine_limit_t = 3e-5;

/// Three axes in the field of the orbit; the fine range saturates. Back to coarse without power.
class MagnetometerModel final : public PeripheralModel {
 public:
  explicit MagnetometerModel(const ModelContext& context) : world_(context.world), noise_(context.seed) {}

  [[nodiscard]] Octets measure() override {
    const Eigen::Vector3d field =
        world_.attitude().state().attitude.conjugate() * world_.orbit().magnetic_field_t;
    const double limit_t = range_ == mission::MagnetometerRange::fine ? fine_limit_t : 1;
    mission::MagnetometerMeasurement measurement;
    for (std::size_t i = 0; i < 3; ++i) {
      const double value_t = field[static_cast<Eigen::Index>(i)] + noise_(noise_t);
      measurement.field_t[i] = static_cast<float>(std::clamp(value_t, -limit_t, limit_t));
    }
    measurement.range = range_;
    return measurement.encoded();
  }

  [[nodiscard]] wire::PeripheralResult execute(std::uint8_t function, OctetView arguments) override {
    if (function != mission::MagnetometerSetRange::peripheral_function)
      return wire::PeripheralResult::unknown_function;
    const auto command = mission::MagnetometerSetRange::decode(arguments);
    if (!command) return wire::PeripheralResult::bad_argument;
    range_ = command->range;
    return wire::PeripheralResult::done;
  }

  void set_power(bool on) override {
    if (!on) range_ = mission::MagnetometerRange::coarse;
  }

 private:
  SpacecraftWorld& world_;
  Noise noise_;
  mission::MagnetometerRange range_ = mission::MagnetometerRange::coarse;
};

}  // namespace

std::unique_ptr<PeripheralModel> make_payload_magnetometer_model(const ModelContext& context) {
  return std::make_unique<MagnetometerModel>(context);
}

}  // namespace srfs::sim
