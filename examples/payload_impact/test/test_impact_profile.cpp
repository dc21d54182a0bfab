// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "impact_profile.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include <mission/structures.hpp>

#include "impact_model.hpp"

namespace srfs {
namespace {

Octets block(std::uint32_t impacts, float energy_uj) {
  mission::ImpactMeasurement measurement;
  measurement.impacts = impacts;
  measurement.energy_uj = energy_uj;
  return measurement.encoded();
}

TEST(ImpactProfile, MakesAnHousekeepingPacketOfWhatThePeripheralMeasures) {
  sim::ImpactModel detector(1);
  detector.hit(0.5F);
  detector.hit(0.01F);
  const Octets measured = detector.measure();
  ASSERT_EQ(measured.size(), mission::ImpactMeasurement::max_size);

  const auto processed = ImpactProfile().process(measured, 7, {});

  ASSERT_TRUE(processed);
  const auto hk = mission::PayloadImpactHousekeeping::decode(OctetView(processed->housekeeping));
  ASSERT_TRUE(hk);
  EXPECT_EQ(hk->cycle, 7U);
  EXPECT_EQ(hk->measurement.impacts, 1U);
  EXPECT_EQ(hk->measurement.rejected, 1U);
  EXPECT_FLOAT_EQ(hk->measurement.energy_uj, 50.0F);
  EXPECT_EQ(hk->measurement.histogram[5], 1U) << "32 to 64 uJ";
  EXPECT_TRUE(std::isnan(hk->flux_per_hour)) << "one reading tells no rate";
}

TEST(ImpactProfile, TellsHitsSinceTheSlotBeforeAndLargeOnesApart) {
  ImpactProfile profile;
  EXPECT_TRUE(profile.process(block(3, 5), 1, {})->events.empty()) << "what was before its start is no news";
  const auto small = profile.process(block(5, 5), 2, {})->events;
  ASSERT_EQ(small.size(), 1U);
  EXPECT_EQ(small[0].id, mission::event::impact_hit);
  EXPECT_EQ(profile.process(block(6, 300), 3, {})->events.size(), 2U);
  EXPECT_TRUE(profile.process(block(0, 0), 4, {})->events.empty()) << "cleared";
  EXPECT_FALSE(profile.process(Octets{1, 2, 3}, 5, {}));
}

TEST(ImpactProfile, PassesItsCommandsToThePeripheralAsTheyAre) {
  sim::ImpactModel detector(1);
  detector.hit(1);
  const ImpactProfile profile;
  const Octets threshold = mission::ImpactSetThreshold{.threshold_v = 2}.encoded();
  const auto set = profile.decode_command(1, threshold);
  ASSERT_TRUE(set);
  const auto& function = std::get<PeripheralFunction>(*set);
  EXPECT_EQ(detector.execute(function.function, function.arguments), wire::PeripheralResult::done);
  detector.hit(1.5F);
  EXPECT_EQ(detector.impacts(), 1U);
  const auto clear = profile.decode_command(2, {});
  ASSERT_TRUE(clear);
  EXPECT_EQ(detector.execute(std::get<PeripheralFunction>(*clear).function, {}),
            wire::PeripheralResult::done);
  EXPECT_EQ(detector.impacts(), 0U);

  EXPECT_EQ(profile.decode_command(1, mission::ImpactSetThreshold{.threshold_v = 9}.encoded()).error(),
            mission::failure::bad_argument);
  EXPECT_EQ(profile.decode_command(77, {}).error(), mission::failure::unknown_function);
  EXPECT_EQ(detector.execute(77, {}), wire::PeripheralResult::unknown_function);
  EXPECT_EQ(detector.execute(1, Octets{1}), wire::PeripheralResult::bad_argument);
}

TEST(ImpactFlux, IsHitsAnHourOverTheLastReadings) {
  ImpactFlux flux(36000);
  EXPECT_TRUE(std::isnan(flux.add(100, 10)));
  EXPECT_FLOAT_EQ(flux.add(700, 11), 60) << "one a minute";
  EXPECT_TRUE(std::isnan(flux.add(800, 0))) << "cleared: it begins anew";
}

TEST(ImpactModel, HitsComeAboutAsOftenAsItsFluxSaysAndPowerLossForgetsThem) {
  sim::ImpactModel detector(7);
  for (int i = 0; i < 36000; ++i)
    detector.step(milliseconds(100));  // an hour: 720 hits, a third above the threshold
  EXPECT_GT(detector.impacts(), 100U);
  EXPECT_LT(detector.impacts(), 500U);
  detector.set_power(false);
  detector.set_power(true);
  EXPECT_EQ(detector.impacts(), 0U);
}

}  // namespace
}  // namespace srfs
