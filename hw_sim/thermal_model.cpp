// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/thermal_model.hpp"

#include <algorithm>
#include <cmath>

#include "hw_sim/orbit.hpp"

namespace srfs::sim {
namespace {

constexpr double stefan_boltzmann_w_m2_k4 = 5.670374419e-8;
constexpr double space_k = 2.725;
constexpr double earth_albedo = 0.30;
constexpr double earth_infrared_w_m2 = 237.0;
constexpr double longest_sub_step_s = 2.0;

constexpr auto index(ThermalNode node) {
  return static_cast<Eigen::Index>(node);
}

}  // namespace

ThermalModel::ThermalModel(const ThermalSettings& settings)
    : settings_(settings), temperature_k_(settings.initial_k) {
  using enum ThermalNode;
  const auto join = [this](ThermalNode a, ThermalNode b, double w_k) {
    conductance_w_k_(index(a), index(b)) = w_k;
    conductance_w_k_(index(b), index(a)) = w_k;
  };
  join(structure_px, structure_mx, 0.90);
  join(structure_px, battery, 0.05);
  join(structure_mx, battery, 0.05);
  join(structure_px, camera, 0.06);
  join(structure_mx, camera, 0.02);
  join(structure_px, payload, 0.10);
  join(structure_mx, payload, 0.10);
  join(payload, radiator, 0.15);
  join(camera, payload, 0.03);

  const double side_m2 =
      settings_.face_area_long_m2 + (2 * settings_.face_area_long_m2 + settings_.face_area_short_m2) / 2;
  radiating_area_m2_[index(structure_px)] = side_m2 * settings_.body_emittance;
  radiating_area_m2_[index(structure_mx)] = side_m2 * settings_.body_emittance;
  radiating_area_m2_[index(radiator)] = settings_.face_area_short_m2 * settings_.radiator_emittance;
  for (std::size_t i = 0; i < heater_count; ++i) setpoints_k_[i] = settings_.heaters[i].setpoint_k;
}

bool ThermalModel::set_heater(std::size_t heater, HeaterMode mode) {
  if (heater >= heater_count) return false;
  modes_[heater] = mode;
  run_thermostats();
  return true;
}

bool ThermalModel::set_setpoint(std::size_t heater, double setpoint_k) {
  if (heater >= heater_count || !(setpoint_k >= 250 && setpoint_k <= 320)) return false;
  setpoints_k_[heater] = setpoint_k;
  run_thermostats();
  return true;
}

void ThermalModel::restart_controller() {
  modes_.fill(HeaterMode::automatic);
  for (std::size_t i = 0; i < heater_count; ++i) setpoints_k_[i] = settings_.heaters[i].setpoint_k;
  run_thermostats();
}

double ThermalModel::heater_demand_w() const {
  double demand_w = 0;
  for (std::size_t i = 0; i < heater_count; ++i) demand_w += heating_[i] ? settings_.heaters[i].power_w : 0;
  return demand_w;
}

void ThermalModel::run_thermostats() {
  for (std::size_t i = 0; i < heater_count; ++i) {
    const double above_k = temperature_k(settings_.heaters[i].node) - setpoints_k_[i];
    switch (modes_[i]) {
      case HeaterMode::off:
        heating_[i] = false;
        break;
      case HeaterMode::on:
        heating_[i] = true;
        break;
      case HeaterMode::automatic:
        if (above_k < -settings_.hysteresis_k) heating_[i] = true;
        if (above_k > settings_.hysteresis_k) heating_[i] = false;
        break;
    }
  }
}

ThermalVector ThermalModel::absorbed_w(const ThermalInput& input) const {
  // Per face in the order +X -X +Y -Y +Z -Z: solar, albedo and infrared flux in W/m2.
  const auto faces = [](const Eigen::Vector3d& direction) {
    Eigen::Matrix<double, 6, 1> cosine;
    cosine << std::max(direction.x(), 0.0), std::max(-direction.x(), 0.0), std::max(direction.y(), 0.0),
        std::max(-direction.y(), 0.0), std::max(direction.z(), 0.0), std::max(-direction.z(), 0.0);
    return cosine;
  };
  const Eigen::Matrix<double, 6, 1> view = faces(input.nadir_body) * input.earth_view_factor;
  const Eigen::Matrix<double, 6, 1> sunlight =
      solar_constant_w_m2 * (faces(input.sun_body) + earth_albedo * input.albedo_cosine * view);
  const Eigen::Matrix<double, 6, 1> infrared = earth_infrared_w_m2 * view;
  const Eigen::Matrix<double, 6, 1> on_body =
      settings_.body_absorptance * sunlight + settings_.body_emittance * infrared;

  const double shared_w =
      (settings_.face_area_long_m2 * (on_body[2] + on_body[3]) + settings_.face_area_short_m2 * on_body[4]) /
      2;
  ThermalVector heat_w = ThermalVector::Zero();
  heat_w[index(ThermalNode::structure_px)] = settings_.face_area_long_m2 * on_body[0] + shared_w;
  heat_w[index(ThermalNode::structure_mx)] = settings_.face_area_long_m2 * on_body[1] + shared_w;
  heat_w[index(ThermalNode::radiator)] =
      settings_.face_area_short_m2 *
      (settings_.radiator_absorptance * sunlight[5] + settings_.radiator_emittance * infrared[5]);
  return heat_w;
}

void ThermalModel::sub_step(double dt_s, const ThermalInput& input) {
  run_thermostats();
  ThermalVector heat_w = absorbed_w(input) + input.dissipation_w;
  for (std::size_t i = 0; i < heater_count; ++i) {
    if (input.heaters_powered && heating_[i])
      heat_w[index(settings_.heaters[i].node)] += settings_.heaters[i].power_w;
  }
  heat_w += conductance_w_k_ * temperature_k_ - conductance_w_k_.rowwise().sum().cwiseProduct(temperature_k_);
  const ThermalVector fourth = temperature_k_.array().pow(4) - std::pow(space_k, 4);
  heat_w -= stefan_boltzmann_w_m2_k4 * radiating_area_m2_.cwiseProduct(fourth);
  temperature_k_ += dt_s * heat_w.cwiseQuotient(settings_.capacity_j_k);
}

void ThermalModel::step(double dt_s, const ThermalInput& input) {
  while (dt_s > 0) {
    const double part_s = std::min(dt_s, longest_sub_step_s);
    sub_step(part_s, input);
    dt_s -= part_s;
  }
  run_thermostats();
}

}  // namespace srfs::sim
