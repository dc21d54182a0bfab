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

}  // namespace
}  // namespace srfs::sim
