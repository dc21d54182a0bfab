// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "hw_sim/attitude_model.hpp"
#include "hw_sim/orbit.hpp"
#include "hw_sim/power_model.hpp"
#include "hw_sim/thermal_model.hpp"

namespace srfs::sim {
namespace {

constexpr double degree = 0.017453292519943295;
const UtcTime equinox = *from_iso8601("2026-03-20T14:46:00Z");

TEST(Orbit, TakesAboutNinetyFourMinutesAtFiveHundredKilometres) {
  const Orbit orbit({}, equinox);
  EXPECT_NEAR(std::chrono::duration<double>(orbit.period()).count(), 5677, 5);
}

TEST(Orbit, KeepsRadiusAndCircularSpeed) {
  const Orbit orbit({}, equinox);
  for (int minute = 0; minute < 95; minute += 5) {
    const OrbitState s = orbit.at(equinox + seconds(60 * minute));
    EXPECT_NEAR(s.position_m.norm(), earth_radius_m + 500e3, 1);
    EXPECT_NEAR(s.velocity_m_s.norm(), 7612.6, 1);
    EXPECT_NEAR(s.position_m.normalized().dot(s.velocity_m_s.normalized()), 0, 1e-9);
  }
}

TEST(Orbit, IsInShadowForAboutAThirdOfEachRevolution) {
  const Orbit orbit({}, equinox);
  const std::int64_t period_s = orbit.period() / seconds(1);
  int dark = 0;
  for (std::int64_t s = 0; s < period_s; s += 10) dark += orbit.at(equinox + seconds(s)).eclipsed ? 1 : 0;
  const double fraction = 10.0 * dark / static_cast<double>(period_s);
  EXPECT_GT(fraction, 0.30);
  EXPECT_LT(fraction, 0.40);
}

TEST(Orbit, HasNoShadowOverTheTerminator) {
  OrbitSettings dawn_dusk;
  dawn_dusk.local_time_of_ascending_node_h = 6;
  const Orbit orbit(dawn_dusk, equinox);
  for (int s = 0; s < 5700; s += 10) EXPECT_FALSE(orbit.at(equinox + seconds(s)).eclipsed);
}

TEST(Orbit, StaysSynchronousWithTheSun) {
  // The node turns with the mean sun: 360 degrees per year.
  const Orbit orbit({}, equinox);
  const auto normal = [&](UtcTime t) {
    const OrbitState s = orbit.at(t);
    return s.position_m.cross(s.velocity_m_s).normalized().eval();
  };
  const Eigen::Vector3d before = normal(equinox);
  const Eigen::Vector3d after = normal(equinox + std::chrono::hours(24 * 10));
  const double turned = std::atan2(after.y(), after.x()) - std::atan2(before.y(), before.x());
  EXPECT_NEAR(std::remainder(turned, 2 * M_PI) / degree, 9.86, 0.15);
}

TEST(Sun, StandsAtTheVernalPointAtTheEquinoxAndHighInJune) {
  EXPECT_NEAR(sun_direction(equinox).x(), 1, 1e-4);
  const Eigen::Vector3d solstice = sun_direction(*from_iso8601("2026-06-21T08:25:00Z"));
  EXPECT_NEAR(std::asin(solstice.z()) / degree, 23.43, 0.02);
  EXPECT_NEAR(solstice.norm(), 1, 1e-12);
}

TEST(SiderealTime, AgreesWithTheAlmanac) {
  // GMST at 2000-01-01 12:00 UT1 is 18 h 41 min 50.548 s.
  EXPECT_NEAR(sidereal_angle_rad(*from_iso8601("2000-01-01T12:00:00Z")) / degree, 280.4606, 0.001);
}

TEST(DipoleField, PointsNorthAtTheEquatorAndDownInTheNorth) {
  const Eigen::Vector3d equator = dipole_field_t({earth_radius_m, 0, 0});
  EXPECT_NEAR(equator.z(), 29.4e-6, 0.5e-6);
  const Eigen::Vector3d pole = dipole_field_t({0, 0, earth_radius_m});
  EXPECT_NEAR(pole.z(), -58.6e-6, 1e-6);
}

AttitudeState tumbling() {
  AttitudeState s;
  s.rate_rad_s = {0.02, -0.03, 0.04};
  return s;
}

TEST(Attitude, KeepsItsQuaternionAUnit) {
  AttitudeModel model({}, tumbling());
  for (int i = 0; i < 1000; ++i) {
    model.step(0.1, {});
    ASSERT_NEAR(model.state().attitude.norm(), 1, 1e-12);
  }
}

TEST(Attitude, ConservesMomentumAndEnergyWithoutTorque) {
  const AttitudeSettings settings;
  AttitudeModel model(settings, tumbling());
  const auto energy = [&] {
    const Eigen::Vector3d w = model.state().rate_rad_s;
    return 0.5 * w.dot(settings.inertia_kg_m2.cwiseProduct(w));
  };
  const Eigen::Vector3d momentum = model.total_momentum_n_m_s();
  const double kinetic = energy();
  model.step(600, {});
  EXPECT_LT((model.total_momentum_n_m_s() - momentum).norm() / momentum.norm(), 1e-6);
  EXPECT_NEAR(energy() / kinetic, 1, 1e-6);
}

TEST(Attitude, WheelsTakeMomentumWithoutChangingTheTotal) {
  AttitudeModel model({}, {});
  ASSERT_TRUE(model.set_wheel_speed(2, 300));
  model.step(10, {});
  EXPECT_NEAR(model.wheel_speed_rad_s().z(), 300, 1e-6);
  EXPECT_LT(model.state().rate_rad_s.z(), -0.5);  // the body turns in the opposite direction
  EXPECT_LT(model.total_momentum_n_m_s().norm(), 1e-9);
}

TEST(Attitude, DetumblesWithinTwoMinutes) {
  AttitudeModel model({}, tumbling());
  model.set_mode(AttitudeMode::detumble);
  AttitudeEnvironment environment;
  environment.magnetic_field_t = {2e-5, 1e-5, 3e-5};
  model.step(120, environment);
  EXPECT_LT(model.state().rate_rad_s.norm(), 0.002);
}

TEST(Attitude, DetumblesSlowlyWithTheMagnetorquersAlone) {
  AttitudeSettings settings;
  settings.detumble_rate_gain_1_s = 0;
  AttitudeModel model(settings, tumbling());
  model.set_mode(AttitudeMode::detumble);
  AttitudeEnvironment environment;
  environment.magnetic_field_t = {2e-5, 1e-5, 3e-5};
  const double before = model.state().rate_rad_s.norm();
  model.step(60, environment);
  EXPECT_LT(model.state().rate_rad_s.norm(), before);
}

TEST(Attitude, PointsAtItsTargetTheShortWayAndStays) {
  AttitudeModel model({}, tumbling());
  ASSERT_TRUE(model.set_target(Eigen::Quaterniond(0.1, -2, 1, 0.5)));  // normalised by the model
  model.set_mode(AttitudeMode::point);
  AttitudeEnvironment environment;
  environment.magnetic_field_t = {2e-5, 1e-5, 3e-5};
  environment.position_m = {6.9e6, 0, 0};
  model.step(120, environment);
  for (int i = 0; i < 60; ++i) {
    model.step(1, environment);
    EXPECT_LT(model.pointing_error_rad(), 0.2 * degree);
  }
  EXPECT_LT(model.wheel_speed_rad_s().cwiseAbs().maxCoeff(), 628);
}

TEST(Attitude, ADisturbanceSaturatesTheWheelsWhereTheTorquersAreTooWeak) {
  AttitudeSettings settings;
  settings.disturbance_n_m = {2e-4, 0, 0};
  AttitudeModel model(settings, {});
  model.set_mode(AttitudeMode::point);
  AttitudeEnvironment environment;
  environment.magnetic_field_t = {2e-5, 1e-5, 3e-5};
  model.step(30, environment);
  EXPECT_LT(model.pointing_error_rad(), 0.1);

  model.step(200, environment);

  EXPECT_NEAR(model.wheel_speed_rad_s().cwiseAbs().maxCoeff(), settings.wheel_max_speed_rad_s, 20);
  EXPECT_GT(model.state().rate_rad_s.norm(), 0.05);  // it tumbles
}

TEST(Attitude, TurnsItsLargePanelsToTheSunAndStaysInTheDark) {
  AttitudeModel model({}, tumbling());
  model.set_mode(AttitudeMode::sun);
  AttitudeEnvironment environment;
  environment.magnetic_field_t = {2e-5, 1e-5, 3e-5};
  environment.sun_direction = Eigen::Vector3d(-0.3, 0.2, 0.9).normalized();
  model.step(180, environment);
  const auto towards_sun = [&, sun = environment.sun_direction] {
    return (model.state().attitude * Eigen::Vector3d(1, 1, 0).normalized()).dot(sun);
  };
  EXPECT_GT(towards_sun(), 0.99);
  environment.sun_direction = Eigen::Vector3d::Zero();
  model.step(300, environment);
  EXPECT_GT(towards_sun(), 0.99);
}

TEST(Attitude, DoesNothingWithoutPowerForItsActuators) {
  AttitudeModel model({}, tumbling());
  model.set_mode(AttitudeMode::detumble);
  AttitudeEnvironment environment;
  environment.actuators_powered = false;
  const double momentum = model.total_momentum_n_m_s().norm();
  model.step(30, environment);
  EXPECT_NEAR(model.total_momentum_n_m_s().norm() / momentum, 1, 1e-6);
  EXPECT_EQ(model.wheel_speed_rad_s().norm(), 0);
}

TEST(Attitude, RefusesATargetWithoutLengthAndAWheelBeyondItsLimit) {
  AttitudeModel model({}, {});
  EXPECT_FALSE(model.set_target(Eigen::Quaterniond(0, 0, 0, 0)));
  EXPECT_FALSE(model.set_target(Eigen::Quaterniond(std::numeric_limits<double>::quiet_NaN(), 0, 0, 1)));
  EXPECT_FALSE(model.set_wheel_speed(0, 700));
  EXPECT_FALSE(model.set_wheel_speed(3, 1));
  EXPECT_FALSE(model.set_wheel_speed(0, std::numeric_limits<double>::quiet_NaN()));
}

PowerInput sunlit() {
  PowerInput input;
  input.sun_body = Eigen::Vector3d::UnitX();
  return input;
}

TEST(Power, DrainsTheBatteryInEclipseAndChargesItInTheSun) {
  PowerModel power({});
  power.step(600, {});
  EXPECT_LT(power.state().battery_a, 0);
  EXPECT_EQ(power.state().solar_a, 0);
  const double after_eclipse = power.state().charge;
  EXPECT_LT(after_eclipse, 0.75);

  power.step(600, sunlit());
  EXPECT_GT(power.state().battery_a, 0);
  EXPECT_GT(power.state().charge, after_eclipse);
}

TEST(Power, ShowsASwitchedLoadAtOnce) {
  PowerModel power({});
  power.step(1, {});
  const PowerState before = power.state();
  ASSERT_EQ(before.load_a[2], 0);

  power.switch_load(Load::camera, true);

  EXPECT_NEAR(power.state().load_a[2], 2.6 / 5, 0.02);
  EXPECT_LT(power.state().battery_a, before.battery_a - 0.3);
  EXPECT_LT(power.state().battery_v, before.battery_v);
  EXPECT_EQ(power.state().switches, before.switches | 4);
}

TEST(Power, BalancesItsTerminals) {
  const PowerSettings settings;
  PowerModel power(settings);
  power.switch_load(Load::transmitter, true);
  power.step(0, sunlit());
  const PowerState& s = power.state();
  const double loads_w =
      settings.base_load_w + power.load_w(Load::adcs_actuators) + power.load_w(Load::transmitter);
  EXPECT_NEAR(s.battery_v * s.battery_a, s.solar_w - loads_w / settings.regulator_efficiency, 1e-9);
  EXPECT_NEAR(s.battery_v, open_circuit_voltage_v(s.charge) + settings.resistance_ohm * 1.103 * s.battery_a,
              1e-3);
}

TEST(Power, StopsChargingAtTheLimit) {
  PowerModel power({});
  ASSERT_TRUE(power.set_charge_limit(0.76));
  for (int i = 0; i < 3600; ++i) power.step(10, sunlit());
  EXPECT_LE(power.state().charge, 0.761);
  EXPECT_NEAR(power.state().battery_a, 0, 0.05);
  EXPECT_FALSE(power.set_charge_limit(1.2));
  EXPECT_FALSE(power.set_charge_limit(std::numeric_limits<double>::quiet_NaN()));
}

TEST(Power, DoesNotChargeAFrozenBattery) {
  PowerModel power({});
  PowerInput input = sunlit();
  input.battery_temperature_k = 270;
  power.step(60, input);
  EXPECT_LE(power.state().battery_a, 1e-9);
}

TEST(Power, ShedsItsLoadsWhenNearlyEmpty) {
  PowerSettings settings;
  settings.initial_charge = 0.06;
  PowerModel power(settings);
  power.switch_load(Load::camera, true);
  for (int i = 0; i < 600; ++i) power.step(10, {});
  EXPECT_EQ(power.state().switches, 0);
  EXPECT_EQ(power.state().undervoltage_trips, 1U);
}

TEST(Power, CutsTheComputerOffWhenEmptyAndSwitchesItOnWhenCharged) {
  PowerSettings settings;
  settings.initial_charge = 0.04;
  settings.cut_out_charge = 0.03;
  settings.restore_charge = 0.10;
  PowerModel power(settings);
  while (power.state().computer_on) power.step(10, {});
  EXPECT_EQ(power.state().switches, 0);
  EXPECT_NEAR(power.state().charge, 0.03, 0.001);
  EXPECT_LT(power.base_load_w(), 0.1);

  while (!power.state().computer_on && power.state().charge < 0.2) power.step(10, sunlit());

  EXPECT_NEAR(power.state().charge, 0.10, 0.001);
  EXPECT_EQ(power.state().switches, settings.initial_switches);
  EXPECT_EQ(power.state().cut_outs, 1U);
  EXPECT_NEAR(power.state().lowest_charge, 0.03, 0.001);
}

TEST(Power, NeverCutsTheComputerOffByDefault) {
  PowerSettings settings;
  settings.initial_charge = 0.01;
  PowerModel power(settings);
  for (int i = 0; i < 3600; ++i) power.step(10, {});
  EXPECT_EQ(power.state().charge, 0);
  EXPECT_TRUE(power.state().computer_on);
}

TEST(Power, HasARisingOpenCircuitVoltage) {
  for (int percent = 0; percent < 100; ++percent) {
    const double charge = percent / 100.0;
    EXPECT_LT(open_circuit_voltage_v(charge), open_circuit_voltage_v(charge + 0.01));
  }
}

TEST(Thermal, CoolsInTheDarkAndWarmsInTheSun) {
  ThermalModel dark({});
  ThermalModel lit({});
  ThermalInput sun;
  sun.sun_body = Eigen::Vector3d::UnitX();
  dark.step(1800, {});
  lit.step(1800, sun);
  EXPECT_LT(dark.temperature_k(ThermalNode::structure_px), 283);
  EXPECT_GT(lit.temperature_k(ThermalNode::structure_px), 283);
  EXPECT_GT(lit.temperature_k(ThermalNode::structure_px), lit.temperature_k(ThermalNode::structure_mx));
}

TEST(Thermal, AHeaterWarmsItsNode) {
  ThermalModel with({});
  ThermalModel without({});
  ASSERT_TRUE(with.set_heater(0, HeaterMode::on));
  ASSERT_TRUE(without.set_heater(0, HeaterMode::off));
  with.step(600, {});
  without.step(600, {});
  EXPECT_GT(with.temperature_k(ThermalNode::battery), without.temperature_k(ThermalNode::battery) + 3);
  EXPECT_GT(with.heater_demand_w(), 1.4);
}

TEST(Thermal, AHeaterWithoutPowerWarmsNothing) {
  ThermalModel with({});
  ThermalModel without({});
  ASSERT_TRUE(with.set_heater(0, HeaterMode::on));
  ASSERT_TRUE(without.set_heater(0, HeaterMode::off));
  ThermalInput input;
  input.heaters_powered = false;
  with.step(600, input);
  without.step(600, input);
  EXPECT_DOUBLE_EQ(with.temperature_k(ThermalNode::battery), without.temperature_k(ThermalNode::battery));
}

TEST(Thermal, AThermostatHoldsItsSetpoint) {
  ThermalModel thermal({});
  ASSERT_TRUE(thermal.set_setpoint(0, 288));
  ThermalInput some_sun;
  some_sun.sun_body = Eigen::Vector3d::UnitY();
  thermal.step(3600, some_sun);
  for (int i = 0; i < 600; ++i) {
    thermal.step(10, some_sun);
    ASSERT_NEAR(thermal.temperature_k(ThermalNode::battery), 288, 1.5);
  }
}

TEST(Thermal, RefusesSetpointsOutsideItsRangeAndOtherHeaters) {
  ThermalModel thermal({});
  EXPECT_FALSE(thermal.set_setpoint(0, 249));
  EXPECT_FALSE(thermal.set_setpoint(0, std::numeric_limits<double>::quiet_NaN()));
  EXPECT_FALSE(thermal.set_setpoint(2, 290));
  EXPECT_FALSE(thermal.set_heater(2, HeaterMode::on));
}

}  // namespace
}  // namespace srfs::sim
