// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "magnetometer_profile.hpp"

#include <gtest/gtest.h>

#include "hw_sim/peripheral_model.hpp"
#include "hw_sim/spacecraft_world.hpp"

namespace srfs::sim {
std::unique_ptr<PeripheralModel> make_payload_magnetometer_model(const ModelContext&);
}

namespace srfs {
namespace {

TEST(MagnetometerProfile, GivesTheMagnitudeOfTheFieldThatItsPeripheralMeasures) {
  sim::SpacecraftWorld world({}, *from_iso8601("2026-11-21T08:00:00Z"));
  const auto model = sim::make_payload_magnetometer_model({world, 1});

  const auto processed = MagnetometerProfile().process(model->measure(), 7, {});

  ASSERT_TRUE(processed);
  const auto hk =
      mission::PayloadMagnetometerHousekeeping::decode(OctetView(processed->housekeeping)).value();
  EXPECT_EQ(hk.cycle, 7U);
  EXPECT_NEAR(hk.magnitude_t, world.orbit().magnetic_field_t.norm(), 1e-6);
}

TEST(MagnetometerProfile, RefusesABlockOfAnotherLengthAndAnUnknownRange) {
  EXPECT_FALSE(MagnetometerProfile().process(Octets(12), 1, {}));
  EXPECT_TRUE(MagnetometerProfile().decode_command(1, Octets{1}));
  EXPECT_EQ(MagnetometerProfile().decode_command(1, Octets{2}).error(), mission::failure::bad_argument);
}

TEST(MagnetometerModel, TheFineRangeSaturatesUntilItsPowerIsCut) {
  sim::SpacecraftWorld world({}, *from_iso8601("2026-11-21T08:00:00Z"));
  const auto model = sim::make_payload_magnetometer_model({world, 1});
  const auto range = [&] { return mission::MagnetometerMeasurement::decode(model->measure())->range; };
  EXPECT_EQ(model->execute(1, Octets{0}), wire::PeripheralResult::done);
  EXPECT_EQ(range(), mission::MagnetometerRange::fine);
  model->set_power(false);
  EXPECT_EQ(range(), mission::MagnetometerRange::coarse);
}

}  // namespace
}  // namespace srfs
