// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/orbit.hpp"

#include <cmath>
#include <numbers>

#include <Eigen/Geometry>

namespace srfs::sim {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double degree = pi / 180;
constexpr double j2 = 1.08262668e-3;

/// Days since J2000.0 (2000-01-01 12:00). UTC stands in for UT1 and TT: below the accuracy of the formulas
/// here.
double days_since_j2000(UtcTime time) {
  constexpr double j2000_posix_s = 946'728'000.0;
  return (std::chrono::duration<double>(time.since_epoch()).count() - j2000_posix_s) / 86400.0;
}

double seconds_between(UtcTime later, UtcTime earlier) {
  return std::chrono::duration<double>(later - earlier).count();
}

}  // namespace

Eigen::Vector3d sun_direction(UtcTime time) {
  const double n = days_since_j2000(time);
  const double mean_longitude = (280.460 + 0.9856474 * n) * degree;
  const double mean_anomaly = (357.528 + 0.9856003 * n) * degree;
  const double longitude =
      mean_longitude + (1.915 * std::sin(mean_anomaly) + 0.020 * std::sin(2 * mean_anomaly)) * degree;
  const double obliquity = (23.439 - 4e-7 * n) * degree;
  return {std::cos(longitude), std::cos(obliquity) * std::sin(longitude),
          std::sin(obliquity) * std::sin(longitude)};
}

double sidereal_angle_rad(UtcTime time) {
  const double angle = std::fmod((280.46061837 + 360.98564736629 * days_since_j2000(time)) * degree, 2 * pi);
  return angle < 0 ? angle + 2 * pi : angle;
}

bool in_cylinder_shadow(const Eigen::Vector3d& position_m, const Eigen::Vector3d& sun) {
  const double along = position_m.dot(sun);
  return along < 0 && (position_m - along * sun).norm() < earth_radius_m;
}

Eigen::Vector3d dipole_field_t(const Eigen::Vector3d& position_m) {
  constexpr double reference_radius_m = 6'371'200.0;
  const Eigen::Vector3d moment_t(-1450.9e-9, 4652.5e-9, -29404.8e-9);  // g11, h11, g10
  const Eigen::Vector3d up = position_m.normalized();
  const double scale = std::pow(reference_radius_m / position_m.norm(), 3);
  return scale * (3 * moment_t.dot(up) * up - moment_t);
}

Orbit::Orbit(const OrbitSettings& settings, UtcTime start)
    : settings_(settings), start_(start), radius_m_(earth_radius_m + settings.altitude_m) {
  const Eigen::Vector3d sun = sun_direction(start);
  const double sun_right_ascension = std::atan2(sun.y(), sun.x());
  node_at_start_rad_ = sun_right_ascension + (settings.local_time_of_ascending_node_h - 12) * 15 * degree;
  mean_motion_rad_s_ = std::sqrt(earth_gravity_m3_s2 / std::pow(radius_m_, 3));
  const double flattening = earth_radius_m / radius_m_;
  node_rate_rad_s_ =
      -1.5 * j2 * mean_motion_rad_s_ * flattening * flattening * std::cos(settings.inclination_rad);
}

nanoseconds Orbit::period() const {
  return std::chrono::duration_cast<nanoseconds>(std::chrono::duration<double>(2 * pi / mean_motion_rad_s_));
}

OrbitState Orbit::at(UtcTime time) const {
  const double elapsed_s = seconds_between(time, start_);
  const double u = settings_.argument_of_latitude_rad + std::fmod(mean_motion_rad_s_ * elapsed_s, 2 * pi);
  const Eigen::AngleAxisd node(node_at_start_rad_ + node_rate_rad_s_ * elapsed_s, Eigen::Vector3d::UnitZ());
  const Eigen::AngleAxisd tilt(settings_.inclination_rad, Eigen::Vector3d::UnitX());
  const Eigen::Quaterniond plane = node * tilt;

  OrbitState state;
  state.position_m = plane * Eigen::Vector3d(radius_m_ * std::cos(u), radius_m_ * std::sin(u), 0);
  const double speed_m_s = radius_m_ * mean_motion_rad_s_;
  state.velocity_m_s = plane * Eigen::Vector3d(-speed_m_s * std::sin(u), speed_m_s * std::cos(u), 0);
  state.sun_direction = sim::sun_direction(time);
  state.eclipsed = in_cylinder_shadow(state.position_m, state.sun_direction);

  const Eigen::AngleAxisd earth_rotation(sidereal_angle_rad(time), Eigen::Vector3d::UnitZ());
  const Eigen::Vector3d earth_fixed_m = earth_rotation.inverse() * state.position_m;
  state.magnetic_field_t = earth_rotation * dipole_field_t(earth_fixed_m);
  state.latitude_rad = std::asin(earth_fixed_m.z() / earth_fixed_m.norm());
  state.longitude_rad = std::atan2(earth_fixed_m.y(), earth_fixed_m.x());
  return state;
}

}  // namespace srfs::sim
