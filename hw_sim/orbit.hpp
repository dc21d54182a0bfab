// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "base/time.hpp"

namespace srfs::sim {

inline constexpr double earth_radius_m = 6'378'137.0;          ///< WGS 84, equatorial
inline constexpr double earth_gravity_m3_s2 = 3.986004418e14;  ///< WGS 84
inline constexpr double solar_constant_w_m2 = 1361.0;          ///< at 1 au (Kopp and Lean, 2011)

/// A circular, sun-synchronous low orbit.
struct OrbitSettings {
  double altitude_m = 500e3;
  double inclination_rad = 97.4 * 0.017453292519943295;
  double local_time_of_ascending_node_h = 10.5;  ///< 0-24; fixes the node against the mean sun at the start
  double argument_of_latitude_rad = 0;           ///< at the start, from the ascending node
};

/// Where the satellite is and what it sees there. Inertial frame: mean equator and equinox of date.
struct OrbitState {
  Eigen::Vector3d position_m;
  Eigen::Vector3d velocity_m_s;
  Eigen::Vector3d sun_direction;  ///< unit vector from the Earth to the sun
  Eigen::Vector3d magnetic_field_t;
  bool eclipsed = false;
  double latitude_rad = 0;   ///< geocentric
  double longitude_rad = 0;  ///< east, -pi to pi
};

/// Two-body motion with the secular drift of the node by J2 (Vallado, Fundamentals of Astrodynamics, 9.6),
/// the sun after the Astronomical Almanac's low-precision formula (0.01 deg), a cylindrical shadow, and the
/// Earth's tilted dipole. Pure.
class Orbit {
 public:
  /// @param start  instant at which the settings hold
  Orbit(const OrbitSettings& settings, UtcTime start);

  [[nodiscard]] OrbitState at(UtcTime time) const;
  [[nodiscard]] nanoseconds period() const;
  [[nodiscard]] double altitude_m() const { return settings_.altitude_m; }

 private:
  OrbitSettings settings_;
  UtcTime start_;
  double node_at_start_rad_;
  double radius_m_;
  double mean_motion_rad_s_;
  double node_rate_rad_s_;
};

/// Unit vector from the Earth to the sun.
[[nodiscard]] Eigen::Vector3d sun_direction(UtcTime time);
/// Greenwich mean sidereal time, 0 to 2 pi.
[[nodiscard]] double sidereal_angle_rad(UtcTime time);
/// Behind the Earth, in a shadow with parallel edges.
[[nodiscard]] bool in_cylinder_shadow(const Eigen::Vector3d& position_m,
                                      const Eigen::Vector3d& sun_direction);
/// The dipole terms of IGRF-13, epoch 2020. @param position_m  Earth-fixed  @return tesla, Earth-fixed
[[nodiscard]] Eigen::Vector3d dipole_field_t(const Eigen::Vector3d& position_m);

}  // namespace srfs::sim
