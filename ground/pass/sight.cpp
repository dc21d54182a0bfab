// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/pass/sight.hpp"

#include <cmath>
#include <numbers>

namespace srfs::ground::pass {
namespace {

constexpr double radian = std::numbers::pi / 180;
constexpr double full_turn = 2 * std::numbers::pi;
// WGS-84.
constexpr double equator_km = 6378.137;
constexpr double flattening = 1 / 298.257223563;
constexpr double eccentricity2 = flattening * (2 - flattening);
constexpr UtcTime j2000{seconds(946'728'000)};  // 2000-01-01T12:00:00
constexpr double century_s = 36525.0 * 86400;

/// Of the curvature across the meridian.
double curvature_km(double latitude_rad) {
  return equator_km / std::sqrt(1 - eccentricity2 * std::pow(std::sin(latitude_rad), 2));
}

/// @param angle from a full turn below 0. @return 0 to below the turn, which a sum with a tiny negative angle
/// would be rounded to
double positive(double angle, double turn) {
  const double sum = angle < 0 ? angle + turn : angle;
  return sum < turn ? sum : 0;
}

}  // namespace

double sidereal_time_rad(UtcTime ut1) {
  const double t = std::chrono::duration<double>(ut1 - j2000).count() / century_s;
  const double time_s =
      67310.54841 + (876600.0 * 3600 + 8640184.812866) * t + 0.093104 * t * t - 6.2e-6 * t * t * t;
  return positive(std::fmod(time_s / 86400 * full_turn, full_turn), full_turn);
}

Vector to_earth_fixed(const Vector& teme_km, UtcTime utc) {
  const double angle = sidereal_time_rad(utc);
  const double c = std::cos(angle);
  const double s = std::sin(angle);
  return {c * teme_km[0] + s * teme_km[1], c * teme_km[1] - s * teme_km[0], teme_km[2]};
}

Vector position_km(const Geodetic& place) {
  const double latitude = place.latitude_deg * radian;
  const double longitude = place.longitude_deg * radian;
  const double height = place.height_m / 1000;
  const double n = curvature_km(latitude);
  const double across = (n + height) * std::cos(latitude);
  return {across * std::cos(longitude), across * std::sin(longitude),
          (n * (1 - eccentricity2) + height) * std::sin(latitude)};
}

Geodetic place_of(const Vector& earth_fixed_km) {
  const auto [x, y, z] = earth_fixed_km;
  const double across = std::hypot(x, y);
  double latitude = std::atan2(z, across * (1 - eccentricity2));
  for (int i = 0; i < 5; ++i)  // above the ground it converges by a factor of 300 each time
    latitude = std::atan2(z + curvature_km(latitude) * eccentricity2 * std::sin(latitude), across);
  const double height =
      across * std::cos(latitude) + z * std::sin(latitude) - equator_km * equator_km / curvature_km(latitude);
  return {latitude / radian, std::atan2(y, x) / radian, height * 1000};
}

Sight sight_of(const Vector& earth_fixed_km, const Geodetic& station) {
  const Vector from = position_km(station);
  const Vector d{earth_fixed_km[0] - from[0], earth_fixed_km[1] - from[1], earth_fixed_km[2] - from[2]};
  const double latitude = station.latitude_deg * radian;
  const double longitude = station.longitude_deg * radian;
  const double out = std::cos(longitude) * d[0] + std::sin(longitude) * d[1];
  const double east = std::cos(longitude) * d[1] - std::sin(longitude) * d[0];
  const double north = std::cos(latitude) * d[2] - std::sin(latitude) * out;
  const double up = std::cos(latitude) * out + std::sin(latitude) * d[2];
  return {.azimuth_deg = positive(std::atan2(east, north) / radian, 360),
          .elevation_deg = std::atan2(up, std::hypot(east, north)) / radian,
          .range_km = std::hypot(up, std::hypot(east, north))};
}

}  // namespace srfs::ground::pass
