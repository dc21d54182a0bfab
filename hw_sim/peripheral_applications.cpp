// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/peripheral_applications.hpp"

#include <array>
#include <cmath>

namespace srfs::sim {
namespace {

using Result = wire::PeripheralResult;

Result done_if(bool fine) {
  return fine ? Result::done : Result::bad_argument;
}

bool exactly_read(const OctetReader& in) {
  return in.ok() && in.remaining() == 0;
}

}  // namespace

Result AdcsApplication::execute(std::uint8_t function, OctetView arguments) {
  AttitudeModel& attitude = world_.attitude();
  OctetReader in(arguments);
  switch (static_cast<wire::AdcsFunction>(function)) {
    case wire::AdcsFunction::set_mode: {
      const std::uint8_t mode = in.u8();
      if (!exactly_read(in) || mode > 2) return Result::bad_argument;
      attitude.set_mode(static_cast<AttitudeMode>(mode));
      return Result::done;
    }
    case wire::AdcsFunction::set_target_quaternion: {
      std::array<double, 4> q{};
      for (double& c : q) c = static_cast<double>(in.f32());
      return done_if(exactly_read(in) && attitude.set_target(Eigen::Quaterniond(q[3], q[0], q[1], q[2])));
    }
    case wire::AdcsFunction::set_wheel_speed: {
      const std::uint8_t wheel = in.u8();
      const auto speed_rad_s = static_cast<double>(in.f32());
      if (!exactly_read(in)) return Result::bad_argument;
      // The control laws own the wheels in the other modes.
      if (attitude.mode() != AttitudeMode::idle) return Result::cannot_now;
      return done_if(attitude.set_wheel_speed(wheel, speed_rad_s));
    }
  }
  return Result::unknown_function;
}

void AdcsApplication::set_power(bool on) {
  world_.set_adcs_powered(on);
  world_.attitude().restart_controller();
}

Result EpsApplication::execute(std::uint8_t function, OctetView arguments) {
  OctetReader in(arguments);
  switch (static_cast<wire::EpsFunction>(function)) {
    case wire::EpsFunction::switch_load: {
      const std::uint8_t load = in.u8();
      const std::uint8_t on = in.u8();
      if (!exactly_read(in) || load >= load_count || on > 1) return Result::bad_argument;
      world_.power().switch_load(static_cast<Load>(load), on == 1);
      world_.settle();
      return Result::done;
    }
    case wire::EpsFunction::set_charge_limit: {
      const auto charge = static_cast<double>(in.f32());
      return done_if(exactly_read(in) && world_.power().set_charge_limit(charge));
    }
  }
  return Result::unknown_function;
}

Result ThermalApplication::execute(std::uint8_t function, OctetView arguments) {
  OctetReader in(arguments);
  switch (static_cast<wire::ThermalFunction>(function)) {
    case wire::ThermalFunction::set_heater: {
      const std::uint8_t heater = in.u8();
      const std::uint8_t mode = in.u8();
      if (!exactly_read(in) || mode > 2) return Result::bad_argument;
      const bool fine = world_.thermal().set_heater(heater, static_cast<HeaterMode>(mode));
      world_.settle();
      return done_if(fine);
    }
    case wire::ThermalFunction::set_setpoint: {
      const std::uint8_t heater = in.u8();
      const auto setpoint_k = static_cast<double>(in.f32());
      const bool fine = exactly_read(in) && world_.thermal().set_setpoint(heater, setpoint_k);
      world_.settle();
      return done_if(fine);
    }
  }
  return Result::unknown_function;
}

void ThermalApplication::set_power(bool on) {
  world_.set_thermal_controller_powered(on);
  world_.thermal().restart_controller();
  world_.settle();
}

}  // namespace srfs::sim
