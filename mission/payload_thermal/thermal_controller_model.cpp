// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "thermal_controller_model.hpp"

namespace srfs::sim {
namespace {

using Result = wire::PeripheralResult;

enum class Function : std::uint8_t {
  set_heater = 1,    ///< u8 heater 0-1, u8 mode: 0 off, 1 on, 2 auto
  set_setpoint = 2,  ///< u8 heater 0-1, f32 K 250-320
};

constexpr double temperature_noise_k = 0.05;  // standard deviation

Result done_if(bool fine) {
  return fine ? Result::done : Result::bad_argument;
}

bool exactly_read(const OctetReader& in) {
  return in.ok() && in.remaining() == 0;
}

}  // namespace

Octets ThermalControllerModel::measure() {
  const ThermalModel& heat = world_.thermal();
  OctetWriter out;
  for (const double t : heat.temperatures_k()) out.f32(static_cast<float>(t + noise_(temperature_noise_k)));
  std::uint8_t states = 0;
  for (std::size_t i = 0; i < heater_count; ++i) {
    if (heat.heating(i)) states = static_cast<std::uint8_t>(states | 1U << i);
  }
  out.u8(states);
  for (std::size_t i = 0; i < heater_count; ++i) out.f32(static_cast<float>(heat.setpoint_k(i)));
  return out.take();
}

Result ThermalControllerModel::execute(std::uint8_t function, OctetView arguments) {
  OctetReader in(arguments);
  switch (static_cast<Function>(function)) {
    case Function::set_heater: {
      const std::uint8_t heater = in.u8();
      const std::uint8_t mode = in.u8();
      if (!exactly_read(in) || mode > 2) return Result::bad_argument;
      const bool fine = world_.thermal().set_heater(heater, static_cast<HeaterMode>(mode));
      world_.settle();
      return done_if(fine);
    }
    case Function::set_setpoint: {
      const std::uint8_t heater = in.u8();
      const auto setpoint_k = static_cast<double>(in.f32());
      const bool fine = exactly_read(in) && world_.thermal().set_setpoint(heater, setpoint_k);
      world_.settle();
      return done_if(fine);
    }
  }
  return Result::unknown_function;
}

void ThermalControllerModel::set_power(bool on) {
  world_.set_heaters_powered(on);
  world_.thermal().restart_controller();
  world_.settle();
}

std::unique_ptr<PeripheralModel> make_payload_thermal_model(const ModelContext& context) {
  return std::make_unique<ThermalControllerModel>(context);
}

}  // namespace srfs::sim
