// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <nlohmann/json_fwd.hpp>

#include "base/time.hpp"
#include "hw_sim/attitude_model.hpp"
#include "hw_sim/orbit.hpp"
#include "hw_sim/power_model.hpp"
#include "hw_sim/thermal_model.hpp"

namespace srfs::sim {

struct WorldSettings {
  OrbitSettings orbit;
  AttitudeSettings attitude;
  PowerSettings power;
  ThermalSettings thermal;
  double time_acceleration = 60;     ///< of orbit, power and heat against real time
  double attitude_acceleration = 1;  ///< of the attitude dynamics
  std::uint64_t seed = 1;
};

/// The true state of the satellite and its surroundings: the four models, coupled. The sun and the Earth heat
/// and power what the attitude turns to them; loads, heaters and wheels draw on the battery and warm their
/// nodes. Pure.
class SpacecraftWorld {
 public:
  SpacecraftWorld(const WorldSettings& settings, UtcTime start);

  /// @param real_time  since the last step, 0 or more; taken in steps of at most 20 ms
  void step(nanoseconds real_time);
  /// Solves the circuit again without letting time pass: after a command, so that currents follow at once.
  void settle();

  AttitudeModel& attitude() { return attitude_; }
  PowerModel& power() { return power_; }
  ThermalModel& thermal() { return thermal_; }
  [[nodiscard]] const OrbitState& orbit() const { return orbit_state_; }
  [[nodiscard]] UtcTime orbit_time() const { return orbit_time_; }
  /// Whether their controller has power; without it no heater is on.
  void set_heaters_powered(bool powered) { heaters_powered_ = powered; }
  /// The same of wheels and magnetorquers.
  void set_actuators_powered(bool powered) { actuators_powered_ = powered; }
  /// Direction to the sun in the body frame; zero in eclipse.
  [[nodiscard]] Eigen::Vector3d sun_body() const;

  /// The coarse on-board sensors behind the GPIO inputs: bit 0 sun on +X, bit 1 sun on -X, bit 2 battery
  /// below 273 K, bit 3 bus undervoltage.
  [[nodiscard]] std::uint8_t sensor_inputs() const;

  /// The true values, for tests and demonstrations.
  [[nodiscard]] nlohmann::json truth() const;

 private:
  void sub_step(double real_s);
  [[nodiscard]] PowerInput power_input() const;
  [[nodiscard]] ThermalInput thermal_input() const;
  [[nodiscard]] bool heaters_on() const;
  [[nodiscard]] bool battery_is_cold() const;  ///< it takes no charge, or soon none

  WorldSettings settings_;
  Orbit orbit_;
  UtcTime orbit_time_;
  OrbitState orbit_state_;
  AttitudeModel attitude_;
  PowerModel power_;
  ThermalModel thermal_;
  bool heaters_powered_ = true;
  bool actuators_powered_ = true;
};

}  // namespace srfs::sim
