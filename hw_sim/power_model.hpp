// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

namespace srfs::sim {

inline constexpr std::size_t load_count = 4;
/// Load switches of the power supply.
enum class Load : std::uint8_t { adcs_actuators = 0, heaters = 1, camera = 2, transmitter = 3 };

/// A 2S2P lithium-ion battery, body-mounted triple-junction cells, a regulated 5 V bus.
struct PowerSettings {
  double capacity_a_h = 5.2;
  double initial_charge = 0.75;  ///< 0-1
  double resistance_ohm = 0.08;  ///< at 298 K; rises in the cold
  double cell_area_m2 = 30.18e-4;
  Eigen::Matrix<double, 6, 1> cells_per_face{7, 7, 7, 7, 2, 2};  ///< +X -X +Y -Y +Z -Z
  double cell_efficiency = 0.293;
  double tracker_efficiency = 0.90;    ///< of the maximum power point tracker
  double regulator_efficiency = 0.92;  ///< battery to bus
  double bus_v = 5.0;
  double bus_resistance_ohm = 0.02;
  double base_load_w = 1.3;  ///< computer and power supply, always on
  std::array<double, load_count> load_w{
      0.8, 0.0, 2.6, 1.9};  ///< when switched on; what the heaters draw is set from outside
  std::uint8_t initial_switches = 0b0011;
  double charge_limit = 0.98;
  double lowest_charging_k = 273.15;  ///< the charger refuses a frozen battery
  double undervoltage_charge = 0.05;  ///< all loads are shed below
  double cut_out_charge = 0;          ///< the computer has no power below, until restore_charge; 0: never
  double restore_charge = 0.15;       ///< then it is switched on, with the initial switches
  double off_load_w = 0.05;           ///< of the power supply alone
};

struct PowerInput {
  Eigen::Vector3d sun_body =
      Eigen::Vector3d::Zero();  ///< unit vector to the sun, body frame; zero in eclipse
  double battery_temperature_k = 293;
  double heater_w = 0;    ///< what the heaters ask of their bus
  double actuator_w = 0;  ///< what wheels take above the actuators' standby
};

struct PowerState {
  double charge = 0;     ///< 0-1
  double battery_v = 0;  ///< at the terminals
  double battery_a = 0;  ///< positive: charging
  double solar_w = 0;    ///< taken from the panels, curtailed when the battery wants no more
  double panels_w = 0;   ///< that they could give
  double solar_a = 0;    ///< into the battery's terminals
  double bus_v = 0;
  std::array<double, load_count> load_a{};
  std::uint8_t switches = 0;  ///< bit n: load n is on
  double battery_heat_w = 0;  ///< lost in the internal resistance
  std::uint32_t undervoltage_trips = 0;
  double lowest_charge = 0;  ///< so far
  bool computer_on = true;
  std::uint32_t cut_outs = 0;  ///< times that the computer lost its power
};

/// Coulomb counting behind an open-circuit voltage curve and an internal resistance. Pure; switching a load
/// shows in state() at once, charge follows with step().
class PowerModel {
 public:
  explicit PowerModel(const PowerSettings& settings);

  /// @param dt_s  0 or more; 0 only solves the circuit for @p input
  void step(double dt_s, const PowerInput& input);
  void switch_load(Load load, bool on);
  /// As if it had been charged or discharged to it. @param charge  0-1
  void set_charge(double charge) { state_.charge = charge; }
  /// @return false outside 0-1
  [[nodiscard]] bool set_charge_limit(double charge);

  [[nodiscard]] const PowerState& state() const { return state_; }
  [[nodiscard]] bool is_on(Load load) const {
    return (state_.switches >> static_cast<unsigned>(load) & 1U) != 0;
  }
  [[nodiscard]] double charge_limit() const { return charge_limit_; }
  /// Power of the loads at the bus, without the heaters' if their switch is off.
  [[nodiscard]] double load_w(Load load) const;
  /// Power of what no switch controls.
  [[nodiscard]] double base_load_w() const {
    return state_.computer_on ? settings_.base_load_w : settings_.off_load_w;
  }

 private:
  void solve(const PowerInput& input);
  void protect();

  PowerSettings settings_;
  PowerState state_;
  PowerInput last_input_;
  double charge_limit_;
};

/// Of two cells in series, volts. @param charge 0-1
[[nodiscard]] double open_circuit_voltage_v(double charge);

}  // namespace srfs::sim
