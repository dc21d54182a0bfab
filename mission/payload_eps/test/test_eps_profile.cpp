// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include <mission/structures.hpp>

#include "eps_profile.hpp"

namespace srfs {
namespace {

mission::EpsMeasurement discharging() {
  mission::EpsMeasurement m;
  m.battery_voltage_v = 7.5F;
  m.battery_current_a = -0.5F;
  m.state_of_charge = 0.5F;
  m.solar_current_a = 0.2F;
  m.bus_voltage_v = 8.0F;
  m.load_switches = 0x3;
  return m;
}

TEST(EpsProfile, GivesPowersAndTheTimeToEmpty) {
  EpsProfile profile;
  const auto processed = profile.process(discharging().encoded(), 7, {});
  ASSERT_TRUE(processed.has_value());
  const auto hk = mission::PayloadEpsHousekeeping::decode(processed->housekeeping).value();
  EXPECT_FLOAT_EQ(hk.battery_power_w, -3.75F);
  EXPECT_FLOAT_EQ(hk.solar_power_w, 1.6F);
  EXPECT_FLOAT_EQ(hk.time_to_empty_s, 0.5F * EpsProfile::battery_capacity_ah * 3600.0F / 0.5F);
  EXPECT_EQ(hk.cycle, 7U);
}

TEST(EpsProfile, KnowsNoTimeToEmptyWhileCharging) {
  EXPECT_TRUE(std::isnan(time_to_empty_s(0.5F, 0.3F, 5)));
  EXPECT_TRUE(std::isnan(time_to_empty_s(0.5F, 0.0F, 5)));
  EXPECT_TRUE(std::isnan(time_to_empty_s(0.5F, std::nanf(""), 5)));
  EXPECT_FLOAT_EQ(time_to_empty_s(-0.1F, -1, 5), 0);
}

TEST(EpsProfile, ReportsALowBatteryOnceWithHysteresis) {
  EpsProfile profile;
  mission::EpsMeasurement m = discharging();
  const auto events = [&](float charge) {
    m.state_of_charge = charge;
    return profile.process(m.encoded(), 1, {})->events;
  };
  EXPECT_TRUE(events(0.31F).empty());
  ASSERT_EQ(events(0.29F).size(), 1U);
  EXPECT_TRUE(events(0.28F).empty());
  EXPECT_TRUE(events(0.33F).empty());
  ASSERT_EQ(events(0.36F).size(), 1U);
}

TEST(EpsProfile, ReportsChangedLoads) {
  EpsProfile profile;
  mission::EpsMeasurement m = discharging();
  EXPECT_TRUE(profile.process(m.encoded(), 1, {})->events.empty());
  m.load_switches = 0x7;
  const auto processed = profile.process(m.encoded(), 2, {});
  ASSERT_EQ(processed->events.size(), 1U);
  const auto event = mission::EpsLoadsChangedEvent::decode(processed->events[0].data).value();
  EXPECT_EQ(event.before, 0x3);
  EXPECT_EQ(event.after, 0x7);
}

TEST(EpsProfile, ChecksTelecommandArguments) {
  const EpsProfile profile;
  const auto load = profile.decode_command(1, Octets{2, 1});
  ASSERT_TRUE(load.has_value());
  EXPECT_EQ(std::get<PeripheralFunction>(*load).function, 1);
  EXPECT_EQ(profile.decode_command(1, Octets{4, 1}).error(), mission::failure::bad_argument);
  EXPECT_EQ(profile.decode_command(1, Octets{3}).error(), mission::failure::bad_arguments_length);
  EXPECT_EQ(profile.decode_command(0, Octets{}).error(), mission::failure::unknown_function);
  EXPECT_FALSE(EpsProfile().process(Octets(40), 1, {}).has_value());
}

}  // namespace
}  // namespace srfs
