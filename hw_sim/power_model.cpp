// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/power_model.hpp"

#include <algorithm>
#include <cmath>

#include "hw_sim/orbit.hpp"

namespace srfs::sim {

double open_circuit_voltage_v(double charge) {
  // One lithium-ion cell with a nickel-rich cathode, every tenth of charge; the usual shape of published
  // curves.
  static constexpr std::array<double, 11> cell_v{3.00, 3.38, 3.50, 3.57, 3.62, 3.68,
                                                 3.77, 3.87, 3.96, 4.06, 4.18};
  const double position = std::clamp(charge, 0.0, 1.0) * 10;
  const std::size_t below = std::min<std::size_t>(9, static_cast<std::size_t>(position));
  const double between = position - static_cast<double>(below);
  return 2 * (cell_v[below] + between * (cell_v[below + 1] - cell_v[below]));
}

PowerModel::PowerModel(const PowerSettings& settings)
    : settings_(settings), charge_limit_(settings.charge_limit) {
  state_.charge = state_.lowest_charge = settings.initial_charge;
  state_.switches = settings.initial_switches;
  solve(last_input_);
}

void PowerModel::switch_load(Load load, bool on) {
  const auto bit = static_cast<std::uint8_t>(1U << static_cast<unsigned>(load));
  state_.switches = static_cast<std::uint8_t>(on ? state_.switches | bit : state_.switches & ~bit);
  solve(last_input_);
}

bool PowerModel::set_charge_limit(double charge) {
  if (!(charge >= 0 && charge <= 1)) return false;
  charge_limit_ = charge;
  solve(last_input_);
  return true;
}

double PowerModel::load_w(Load load) const {
  if (!is_on(load)) return 0;
  const double fixed = settings_.load_w[static_cast<std::size_t>(load)];
  switch (load) {
    case Load::adcs_actuators:
      return fixed + last_input_.actuator_w;
    case Load::heaters:
      return fixed + last_input_.heater_w;
    case Load::camera:
    case Load::transmitter:
      break;
  }
  return fixed;
}

void PowerModel::solve(const PowerInput& input) {
  last_input_ = input;
  double bus_w = base_load_w();
  std::array<double, load_count> watts{};
  for (std::size_t i = 0; i < load_count; ++i) {
    watts[i] = load_w(static_cast<Load>(i));
    bus_w += watts[i];
  }
  state_.bus_v = settings_.bus_v - settings_.bus_resistance_ohm * bus_w / settings_.bus_v;
  for (std::size_t i = 0; i < load_count; ++i) state_.load_a[i] = watts[i] / state_.bus_v;

  Eigen::Matrix<double, 6, 1> lit;
  lit << input.sun_body.cwiseMax(0), (-input.sun_body).cwiseMax(0);
  const Eigen::Matrix<double, 6, 1> towards_sun{lit[0], lit[3], lit[1], lit[4], lit[2], lit[5]};
  const double panels_w = settings_.cells_per_face.dot(towards_sun) * settings_.cell_area_m2 *
                          settings_.cell_efficiency * settings_.tracker_efficiency * solar_constant_w_m2;
  state_.panels_w = panels_w;
  const double demand_w = bus_w / settings_.regulator_efficiency;

  // Cells conduct worse in the cold: about 2 % per kelvin, at most threefold.
  const double cold = std::clamp((298.15 - input.battery_temperature_k) * 0.02, 0.0, 2.0);
  const double resistance_ohm = settings_.resistance_ohm * (1 + cold);
  const double open_v = open_circuit_voltage_v(state_.charge);
  // Charging tapers off over the last two per cent below the limit.
  const double room = std::clamp((charge_limit_ - state_.charge) / 0.02, 0.0, 1.0);
  const bool may_charge = input.battery_temperature_k >= settings_.lowest_charging_k;
  const double largest_charge_w = may_charge ? room * 0.5 * settings_.capacity_a_h * open_v : 0;
  state_.solar_w = std::min(panels_w, demand_w + largest_charge_w);

  // Power into the terminals P = (open + R I) I, solved for I; at most what the battery can give at all.
  const double battery_w = std::max(state_.solar_w - demand_w, -open_v * open_v / (4 * resistance_ohm));
  state_.battery_a =
      (-open_v + std::sqrt(open_v * open_v + 4 * resistance_ohm * battery_w)) / (2 * resistance_ohm);
  state_.battery_v = open_v + resistance_ohm * state_.battery_a;
  state_.solar_a = state_.solar_w / state_.battery_v;
  state_.battery_heat_w = resistance_ohm * state_.battery_a * state_.battery_a;
}

void PowerModel::step(double dt_s, const PowerInput& input) {
  solve(input);
  state_.charge =
      std::clamp(state_.charge + state_.battery_a * dt_s / (settings_.capacity_a_h * 3600), 0.0, 1.0);
  state_.lowest_charge = std::min(state_.lowest_charge, state_.charge);
  protect();
  solve(input);
}

/// What the power supply does by itself, with nobody's help.
void PowerModel::protect() {
  const bool discharging = state_.battery_a < 0;
  if (state_.charge < settings_.undervoltage_charge && state_.switches != 0 && discharging) {
    state_.switches = 0;
    ++state_.undervoltage_trips;
  }
  if (state_.computer_on && state_.charge < settings_.cut_out_charge && discharging) {
    state_.computer_on = false;
    state_.switches = 0;
    ++state_.cut_outs;
  } else if (!state_.computer_on && state_.charge >= settings_.restore_charge) {
    state_.computer_on = true;
    state_.switches = settings_.initial_switches;
  }
}

}  // namespace srfs::sim
