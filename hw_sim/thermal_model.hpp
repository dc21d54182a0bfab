// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

namespace srfs::sim {

inline constexpr std::size_t thermal_node_count = 6;
inline constexpr std::size_t heater_count = 2;
using ThermalVector = Eigen::Matrix<double, 6, 1>;

enum class ThermalNode : std::uint8_t { structure_px = 0, structure_mx, battery, camera, payload, radiator };
enum class HeaterMode : std::uint8_t { off = 0, on = 1, automatic = 2 };

struct HeaterSettings {
  ThermalNode node = ThermalNode::battery;
  double power_w = 0;
  double setpoint_k = 283;
};

/// A 3U CubeSat as six lumped masses. The structure is two halves: +X and -X face, each with half of the
/// other faces.
struct ThermalSettings {
  ThermalVector capacity_j_k{520, 520, 210, 120, 260, 60};
  ThermalVector initial_k{283, 283, 287, 284, 285, 276};
  double face_area_long_m2 = 0.034;   ///< +-X, +-Y
  double face_area_short_m2 = 0.010;  ///< +-Z; the radiator is the -Z face
  double body_absorptance = 0.62;     ///< cells and panels, less what leaves as electricity
  double body_emittance = 0.72;
  double radiator_absorptance = 0.12;
  double radiator_emittance = 0.88;
  double hysteresis_k = 1.0;  ///< a thermostat heats from setpoint - this to setpoint + this
  std::array<HeaterSettings, heater_count> heaters{HeaterSettings{ThermalNode::battery, 1.5, 283},
                                                   HeaterSettings{ThermalNode::camera, 1.0, 278}};
};

struct ThermalInput {
  Eigen::Vector3d sun_body =
      Eigen::Vector3d::Zero();  ///< unit vector to the sun, body frame; zero in eclipse
  Eigen::Vector3d nadir_body = Eigen::Vector3d::UnitX();  ///< unit vector to the Earth, body frame
  double earth_view_factor = 0.86;                        ///< of a plate that faces the Earth: (R / r)^2
  double albedo_cosine = 0;  ///< of the sun's zenith angle below the satellite, 0-1
  ThermalVector dissipation_w = ThermalVector::Zero();  ///< electrical losses in each node
  bool heaters_powered = true;
};

/// Heat balance of six nodes with conduction between them, radiation to space, and input from the sun, the
/// albedo, the Earth and the electronics (Gilmore, Spacecraft Thermal Control Handbook, chapter 2). Pure;
/// explicit steps of <= 2 s.
class ThermalModel {
 public:
  explicit ThermalModel(const ThermalSettings& settings);

  void step(double dt_s, const ThermalInput& input);
  /// @param heater 0-1  @return false for another heater
  [[nodiscard]] bool set_heater(std::size_t heater, HeaterMode mode);
  /// @return false outside 250-320 K
  [[nodiscard]] bool set_setpoint(std::size_t heater, double setpoint_k);
  /// Modes back to automatic, setpoints to their first values.
  void restart_controller();

  [[nodiscard]] double temperature_k(ThermalNode node) const {
    return temperature_k_[static_cast<Eigen::Index>(node)];
  }
  [[nodiscard]] const ThermalVector& temperatures_k() const { return temperature_k_; }
  /// The controller wants heat; it flows only when the heaters are powered.
  [[nodiscard]] bool heating(std::size_t heater) const { return heating_.at(heater); }
  [[nodiscard]] double setpoint_k(std::size_t heater) const { return setpoints_k_.at(heater); }
  /// What the heaters that are switched on by the controller ask of their bus.
  [[nodiscard]] double heater_demand_w() const;

 private:
  void run_thermostats();
  void sub_step(double dt_s, const ThermalInput& input);
  /// Absorbed radiation, W per node.
  [[nodiscard]] ThermalVector absorbed_w(const ThermalInput& input) const;

  ThermalSettings settings_;
  ThermalVector temperature_k_;
  Eigen::Matrix<double, 6, 6> conductance_w_k_ = Eigen::Matrix<double, 6, 6>::Zero();
  ThermalVector radiating_area_m2_ = ThermalVector::Zero();  // times emittance
  std::array<HeaterMode, heater_count> modes_{HeaterMode::automatic, HeaterMode::automatic};
  std::array<double, heater_count> setpoints_k_{};
  std::array<bool, heater_count> heating_{};
};

}  // namespace srfs::sim
