// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace srfs::sim {

/// What the attitude control does.
enum class AttitudeMode : std::uint8_t { idle = 0, detumble = 1, point = 2, sun = 3 };

/// A 3U CubeSat of 4 kg with three wheels along its axes and three magnetorquers, of the sizes sold for that
/// class.
struct AttitudeSettings {
  Eigen::Vector3d inertia_kg_m2{0.0400, 0.0385, 0.0080};
  Eigen::Vector3d initial_rate_rad_s{0.020, -0.030, 0.040};
  Eigen::Vector3d initial_wheel_speed_rad_s = Eigen::Vector3d::Zero();
  /// Of drag, sunlight and residual dipole; body frame. What wheels take of it saturates them in the end.
  Eigen::Vector3d disturbance_n_m = Eigen::Vector3d::Zero();
  double wheel_inertia_kg_m2 = 1.72e-5;
  double wheel_max_speed_rad_s = 628;  ///< 6000 rpm: 10.8 mN m s
  double wheel_max_torque_n_m = 1.0e-3;
  double torquer_max_dipole_a_m2 = 0.2;
  double slew_limit_rad_s = 0.08;
  double attitude_gain_1_s = 0.15;  ///< commanded rate per attitude error
  double rate_gain_1_s = 0.6;       ///< commanded angular acceleration per rate error
  double detumble_rate_gain_1_s = 0.08;
  double bdot_gain_a_m2_s_t = 2.0e5;
  double unloading_gain_1_s = 2.0e-3;  ///< momentum dumping by the magnetorquers while pointing
};

/// What acts from outside during a step; inertial frame.
struct AttitudeEnvironment {
  Eigen::Vector3d magnetic_field_t = Eigen::Vector3d::Zero();
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();  ///< zero: no gravity gradient
  bool actuators_powered = true;
  Eigen::Vector3d sun_direction = Eigen::Vector3d::Zero();  ///< unit vector; zero: not in sight
};

struct AttitudeState {
  Eigen::Quaterniond attitude = Eigen::Quaterniond::Identity();    ///< body to inertial, unit
  Eigen::Vector3d rate_rad_s = Eigen::Vector3d::Zero();            ///< body frame
  Eigen::Vector3d wheel_momentum_n_m_s = Eigen::Vector3d::Zero();  ///< spin relative to the body
};

/// Rigid body with three wheels and its control laws: Euler's equation with internal momentum, fourth-order
/// Runge-Kutta, gravity gradient (Wertz, Spacecraft Attitude Determination and Control, 17.2 and 18). Pure.
class AttitudeModel {
 public:
  AttitudeModel(const AttitudeSettings& settings, const AttitudeState& start)
      : settings_(settings), state_(start) {}

  /// @param dt_s  0 or more; taken in sub-steps of at most 20 ms
  void step(double dt_s, const AttitudeEnvironment& environment);

  void set_mode(AttitudeMode mode) { mode_ = mode; }
  /// Normalised here. @return false for a quaternion that is not finite or has no length
  [[nodiscard]] bool set_target(const Eigen::Quaterniond& target);
  /// For mode idle. @param wheel 0-2  @return false beyond the wheel's highest speed
  [[nodiscard]] bool set_wheel_speed(std::size_t wheel, double speed_rad_s);
  /// As if something had pushed it. Body frame.
  void set_rate(const Eigen::Vector3d& rate_rad_s) { state_.rate_rad_s = rate_rad_s; }
  /// The controller restarts: idle, target identity, wheels keep their speed.
  void restart_controller();

  [[nodiscard]] const AttitudeState& state() const { return state_; }
  [[nodiscard]] AttitudeMode mode() const { return mode_; }
  [[nodiscard]] const Eigen::Quaterniond& target() const { return target_; }
  [[nodiscard]] Eigen::Vector3d wheel_speed_rad_s() const {
    return state_.wheel_momentum_n_m_s / settings_.wheel_inertia_kg_m2;
  }
  /// Torque of the wheels in the last sub-step, what their motors exert on the rotors.
  [[nodiscard]] const Eigen::Vector3d& wheel_torque_n_m() const { return wheel_torque_n_m_; }
  /// Angular momentum of body and wheels, inertial frame.
  [[nodiscard]] Eigen::Vector3d total_momentum_n_m_s() const;
  /// Rotation angle between attitude and target, 0 to pi.
  [[nodiscard]] double pointing_error_rad() const;

 private:
  void sub_step(double dt_s, const AttitudeEnvironment& environment);
  /// Mode sun: turns the edge between the large panels towards the sun, the short way; in the dark it stays.
  void follow_sun(const Eigen::Vector3d& sun_direction);
  void command_actuators(double dt_s, const Eigen::Vector3d& field_body_t);
  [[nodiscard]] Eigen::Vector3d pointing_torque_n_m() const;
  [[nodiscard]] Eigen::Vector3d dipole_against(const Eigen::Vector3d& torque_n_m,
                                               const Eigen::Vector3d& field_body_t) const;
  [[nodiscard]] AttitudeState derivative(const AttitudeState& s,
                                         const AttitudeEnvironment& environment) const;

  AttitudeSettings settings_;
  AttitudeState state_;
  AttitudeMode mode_ = AttitudeMode::idle;
  Eigen::Quaterniond target_ = Eigen::Quaterniond::Identity();
  Eigen::Array<bool, 3, 1> wheel_commanded_ = Eigen::Array<bool, 3, 1>::Constant(false);
  Eigen::Vector3d wheel_command_rad_s_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d wheel_torque_n_m_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d dipole_a_m2_ = Eigen::Vector3d::Zero();
};

}  // namespace srfs::sim
