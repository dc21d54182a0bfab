// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/spacecraft_world.hpp"

#include <algorithm>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

namespace srfs::sim {
namespace {

const UtcTime start = *from_iso8601("2026-11-21T08:00:00Z");

TEST(SpacecraftWorld, IsTheSameAgain) {
  SpacecraftWorld first({}, start);
  SpacecraftWorld second({}, start);
  first.step(seconds(3));
  second.step(seconds(3));
  EXPECT_EQ(first.truth(), second.truth());
}

TEST(SpacecraftWorld, StaysInReasonableBoundsForManyOrbits) {
  SpacecraftWorld world({}, start);
  world.attitude().set_mode(AttitudeMode::point);
  double lowest_charge = 1;
  double highest_charge = 0;
  for (int s = 0; s < 95 * 4; ++s) {  // four orbits at the default acceleration
    world.step(seconds(1));
    const ThermalVector& t = world.thermal().temperatures_k();
    ASSERT_GT(t.minCoeff(), 235);
    ASSERT_LT(t.maxCoeff(), 335);
    lowest_charge = std::min(lowest_charge, world.power().state().charge);
    highest_charge = std::max(highest_charge, world.power().state().charge);
  }
  EXPECT_GT(lowest_charge, 0.5);                    // the power budget is positive
  EXPECT_GT(highest_charge - lowest_charge, 0.01);  // the eclipses have a visible effect
}

TEST(SpacecraftWorld, MovesTheOrbitFasterThanTheAttitude) {
  SpacecraftWorld world({}, start);
  world.step(seconds(10));
  EXPECT_NEAR(static_cast<double>((world.orbit_time() - start).count()) * 1e-9, 600, 1e-3);
}

TEST(SpacecraftWorld, AHeaterDrawsFromTheBatteryAndWarmsIt) {
  SpacecraftWorld heated({}, start);
  SpacecraftWorld plain({}, start);
  ASSERT_TRUE(heated.thermal().set_heater(0, HeaterMode::on));
  ASSERT_TRUE(plain.thermal().set_heater(0, HeaterMode::off));
  heated.settle();
  EXPECT_LT(heated.power().state().battery_a, plain.power().state().battery_a - 0.1);  // at once
  heated.step(seconds(10));
  plain.step(seconds(10));
  EXPECT_LT(heated.power().state().charge, plain.power().state().charge);
  EXPECT_GT(heated.thermal().temperature_k(ThermalNode::battery),
            plain.thermal().temperature_k(ThermalNode::battery) + 2);
}

TEST(SpacecraftWorld, TheHeaterBusIsALoadSwitch) {
  SpacecraftWorld world({}, start);
  ASSERT_TRUE(world.thermal().set_heater(0, HeaterMode::on));
  world.settle();
  EXPECT_GT(world.power().state().load_a[1], 0.25);
  world.power().switch_load(Load::heaters, false);
  world.settle();
  EXPECT_EQ(world.power().state().load_a[1], 0);
}

TEST(SpacecraftWorld, ACameraThatIsOnWarmsItself) {
  SpacecraftWorld on({}, start);
  SpacecraftWorld off({}, start);
  on.power().switch_load(Load::camera, true);
  on.step(seconds(10));
  off.step(seconds(10));
  EXPECT_GT(on.thermal().temperature_k(ThermalNode::camera),
            off.thermal().temperature_k(ThermalNode::camera) + 1);
}

TEST(SpacecraftWorld, SaysNoSunInEclipse) {
  SpacecraftWorld world({}, start);
  int dark = 0;
  for (int s = 0; s < 95; ++s) {
    world.step(seconds(1));
    const bool no_sun = world.sun_body().norm() == 0;
    ASSERT_EQ(no_sun, world.orbit().eclipsed);
    dark += no_sun ? 1 : 0;
  }
  EXPECT_GT(dark, 25);
  EXPECT_LT(dark, 40);
}

WorldSettings that_can_be_lost() {
  WorldSettings settings;
  settings.power.initial_charge = 0.76;
  settings.power.initial_switches = 0b1111;
  settings.power.undervoltage_charge = 0;  // nothing but the computer protects the battery
  settings.power.cut_out_charge = 0.037;
  return settings;
}

TEST(SpacecraftWorld, IsLostWithAllLoadsOnWhenNothingShedsThem) {
  SpacecraftWorld world(that_can_be_lost(), start);
  for (int s = 0; s < 95 * 12 && world.power().state().cut_outs == 0; ++s) world.step(seconds(1));
  EXPECT_EQ(world.power().state().cut_outs, 1U);
}

TEST(SpacecraftWorld, ComesBackWhenTheBatteryIsChargedAgainThoughItFroze) {
  SpacecraftWorld world(that_can_be_lost(), start);
  for (int s = 0; s < 95 * 12 && world.power().state().computer_on; ++s) world.step(seconds(1));
  ASSERT_FALSE(world.power().state().computer_on);
  world.set_heaters_powered(false);
  for (int s = 0; s < 95 * 40 && !world.power().state().computer_on; ++s) world.step(seconds(1));
  EXPECT_TRUE(world.power().state().computer_on);
  EXPECT_GE(world.power().state().charge, 0.15);
}

TEST(SpacecraftWorld, SurvivesWhenCameraAndTransmitterAreShedInTime) {
  SpacecraftWorld world(that_can_be_lost(), start);
  bool safe = false;
  double highest_after = 0;
  for (int s = 0; s < 95 * 24; ++s) {
    world.step(seconds(1));
    if (world.power().state().charge < 0.35) safe = true;
    if (safe) {
      world.power().switch_load(Load::camera, false);
      world.power().switch_load(Load::transmitter, false);
      world.attitude().set_mode(AttitudeMode::sun);
      highest_after = std::max(highest_after, world.power().state().charge);
    }
  }
  EXPECT_TRUE(safe);
  EXPECT_EQ(world.power().state().cut_outs, 0U);
  EXPECT_GT(world.power().state().lowest_charge, 0.20);
  EXPECT_GT(highest_after, 0.55);
}

TEST(SpacecraftWorld, FreezesItsBatteryWithoutHeatersInALongNight) {
  WorldSettings settings = that_can_be_lost();
  settings.power.initial_switches = 0b0000;
  settings.power.capacity_a_h = 2.6;
  settings.thermal.initial_k[static_cast<Eigen::Index>(ThermalNode::battery)] = 274;
  WorldSettings heated = settings;
  heated.power.initial_switches = 0b0010;
  SpacecraftWorld cold(settings, start);
  SpacecraftWorld warm(heated, start);
  double coldest = 400;
  double coldest_heated = 400;
  for (int s = 0; s < 95 * 4; ++s) {
    cold.step(seconds(1));
    warm.step(seconds(1));
    coldest = std::min(coldest, cold.thermal().temperature_k(ThermalNode::battery));
    coldest_heated = std::min(coldest_heated, warm.thermal().temperature_k(ThermalNode::battery));
  }
  EXPECT_LT(coldest, 273.15);  // it cannot be charged
  EXPECT_GT(coldest_heated, coldest);
}

TEST(SpacecraftWorld, HasNoEclipseWhenTheSunStandsHighAboveThePlane) {
  WorldSettings settings;
  settings.orbit.local_time_of_ascending_node_h = 6;
  SpacecraftWorld dawn(settings, *from_iso8601("2026-03-21T08:00:00Z"));
  bool eclipsed = false;
  for (int s = 0; s < 95; ++s) {
    dawn.step(seconds(1));
    eclipsed = eclipsed || dawn.orbit().eclipsed;
  }
  EXPECT_FALSE(eclipsed);
  EXPECT_GT(std::abs(dawn.truth()["orbit"]["beta_deg"].get<double>()), 70);
}

}  // namespace
}  // namespace srfs::sim
