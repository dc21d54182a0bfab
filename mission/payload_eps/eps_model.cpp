// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "eps_model.hpp"

#include <algorithm>

namespace srfs::sim {
namespace {

using Result = wire::PeripheralResult;

enum class Function : std::uint8_t {
  switch_load = 1,       ///< u8 load 0-3, u8 on 0-1
  set_charge_limit = 2,  ///< f32 state of charge 0-1
};

// Standard deviations of the sensors, of the class flown on CubeSats.
constexpr double voltage_noise_v = 2e-3;
constexpr double current_noise_a = 1e-3;
constexpr double charge_noise = 2e-4;
constexpr double temperature_noise_k = 0.05;

}  // namespace

Octets EpsModel::measure() {
  const PowerState& s = world_.power().state();
  OctetWriter out;
  const auto put = [&](double value, double sigma) { out.f32(static_cast<float>(value + noise_(sigma))); };
  put(s.battery_v, voltage_noise_v);
  put(s.battery_a, current_noise_a);
  out.f32(static_cast<float>(std::clamp(s.charge + noise_(charge_noise), 0.0, 1.0)));
  put(s.solar_a, s.solar_a > 0 ? current_noise_a : 0);
  put(world_.thermal().temperature_k(ThermalNode::battery), temperature_noise_k);
  put(s.bus_v, voltage_noise_v);
  out.u8(s.switches);
  for (const double current_a : s.load_a) put(current_a, current_a > 0 ? current_noise_a : 0);
  return out.take();
}

Result EpsModel::execute(std::uint8_t function, OctetView arguments) {
  OctetReader in(arguments);
  const auto exactly_read = [&in] { return in.ok() && in.remaining() == 0; };
  switch (static_cast<Function>(function)) {
    case Function::switch_load: {
      const std::uint8_t load = in.u8();
      const std::uint8_t on = in.u8();
      if (!exactly_read() || load >= load_count || on > 1) return Result::bad_argument;
      world_.power().switch_load(static_cast<Load>(load), on == 1);
      world_.settle();
      return Result::done;
    }
    case Function::set_charge_limit: {
      const auto charge = static_cast<double>(in.f32());
      const bool fine = exactly_read() && world_.power().set_charge_limit(charge);
      return fine ? Result::done : Result::bad_argument;
    }
  }
  return Result::unknown_function;
}

std::unique_ptr<PeripheralModel> make_payload_eps_model(const ModelContext& context) {
  return std::make_unique<EpsModel>(context);
}

}  // namespace srfs::sim
