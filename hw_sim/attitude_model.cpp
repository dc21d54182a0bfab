// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/attitude_model.hpp"

#include <algorithm>
#include <cmath>

#include "hw_sim/orbit.hpp"

namespace srfs::sim {
namespace {

constexpr double longest_sub_step_s = 0.02;

/// Scales @p v so that no component exceeds @p limit; keeps its direction.
Eigen::Vector3d limited(const Eigen::Vector3d& v, double limit) {
  const double largest = v.cwiseAbs().maxCoeff();
  return largest > limit ? Eigen::Vector3d(v * (limit / largest)) : v;
}

AttitudeState plus(const AttitudeState& s, const AttitudeState& derivative, double dt_s) {
  AttitudeState next;
  next.attitude.coeffs() = s.attitude.coeffs() + dt_s * derivative.attitude.coeffs();
  next.rate_rad_s = s.rate_rad_s + dt_s * derivative.rate_rad_s;
  next.wheel_momentum_n_m_s = s.wheel_momentum_n_m_s + dt_s * derivative.wheel_momentum_n_m_s;
  return next;
}

}  // namespace

bool AttitudeModel::set_target(const Eigen::Quaterniond& target) {
  const double length = target.norm();
  if (!std::isfinite(length) || length < 1e-6) return false;
  target_ = target.normalized();
  return true;
}

bool AttitudeModel::set_wheel_speed(std::size_t wheel, double speed_rad_s) {
  if (wheel > 2 || !(std::abs(speed_rad_s) <= settings_.wheel_max_speed_rad_s)) return false;
  const auto axis = static_cast<Eigen::Index>(wheel);
  wheel_commanded_[axis] = true;
  wheel_command_rad_s_[axis] = speed_rad_s;
  return true;
}

void AttitudeModel::restart_controller() {
  mode_ = AttitudeMode::idle;
  target_ = Eigen::Quaterniond::Identity();
  wheel_commanded_.setConstant(false);
}

Eigen::Vector3d AttitudeModel::total_momentum_n_m_s() const {
  return state_.attitude *
         (settings_.inertia_kg_m2.cwiseProduct(state_.rate_rad_s) + state_.wheel_momentum_n_m_s);
}

double AttitudeModel::pointing_error_rad() const {
  return 2 * std::acos(std::min(1.0, std::abs(target_.dot(state_.attitude))));
}

Eigen::Vector3d AttitudeModel::pointing_torque_n_m() const {
  // Error in the body frame; the sign takes the short way round.
  Eigen::Quaterniond error = state_.attitude.conjugate() * target_;
  if (error.w() < 0) error.coeffs() = -error.coeffs();
  Eigen::Vector3d rate_command = 2 * settings_.attitude_gain_1_s * error.vec();
  if (rate_command.norm() > settings_.slew_limit_rad_s)
    rate_command *= settings_.slew_limit_rad_s / rate_command.norm();
  const Eigen::Vector3d gyroscopic = state_.rate_rad_s.cross(
      settings_.inertia_kg_m2.cwiseProduct(state_.rate_rad_s) + state_.wheel_momentum_n_m_s);
  const Eigen::Vector3d acceleration = settings_.rate_gain_1_s * (rate_command - state_.rate_rad_s);
  return settings_.inertia_kg_m2.cwiseProduct(acceleration) + gyroscopic;
}

Eigen::Vector3d AttitudeModel::dipole_against(const Eigen::Vector3d& torque_n_m,
                                              const Eigen::Vector3d& field_body_t) const {
  const double strength = field_body_t.squaredNorm();
  if (strength < 1e-14) return Eigen::Vector3d::Zero();
  return limited(field_body_t.cross(torque_n_m) / strength, settings_.torquer_max_dipole_a_m2);
}

void AttitudeModel::command_actuators(double dt_s, const Eigen::Vector3d& field_body_t) {
  Eigen::Vector3d rotor_torque = Eigen::Vector3d::Zero();
  dipole_a_m2_.setZero();
  switch (mode_) {
    case AttitudeMode::idle: {
      const Eigen::Vector3d missing =
          settings_.wheel_inertia_kg_m2 * (wheel_command_rad_s_ - wheel_speed_rad_s()) / dt_s;
      rotor_torque = wheel_commanded_.select(missing.array(), 0.0).matrix();
      break;
    }
    case AttitudeMode::detumble: {
      // B-dot: the dipole opposes the change of the field seen from the body, dB/dt = B x rate.
      const Eigen::Vector3d field_change = field_body_t.cross(state_.rate_rad_s);
      dipole_a_m2_ = limited(-settings_.bdot_gain_a_m2_s_t * field_change, settings_.torquer_max_dipole_a_m2);
      rotor_torque =
          settings_.detumble_rate_gain_1_s * settings_.inertia_kg_m2.cwiseProduct(state_.rate_rad_s);
      break;
    }
    case AttitudeMode::point:
    case AttitudeMode::sun:
      rotor_torque = limited(-pointing_torque_n_m(), settings_.wheel_max_torque_n_m);
      dipole_a_m2_ =
          dipole_against(-settings_.unloading_gain_1_s * state_.wheel_momentum_n_m_s, field_body_t);
      break;
  }
  const double most = settings_.wheel_inertia_kg_m2 * settings_.wheel_max_speed_rad_s;
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double to_limit_up = (most - state_.wheel_momentum_n_m_s[i]) / dt_s;
    const double to_limit_down = (-most - state_.wheel_momentum_n_m_s[i]) / dt_s;
    const double torque =
        std::clamp(rotor_torque[i], -settings_.wheel_max_torque_n_m, settings_.wheel_max_torque_n_m);
    wheel_torque_n_m_[i] = std::clamp(torque, to_limit_down, to_limit_up);
  }
}

AttitudeState AttitudeModel::derivative(const AttitudeState& s,
                                        const AttitudeEnvironment& environment) const {
  const Eigen::Quaterniond to_body = s.attitude.normalized().conjugate();
  Eigen::Vector3d torque = dipole_a_m2_.cross(to_body * environment.magnetic_field_t) - wheel_torque_n_m_ +
                           settings_.disturbance_n_m;
  if (const double radius_m = environment.position_m.norm(); radius_m > 0) {
    const Eigen::Vector3d up = to_body * (environment.position_m / radius_m);
    torque +=
        3 * earth_gravity_m3_s2 / std::pow(radius_m, 3) * up.cross(settings_.inertia_kg_m2.cwiseProduct(up));
  }
  const Eigen::Vector3d momentum =
      settings_.inertia_kg_m2.cwiseProduct(s.rate_rad_s) + s.wheel_momentum_n_m_s;

  AttitudeState d;
  const Eigen::Quaterniond spin(0, s.rate_rad_s.x() / 2, s.rate_rad_s.y() / 2, s.rate_rad_s.z() / 2);
  d.attitude = s.attitude * spin;
  d.rate_rad_s = (torque - s.rate_rad_s.cross(momentum)).cwiseQuotient(settings_.inertia_kg_m2);
  d.wheel_momentum_n_m_s = wheel_torque_n_m_;
  return d;
}

void AttitudeModel::follow_sun(const Eigen::Vector3d& sun_direction) {
  if (sun_direction.squaredNorm() < 0.5) return;
  static const Eigen::Vector3d edge = Eigen::Vector3d(1, 1, 0).normalized();
  const Eigen::Quaterniond turn = Eigen::Quaterniond::FromTwoVectors(state_.attitude * edge, sun_direction);
  target_ = (turn * state_.attitude).normalized();
}

void AttitudeModel::sub_step(double dt_s, const AttitudeEnvironment& environment) {
  if (mode_ == AttitudeMode::sun) follow_sun(environment.sun_direction);
  if (environment.actuators_powered) {
    command_actuators(dt_s, state_.attitude.conjugate() * environment.magnetic_field_t);
  } else {
    wheel_torque_n_m_.setZero();
    dipole_a_m2_.setZero();
  }
  const AttitudeState k1 = derivative(state_, environment);
  const AttitudeState k2 = derivative(plus(state_, k1, dt_s / 2), environment);
  const AttitudeState k3 = derivative(plus(state_, k2, dt_s / 2), environment);
  const AttitudeState k4 = derivative(plus(state_, k3, dt_s), environment);
  AttitudeState next = plus(state_, k1, dt_s / 6);
  next = plus(next, k2, dt_s / 3);
  next = plus(next, k3, dt_s / 3);
  next = plus(next, k4, dt_s / 6);
  next.attitude.normalize();
  state_ = next;
}

void AttitudeModel::step(double dt_s, const AttitudeEnvironment& environment) {
  while (dt_s > 0) {
    const double part_s = std::min(dt_s, longest_sub_step_s);
    sub_step(part_s, environment);
    dt_s -= part_s;
  }
}

}  // namespace srfs::sim
