// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/spacecraft_world.hpp"

#include <algorithm>
#include <cmath>

#include <nlohmann/json.hpp>

namespace srfs::sim {
namespace {

constexpr auto index(ThermalNode node) {
  return static_cast<Eigen::Index>(node);
}

nlohmann::json list(const auto& values) {
  nlohmann::json out = nlohmann::json::array();
  for (const double value : values) out.push_back(value);
  return out;
}

/// Of the sun above the plane of the orbit: it makes the season of eclipses.
double beta_rad(const OrbitState& orbit) {
  const Eigen::Vector3d normal = orbit.position_m.cross(orbit.velocity_m_s).normalized();
  return std::asin(std::clamp(normal.dot(orbit.sun_direction), -1.0, 1.0));
}

AttitudeState start_state(const AttitudeSettings& settings) {
  AttitudeState state;
  state.attitude = Eigen::Quaterniond(0.5, 0.5, -0.3, 0.2).normalized();
  state.rate_rad_s = settings.initial_rate_rad_s;
  state.wheel_momentum_n_m_s = settings.wheel_inertia_kg_m2 * settings.initial_wheel_speed_rad_s;
  return state;
}

}  // namespace

SpacecraftWorld::SpacecraftWorld(const WorldSettings& settings, UtcTime start)
    : settings_(settings),
      orbit_(settings.orbit, start),
      orbit_time_(start),
      orbit_state_(orbit_.at(start)),
      attitude_(settings.attitude, start_state(settings.attitude)),
      power_(settings.power),
      thermal_(settings.thermal) {
  settle();
}

Eigen::Vector3d SpacecraftWorld::sun_body() const {
  if (orbit_state_.eclipsed) return Eigen::Vector3d::Zero();
  return attitude_.state().attitude.conjugate() * orbit_state_.sun_direction;
}

bool SpacecraftWorld::heaters_on() const {
  return heaters_powered_ && power_.is_on(Load::heaters);
}

PowerInput SpacecraftWorld::power_input() const {
  PowerInput input;
  input.sun_body = sun_body();
  input.battery_temperature_k = thermal_.temperature_k(ThermalNode::battery);
  input.heater_w = heaters_on() ? thermal_.heater_demand_w() : 0;
  // A wheel motor takes the mechanical power it gives (and none back when it brakes), and friction with
  // speed.
  const Eigen::Vector3d speed = attitude_.wheel_speed_rad_s();
  input.actuator_w = attitude_.wheel_torque_n_m().cwiseProduct(speed).cwiseMax(0).sum() / 0.5 +
                     3e-4 * speed.cwiseAbs().sum();
  return input;
}

ThermalInput SpacecraftWorld::thermal_input() const {
  const double radius_m = orbit_state_.position_m.norm();
  const Eigen::Vector3d up = orbit_state_.position_m / radius_m;
  ThermalInput input;
  input.sun_body = sun_body();
  input.nadir_body = attitude_.state().attitude.conjugate() * -up;
  input.earth_view_factor = std::pow(earth_radius_m / radius_m, 2);
  input.albedo_cosine = std::max(0.0, up.dot(orbit_state_.sun_direction));
  input.heaters_powered = heaters_on();

  const double computer_w = power_.base_load_w();
  const double regulator_w = computer_w * (1 / settings_.power.regulator_efficiency - 1);
  input.dissipation_w[index(ThermalNode::structure_px)] = computer_w / 2 + regulator_w;
  input.dissipation_w[index(ThermalNode::structure_mx)] =
      computer_w / 2 + power_.load_w(Load::adcs_actuators);
  input.dissipation_w[index(ThermalNode::battery)] = power_.state().battery_heat_w;
  if (!power_.state().computer_on && battery_is_cold()) {
    // Without the computer the power supply warms a frozen battery from the panels, or it would stay flat.
    input.dissipation_w[index(ThermalNode::battery)] +=
        std::min(power_.state().panels_w, settings_.thermal.heaters[0].power_w);
  }
  input.dissipation_w[index(ThermalNode::camera)] = power_.load_w(Load::camera) * 0.4;
  input.dissipation_w[index(ThermalNode::payload)] =
      power_.load_w(Load::camera) * 0.6 +
      power_.load_w(Load::transmitter) * 0.7;  // the rest leaves by the antenna
  return input;
}

bool SpacecraftWorld::battery_is_cold() const {
  constexpr double margin_k = 3;
  return thermal_.temperature_k(ThermalNode::battery) < settings_.power.lowest_charging_k + margin_k;
}

void SpacecraftWorld::settle() {
  power_.step(0, power_input());
}

void SpacecraftWorld::sub_step(double real_s) {
  const double accelerated_s = real_s * settings_.time_acceleration;
  orbit_time_ += std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(accelerated_s));
  orbit_state_ = orbit_.at(orbit_time_);
  AttitudeEnvironment surroundings;
  surroundings.magnetic_field_t = orbit_state_.magnetic_field_t;
  surroundings.position_m = orbit_state_.position_m;
  if (!orbit_state_.eclipsed) surroundings.sun_direction = orbit_state_.sun_direction;
  surroundings.actuators_powered = actuators_powered_ && power_.is_on(Load::adcs_actuators);
  attitude_.step(real_s * settings_.attitude_acceleration, surroundings);
  power_.step(accelerated_s, power_input());
  thermal_.step(accelerated_s, thermal_input());
}

void SpacecraftWorld::step(nanoseconds real_time) {
  double left_s = std::chrono::duration<double>(real_time).count();
  while (left_s > 0) {
    const double part_s = std::min(left_s, 0.02);
    sub_step(part_s);
    left_s -= part_s;
  }
}

std::uint8_t SpacecraftWorld::sensor_inputs() const {
  const Eigen::Vector3d sun = sun_body();
  unsigned bits = 0;
  if (sun.x() > 0.1) bits |= 1U;
  if (sun.x() < -0.1) bits |= 2U;
  if (thermal_.temperature_k(ThermalNode::battery) < 273.15) bits |= 4U;
  if (power_.state().battery_v < 6.6) bits |= 8U;
  return static_cast<std::uint8_t>(bits);
}

nlohmann::json SpacecraftWorld::truth() const {
  constexpr double degree = 57.29577951308232;
  const AttitudeState& a = attitude_.state();
  const PowerState& p = power_.state();
  nlohmann::json out;
  out["orbit"] = {{"utc", to_iso8601(orbit_time_)},
                  {"eclipsed", orbit_state_.eclipsed},
                  {"beta_deg", beta_rad(orbit_state_) * degree},
                  {"latitude_deg", orbit_state_.latitude_rad * degree},
                  {"longitude_deg", orbit_state_.longitude_rad * degree},
                  {"position_m", list(orbit_state_.position_m)},
                  {"sun_direction", list(orbit_state_.sun_direction)},
                  {"magnetic_field_t", list(orbit_state_.magnetic_field_t)}};
  out["attitude"] = {{"quaternion", list(a.attitude.coeffs())},
                     {"rate_rad_s", list(a.rate_rad_s)},
                     {"wheel_speed_rad_s", list(attitude_.wheel_speed_rad_s())},
                     {"mode", static_cast<int>(attitude_.mode())},
                     {"target", list(attitude_.target().coeffs())},
                     {"pointing_error_deg", attitude_.pointing_error_rad() * degree},
                     {"sun_body", list(sun_body())}};
  out["power"] = {{"charge", p.charge},
                  {"battery_v", p.battery_v},
                  {"battery_a", p.battery_a},
                  {"solar_w", p.solar_w},
                  {"solar_a", p.solar_a},
                  {"bus_v", p.bus_v},
                  {"switches", p.switches},
                  {"load_a", list(p.load_a)},
                  {"charge_limit", power_.charge_limit()},
                  {"undervoltage_trips", p.undervoltage_trips},
                  {"lowest_charge", p.lowest_charge},
                  {"computer_on", p.computer_on},
                  {"cut_outs", p.cut_outs}};
  out["thermal"] = {{"temperature_k", list(thermal_.temperatures_k())},
                    {"heating", {thermal_.heating(0), thermal_.heating(1)}},
                    {"heaters_powered", heaters_on()},
                    {"setpoint_k", {thermal_.setpoint_k(0), thermal_.setpoint_k(1)}}};
  return out;
}

}  // namespace srfs::sim
