// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "adcs_model.hpp"

#include <gtest/gtest.h>

#include <mission/structures.hpp>

namespace srfs::sim {
namespace {

using wire::PeripheralResult;

class AdcsModelTest : public testing::Test {
 protected:
  static Octets with_f32(const Octets& head, std::initializer_list<float> values) {
    OctetWriter out;
    out.bytes(head);
    for (const float v : values) out.f32(v);
    return out.take();
  }
  SpacecraftWorld world{{}, *from_iso8601("2026-11-21T08:00:00Z")};
  AdcsModel model{{world, 1}};
};

TEST_F(AdcsModelTest, MeasuresInTheLengthOfTheDictionary) {
  EXPECT_EQ(model.measure().size(), mission::AdcsMeasurement::max_size);
}

TEST_F(AdcsModelTest, FindsNoSunInEclipse) {
  int dark = 0;
  for (int s = 0; s < 95; ++s) {
    world.step(seconds(1));
    const auto measured = mission::AdcsMeasurement::decode(model.measure()).value();
    const bool no_sun = measured.sun_vector == std::array<float, 3>{};
    ASSERT_EQ(no_sun, world.orbit().eclipsed);
    dark += no_sun ? 1 : 0;
  }
  EXPECT_GT(dark, 25);
  EXPECT_LT(dark, 40);
}

TEST_F(AdcsModelTest, RefusesArgumentsThatAreWrong) {
  EXPECT_EQ(model.execute(1, Octets{4}), PeripheralResult::bad_argument);
  EXPECT_EQ(model.execute(1, Octets{}), PeripheralResult::bad_argument);
  EXPECT_EQ(model.execute(2, with_f32({}, {0, 0, 0, 0})), PeripheralResult::bad_argument);
  EXPECT_EQ(model.execute(9, Octets{}), PeripheralResult::unknown_function);
}

TEST_F(AdcsModelTest, OwnsItsWheelsExceptWhenIdle) {
  EXPECT_EQ(model.execute(3, with_f32({0}, {50})), PeripheralResult::done);
  EXPECT_EQ(model.execute(1, Octets{1}), PeripheralResult::done);
  EXPECT_EQ(model.execute(3, with_f32({0}, {50})), PeripheralResult::cannot_now);
}

TEST_F(AdcsModelTest, PointsWhereItIsTold) {
  EXPECT_EQ(model.execute(2, with_f32({}, {0, 0, 1, 1})), PeripheralResult::done);
  EXPECT_EQ(model.execute(1, Octets{2}), PeripheralResult::done);
  world.step(seconds(120));
  EXPECT_LT(world.attitude().pointing_error_rad(), 0.01);
}

}  // namespace
}  // namespace srfs::sim
