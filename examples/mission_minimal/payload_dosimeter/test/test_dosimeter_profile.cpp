// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "dosimeter_profile.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "hw_sim/peripheral_model.hpp"
#include "hw_sim/spacecraft_world.hpp"

namespace srfs::sim {
std::unique_ptr<PeripheralModel> make_payload_dosimeter_model(const ModelContext&);
}

namespace srfs {
namespace {

Octets counted(std::uint32_t particles) {
  return mission::DosimeterMeasurement{.particles = particles, .dose_gy = 0}.encoded();
}

TEST(DosimeterProfile, GivesTheRateBetweenTwoMeasurementsAndReportsAStorm) {
  DosimeterProfile profile;
  const auto rate = [](const Processed& processed) {
    return mission::PayloadDosimeterHousekeeping::decode(OctetView(processed.housekeeping))->rate;
  };
  EXPECT_TRUE(std::isnan(rate(*profile.process(counted(100), 10, {})))) << "one measurement gives no rate";
  const auto calm = profile.process(counted(110), 12, {});
  EXPECT_FLOAT_EQ(rate(*calm), 5);
  EXPECT_TRUE(calm->events.empty());
  EXPECT_EQ(profile.process(counted(1110), 14, {})->events.size(), 1U);
  EXPECT_TRUE(std::isnan(rate(*profile.process(counted(0), 16, {})))) << "cleared";
}

TEST(DosimeterModel, CountsMoreInAStormAndNothingWithoutPower) {
  sim::SpacecraftWorld world({}, *from_iso8601("2026-11-21T08:00:00Z"));
  const auto model = sim::make_payload_dosimeter_model({world, 1});
  const auto particles = [&] { return mission::DosimeterMeasurement::decode(model->measure())->particles; };
  model->step(seconds(10));
  EXPECT_LT(particles(), 1000U);
  EXPECT_TRUE(model->set_fault("storm"));
  EXPECT_FALSE(model->set_fault("frost"));
  model->step(seconds(10));
  EXPECT_GT(particles(), 10'000U);
  model->set_power(false);
  model->step(seconds(10));
  EXPECT_EQ(particles(), 0U);
}

}  // namespace
}  // namespace srfs
