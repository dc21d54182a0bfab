// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include <mission/structures.hpp>

#include "adcs_profile.hpp"

namespace srfs {
namespace {

mission::AdcsMeasurement pointing_at_the_sun() {
  mission::AdcsMeasurement m;
  m.attitude = {0, 0, 0, 1};
  m.sun_vector = {1, 0, 0};
  return m;
}

mission::PayloadAdcsHousekeeping housekeeping(AdcsProfile& profile, const mission::AdcsMeasurement& m) {
  const auto processed = profile.process(m.encoded(), 42, {});
  EXPECT_TRUE(processed.has_value());
  return mission::PayloadAdcsHousekeeping::decode(processed->housekeeping).value();
}

TEST(AdcsProfile, GivesTheAngleBetweenAttitudeAndTarget) {
  AdcsProfile profile;
  mission::AdcsMeasurement m = pointing_at_the_sun();
  const float half = std::sqrt(0.5F);
  m.attitude = {0, 0, half, half};  // a quarter turn about z
  EXPECT_NEAR(housekeeping(profile, m).pointing_error_deg, 90.0F, 1e-3F);
  m.attitude = {0, 0, -half, -half};  // the same attitude
  EXPECT_NEAR(housekeeping(profile, m).pointing_error_deg, 90.0F, 1e-3F);

  const mission::AdcsSetTargetQuaternion target{.x = 0, .y = 0, .z = 1, .w = 1};  // not normalised
  EXPECT_TRUE(
      profile.on_command_done({mission::AdcsSetTargetQuaternion::peripheral_function, target.encoded()}));
  EXPECT_NEAR(housekeeping(profile, m).pointing_error_deg, 0.0F, 0.1F);
}

TEST(AdcsProfile, KeepsItsTargetAcrossARestart) {
  AdcsProfile profile;
  const mission::AdcsSetTargetQuaternion target{.x = 0, .y = 1, .z = 0, .w = 0};
  profile.on_command_done({mission::AdcsSetTargetQuaternion::peripheral_function, target.encoded()});
  AdcsProfile restarted;
  EXPECT_TRUE(restarted.restore_state(profile.state()));
  EXPECT_NEAR(housekeeping(restarted, pointing_at_the_sun()).pointing_error_deg, 180.0F, 1e-3F);
  EXPECT_FALSE(restarted.restore_state(Octets{1, 2, 3}));
  Octets newer = AdcsProfile().state();
  ++newer.front();
  EXPECT_FALSE(restarted.restore_state(newer)) << "another format";
  EXPECT_NEAR(housekeeping(restarted, pointing_at_the_sun()).pointing_error_deg, 180.0F, 1e-3F);
}

TEST(AdcsProfile, SaysThatAnImpossibleAttitudeHasNoAngle) {
  AdcsProfile profile;
  mission::AdcsMeasurement m = pointing_at_the_sun();
  m.attitude = {0, 0, 0, 0};
  EXPECT_TRUE(std::isnan(housekeeping(profile, m).pointing_error_deg));
  m.attitude = {std::nanf(""), 0, 0, 1};
  EXPECT_TRUE(std::isnan(housekeeping(profile, m).pointing_error_deg));
}

TEST(AdcsProfile, ReportsEclipseModeAndHighRateOnce) {
  AdcsProfile profile;
  mission::AdcsMeasurement m = pointing_at_the_sun();
  EXPECT_TRUE(profile.process(m.encoded(), 1, {})->events.empty());
  m.sun_vector = {0, 0, 0};
  m.mode = mission::AdcsMode::point;
  m.body_rate_rad_s = {0.06F, 0, 0.08F};  // 0.1 rad/s = 5.7 deg/s
  const auto processed = profile.process(m.encoded(), 2, {});
  ASSERT_EQ(processed->events.size(), 3U);
  EXPECT_EQ(processed->events[0].id, mission::AdcsEclipseEnteredEvent::event_id);
  EXPECT_EQ(processed->events[1].id, mission::AdcsModeChangedEvent::event_id);
  EXPECT_EQ(processed->events[2].id, mission::AdcsRateHighEvent::event_id);
  EXPECT_TRUE(profile.process(m.encoded(), 3, {})->events.empty());
  EXPECT_NEAR(housekeeping(profile, m).rate_deg_s, 5.7296F, 1e-3F);
}

TEST(AdcsProfile, RefusesABlockOfAnotherLength) {
  AdcsProfile profile;
  Octets block = pointing_at_the_sun().encoded();
  block.pop_back();
  EXPECT_FALSE(profile.process(block, 1, {}).has_value());
  EXPECT_FALSE(profile.process({}, 1, {}).has_value());
}

TEST(AdcsProfile, ChecksTelecommandArguments) {
  const AdcsProfile profile;
  const auto mode =
      profile.decode_command(1, mission::AdcsSetMode{.mode = mission::AdcsMode::point}.encoded());
  ASSERT_TRUE(mode.has_value());
  EXPECT_EQ(std::get<PeripheralFunction>(*mode).arguments, Octets{2});
  EXPECT_EQ(profile.decode_command(1, Octets{9}).error(), mission::failure::bad_argument);
  EXPECT_EQ(profile.decode_command(1, Octets{}).error(), mission::failure::bad_arguments_length);
  EXPECT_EQ(profile.decode_command(99, Octets{}).error(), mission::failure::unknown_function);
  EXPECT_TRUE(std::holds_alternative<ResetPeripheral>(*profile.decode_command(16, Octets{})));
  const auto cycle = profile.decode_command(17, mission::AdcsPowerCyclePeripheral{.off_ms = 300}.encoded());
  EXPECT_EQ(std::get<PowerCyclePeripheral>(*cycle).off_time, milliseconds(300));
}

}  // namespace
}  // namespace srfs
