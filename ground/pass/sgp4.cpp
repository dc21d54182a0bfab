// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/pass/sgp4.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace srfs::ground::pass {
namespace {

// WGS-72, which element sets are made with.
constexpr double earth_radius_km = 6378.135;
constexpr double mu_km3_s2 = 398600.8;
constexpr double j2 = 0.001082616;
constexpr double j3 = -0.00000253881;
constexpr double j4 = -0.00000165597;
constexpr double j3_to_j2 = j3 / j2;
constexpr double full_turn = 2 * std::numbers::pi;
constexpr double deep_space_period_min = 225;
constexpr double circular = 1.0e-4;  ///< below it, terms that divide by the eccentricity are left out
constexpr double least_eccentricity = 1e-6;

/// The root of the gravitational parameter, in Earth radii and minutes.
const double ke = 60.0 / std::sqrt(earth_radius_km * earth_radius_km * earth_radius_km / mu_km3_s2);

double square(double x) {
  return x * x;
}

double cube(double x) {
  return x * x * x;
}

double turn_of(double angle) {
  return std::fmod(angle, full_turn);
}

/// Kepler's equation in the elements of Spacetrack Report 3. @return eccentric anomaly plus perigee
double eccentric_longitude(double u, double ax, double ay) {
  double longitude = u;
  for (int i = 0; i < 10; ++i) {
    const double sine = std::sin(longitude);
    const double cosine = std::cos(longitude);
    double step = (u - ay * cosine + ax * sine - longitude) / (1 - cosine * ax - sine * ay);
    step = std::clamp(step, -0.95, 0.95);
    longitude += step;
    if (std::abs(step) < 1e-12) break;
  }
  return longitude;
}

}  // namespace

std::string_view to_text(Sgp4Error error) {
  switch (error) {
    case Sgp4Error::deep_space:
      return "a period of 225 minutes or more: SGP4 is for orbits near the Earth; give a list of times";
    case Sgp4Error::bad_elements:
      return "the elements describe no orbit";
    case Sgp4Error::no_orbit:
      return "so far from their epoch the elements describe no orbit any more";
    case Sgp4Error::decayed:
      return "by these elements the spacecraft has come down";
  }
  return "?";
}

Result<Sgp4, Sgp4Error> Sgp4::of(const TwoLineElements& elements) {
  if (elements.mean_motion_rad_min <= 0 || elements.eccentricity < 0 || elements.eccentricity >= 1)
    return Err(Sgp4Error::bad_elements);
  Sgp4 orbit(elements);
  orbit.cos_i_ = std::cos(elements.inclination_rad);
  orbit.sin_i_ = std::sin(elements.inclination_rad);
  orbit.recover_mean_motion();
  if (full_turn / orbit.motion_ >= deep_space_period_min) return Err(Sgp4Error::deep_space);
  orbit.set_secular_rates();
  orbit.set_drag();
  if (!orbit.low_) orbit.set_higher_drag();
  return orbit;
}

/// Of Kozai's mean motion, which the elements have, Brouwer's.
void Sgp4::recover_mean_motion() {
  const double e = elements_.eccentricity;
  const double kozai = elements_.mean_motion_rad_min;
  const double one_less_e2 = 1 - e * e;
  const double a1 = std::pow(ke / kozai, 2.0 / 3);
  const double d = 0.75 * j2 * (3 * square(cos_i_) - 1) / (std::sqrt(one_less_e2) * one_less_e2);
  const double d1 = d / square(a1);
  const double a0 = a1 * (1 - square(d1) - d1 * (1.0 / 3 + 134 * square(d1) / 81));
  motion_ = kozai / (1 + d / square(a0));
  semi_major_axis_ = std::pow(ke / motion_, 2.0 / 3);
}

/// By the oblateness of the Earth.
void Sgp4::set_secular_rates() {
  const double one_less_e2 = 1 - square(elements_.eccentricity);
  const double beta = std::sqrt(one_less_e2);
  const double theta2 = square(cos_i_);
  const double theta4 = square(theta2);
  const double parameter2 = 1 / square(semi_major_axis_ * one_less_e2);
  const double first = 1.5 * j2 * parameter2 * motion_;
  const double second = 0.5 * first * j2 * parameter2;
  const double fourth = -0.46875 * j4 * square(parameter2) * motion_;
  anomaly_rate_ = motion_ + 0.5 * first * beta * (3 * theta2 - 1) +
                  0.0625 * second * beta * (13 - 78 * theta2 + 137 * theta4);
  perigee_rate_ = -0.5 * first * (1 - 5 * theta2) + 0.0625 * second * (7 - 114 * theta2 + 395 * theta4) +
                  fourth * (3 - 36 * theta2 + 49 * theta4);
  const double node_first = -first * cos_i_;
  node_rate_ = node_first + (0.5 * second * (4 - 19 * theta2) + 2 * fourth * (3 - 7 * theta2)) * cos_i_;
  node_drag_ = 3.5 * one_less_e2 * node_first;  // times c1, which set_drag() knows
  constexpr double least = 1.5e-12;             // at an inclination of 180 degrees
  const double divisor = std::abs(1 + cos_i_) > least ? 1 + cos_i_ : least;
  long_period_l_ = -0.25 * j3_to_j2 * sin_i_ * (3 + 5 * cos_i_) / divisor;
  long_period_y_ = -0.5 * j3_to_j2 * sin_i_;
}

/// By the atmosphere, whose density falls with the fourth power of the height above s.
void Sgp4::set_drag() {
  const double e = elements_.eccentricity;
  const double a = semi_major_axis_;
  const double perigee_km = (a * (1 - e) - 1) * earth_radius_km;
  low_ = perigee_km < 220;
  double s_km = 78;
  if (perigee_km < 156) s_km = perigee_km < 98 ? 20 : perigee_km - 78;
  s_ = s_km / earth_radius_km + 1;
  const double density = square(square((120 - s_km) / earth_radius_km));
  xi_ = 1 / (a - s_);
  eta_ = a * e * xi_;
  const double eta2 = square(eta_);
  const double e_eta = e * eta_;
  const double psi2 = std::abs(1 - eta2);
  const double coefficient = density * square(square(xi_));
  const double coefficient1 = coefficient / std::pow(psi2, 3.5);
  const double x3thm1 = 3 * square(cos_i_) - 1;
  const double one_less_e2 = 1 - e * e;
  const double bstar = elements_.drag_per_earth_radius;
  const double perigee = elements_.argument_of_perigee_rad;
  c1_ = bstar * coefficient1 * motion_ *
        (a * (1 + 1.5 * eta2 + e_eta * (4 + eta2)) +
         0.375 * j2 * xi_ / psi2 * x3thm1 * (8 + 3 * eta2 * (8 + eta2)));
  c4_ = 2 * motion_ * coefficient1 * a * one_less_e2 *
        (eta_ * (2 + 0.5 * eta2) + e * (0.5 + 2 * eta2) -
         j2 * xi_ / (a * psi2) *
             (-3 * x3thm1 * (1 - 2 * e_eta + eta2 * (1.5 - 0.5 * e_eta)) +
              0.75 * square(sin_i_) * (2 * eta2 - e_eta * (1 + eta2)) * std::cos(2 * perigee)));
  c5_ = 2 * coefficient1 * a * one_less_e2 * (1 + 2.75 * (eta2 + e_eta) + e_eta * eta2);
  node_drag_ *= c1_;
  t2_ = 1.5 * c1_;
  if (e <= circular) return;
  const double c3 = -2 * coefficient * xi_ * j3_to_j2 * motion_ * sin_i_ / e;
  perigee_drag_ = bstar * c3 * std::cos(perigee);
  anomaly_drag_ = -2.0 / 3 * coefficient * bstar / e_eta;
}

void Sgp4::set_higher_drag() {
  const double a = semi_major_axis_;
  const double c1_2 = square(c1_);
  d2_ = 4 * a * xi_ * c1_2;
  const double common = d2_ * xi_ * c1_ / 3;
  d3_ = (17 * a + s_) * common;
  d4_ = 0.5 * common * a * xi_ * (221 * a + 31 * s_) * c1_;
  t3_ = d2_ + 2 * c1_2;
  t4_ = 0.25 * (3 * d3_ + c1_ * (12 * d2_ + 10 * c1_2));
  t5_ = 0.2 * (3 * d4_ + 12 * c1_ * d3_ + 6 * square(d2_) + 15 * c1_2 * (2 * d2_ + c1_2));
}

Result<Sgp4::State, Sgp4Error> Sgp4::at(UtcTime time) const {
  return after(std::chrono::duration<double, std::ratio<60>>(time - elements_.epoch).count());
}

Result<Sgp4::State, Sgp4Error> Sgp4::after(double minutes) const {
  const auto mean = mean_after(minutes);
  if (!mean) return Err(mean.error());
  return osculating(*mean);
}

Result<Sgp4::Mean, Sgp4Error> Sgp4::mean_after(double t) const {
  const double bstar = elements_.drag_per_earth_radius;
  const double undisturbed = elements_.mean_anomaly_rad + anomaly_rate_ * t;
  double anomaly = undisturbed;
  double perigee = elements_.argument_of_perigee_rad + perigee_rate_ * t;
  double axis = 1 - c1_ * t;
  double eccentricity = bstar * c4_ * t;
  double longitude = t2_ * t * t;
  if (!low_) {
    const double start = cube(1 + eta_ * std::cos(elements_.mean_anomaly_rad));
    const double shift = perigee_drag_ * t + anomaly_drag_ * (cube(1 + eta_ * std::cos(undisturbed)) - start);
    anomaly += shift;
    perigee -= shift;
    axis -= t * t * (d2_ + t * (d3_ + t * d4_));
    eccentricity += bstar * c5_ * (std::sin(anomaly) - std::sin(elements_.mean_anomaly_rad));
    longitude += t * t * t * (t3_ + t * (t4_ + t * t5_));
  }
  Mean mean;
  mean.semi_major_axis = semi_major_axis_ * square(axis);
  mean.motion = ke / std::pow(mean.semi_major_axis, 1.5);
  mean.eccentricity = elements_.eccentricity - eccentricity;
  if (mean.eccentricity >= 1 || mean.eccentricity < -0.001 || mean.semi_major_axis < 0.95)
    return Err(Sgp4Error::no_orbit);
  mean.eccentricity = std::max(mean.eccentricity, least_eccentricity);
  mean.node = turn_of(elements_.right_ascension_rad + node_rate_ * t + node_drag_ * t * t);
  mean.perigee = turn_of(perigee);
  mean.anomaly = turn_of(anomaly + motion_ * longitude);
  return mean;
}

Result<Sgp4::State, Sgp4Error> Sgp4::osculating(const Mean& mean) const {
  // Long periods.
  const double a = mean.semi_major_axis;
  const double ax = mean.eccentricity * std::cos(mean.perigee);
  const double per_parameter = 1 / (a * (1 - square(mean.eccentricity)));
  const double ay = mean.eccentricity * std::sin(mean.perigee) + per_parameter * long_period_y_;
  const double u = turn_of(mean.anomaly + mean.perigee + per_parameter * long_period_l_ * ax);
  const double longitude = eccentric_longitude(u, ax, ay);
  // Short periods.
  const double sine = std::sin(longitude);
  const double cosine = std::cos(longitude);
  const double e_sine = ax * sine - ay * cosine;
  const double e2 = ax * ax + ay * ay;
  const double parameter = a * (1 - e2);
  if (parameter < 0) return Err(Sgp4Error::no_orbit);
  const double r = a * (1 - ax * cosine - ay * sine);
  const double beta = std::sqrt(1 - e2);
  const double term = e_sine / (1 + beta);
  const double sin_u = a / r * (sine - ay - ax * term);
  const double cos_u = a / r * (cosine - ax + ay * term);
  const double sin_2u = 2 * cos_u * sin_u;
  const double cos_2u = 1 - 2 * square(sin_u);
  const double first = 0.5 * j2 / parameter;
  const double second = first / parameter;
  const double theta2 = square(cos_i_);
  const double x3thm1 = 3 * theta2 - 1;
  const double radius = r * (1 - 1.5 * second * beta * x3thm1) + 0.5 * first * square(sin_i_) * cos_2u;
  const double argument = std::atan2(sin_u, cos_u) - 0.25 * second * (7 * theta2 - 1) * sin_2u;
  const double node = mean.node + 1.5 * second * cos_i_ * sin_2u;
  const double inclination = elements_.inclination_rad + 1.5 * second * cos_i_ * sin_i_ * cos_2u;
  const double radial = std::sqrt(a) * e_sine / r - mean.motion * first * square(sin_i_) * sin_2u / ke;
  const double across =
      std::sqrt(parameter) / r + mean.motion * first * (square(sin_i_) * cos_2u + 1.5 * x3thm1) / ke;
  if (radius < 1) return Err(Sgp4Error::decayed);
  // Along the radius and across it.
  const double sin_argument = std::sin(argument);
  const double cos_argument = std::cos(argument);
  const Vector m{-std::sin(node) * std::cos(inclination), std::cos(node) * std::cos(inclination),
                 std::sin(inclination)};
  const Vector n{std::cos(node), std::sin(node), 0};
  const double km_s = earth_radius_km * ke / 60;
  State state;
  for (std::size_t i = 0; i < 3; ++i) {
    const double along = m.at(i) * sin_argument + n.at(i) * cos_argument;
    const double ahead = m.at(i) * cos_argument - n.at(i) * sin_argument;
    state.position_km.at(i) = radius * along * earth_radius_km;
    state.velocity_km_s.at(i) = (radial * along + across * ahead) * km_s;
  }
  return state;
}

}  // namespace srfs::ground::pass
