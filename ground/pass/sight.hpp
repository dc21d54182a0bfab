// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/time.hpp"
#include "ground/pass/sgp4.hpp"

namespace srfs::ground::pass {

/// A place by WGS-84.
struct Geodetic {
  double latitude_deg = 0;   ///< geodetic, north is positive
  double longitude_deg = 0;  ///< east is positive, -180 to 180
  double height_m = 0;       ///< above the ellipsoid
};

/// Where a spacecraft is, as a station sees it.
struct Sight {
  double azimuth_deg = 0;    ///< from north over east, 0 to below 360
  double elevation_deg = 0;  ///< above the horizon, without refraction
  double range_km = 0;
};

/// Greenwich mean sidereal time, IAU 1982 (Vallado, Fundamentals of Astrodynamics, eq. 3-47). @return rad, 0
/// to below a full turn
[[nodiscard]] double sidereal_time_rad(UtcTime ut1);
/// From TEME into the frame that turns with the Earth. UTC stands for UT1 and the pole does not move: below
/// 0.5 km.
[[nodiscard]] Vector to_earth_fixed(const Vector& teme_km, UtcTime utc);
[[nodiscard]] Vector position_km(const Geodetic& place);
/// The place below a position above the ground.
[[nodiscard]] Geodetic place_of(const Vector& earth_fixed_km);
[[nodiscard]] Sight sight_of(const Vector& earth_fixed_km, const Geodetic& station);

}  // namespace srfs::ground::pass
