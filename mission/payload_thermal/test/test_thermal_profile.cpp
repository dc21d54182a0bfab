// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <mission/structures.hpp>

#include "thermal_profile.hpp"

namespace srfs {
namespace {

mission::ThermalMeasurement mild() {
  mission::ThermalMeasurement m;
  m.temperature_k = {290, 280, 295, 285, 300, 270};
  m.setpoint_k = {288, 290};
  return m;
}

TEST(ThermalProfile, GivesExtremesAndGradient) {
  ThermalProfile profile;
  const auto processed = profile.process(mild().encoded(), 7, {});
  ASSERT_TRUE(processed.has_value());
  const auto hk = mission::PayloadThermalHousekeeping::decode(processed->housekeeping).value();
  EXPECT_FLOAT_EQ(hk.temperature_min_k, 270);
  EXPECT_FLOAT_EQ(hk.temperature_max_k, 300);
  EXPECT_FLOAT_EQ(hk.gradient_k, 30);
}

TEST(ThermalProfile, ReportsASensorOutOfLimitsOnceWithHysteresis) {
  ThermalProfile profile;
  mission::ThermalMeasurement m = mild();
  const auto events = [&](float t) {
    m.temperature_k[4] = t;
    return profile.process(m.encoded(), 1, {})->events;
  };
  EXPECT_TRUE(events(337).empty());
  const auto out = events(340);
  ASSERT_EQ(out.size(), 1U);
  EXPECT_EQ(mission::ThermalOutOfLimitsEvent::decode(out[0].data)->sensor, 4);
  EXPECT_TRUE(events(341).empty());
  EXPECT_TRUE(events(337).empty());
  ASSERT_EQ(events(330).size(), 1U);
}

TEST(ThermalProfile, ChecksTelecommandArguments) {
  const ThermalProfile profile;
  EXPECT_TRUE(profile.decode_command(1, Octets{1, 2}).has_value());
  EXPECT_EQ(profile.decode_command(1, Octets{2, 2}).error(), mission::failure::bad_argument);
  const mission::ThermalSetSetpoint too_hot{.heater = 0, .setpoint_k = 400};
  EXPECT_EQ(profile.decode_command(2, too_hot.encoded()).error(), mission::failure::bad_argument);
  EXPECT_EQ(profile.decode_command(3, Octets{}).error(), mission::failure::unknown_function);
  EXPECT_FALSE(ThermalProfile().process(Octets(34), 1, {}).has_value());
}

}  // namespace
}  // namespace srfs
