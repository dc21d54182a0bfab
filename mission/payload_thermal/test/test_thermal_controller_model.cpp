// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "thermal_controller_model.hpp"

#include <gtest/gtest.h>

#include <mission/structures.hpp>

namespace srfs::sim {
namespace {

using wire::PeripheralResult;

class ThermalControllerModelTest : public testing::Test {
 protected:
  static Octets with_f32(const Octets& head, std::initializer_list<float> values) {
    OctetWriter out;
    out.bytes(head);
    for (const float v : values) out.f32(v);
    return out.take();
  }
  SpacecraftWorld world{{}, *from_iso8601("2026-11-21T08:00:00Z")};
  ThermalControllerModel model{{world, 1}};
};

TEST_F(ThermalControllerModelTest, MeasuresInTheLengthOfTheDictionary) {
  EXPECT_EQ(model.measure().size(), mission::ThermalMeasurement::max_size);
}

TEST_F(ThermalControllerModelTest, RefusesArgumentsThatAreWrong) {
  EXPECT_EQ(model.execute(2, with_f32({0}, {400})), PeripheralResult::bad_argument);
  EXPECT_EQ(model.execute(1, Octets{0, 3}), PeripheralResult::bad_argument);
}

TEST_F(ThermalControllerModelTest, ItsLossOfPowerStopsTheHeaters) {
  EXPECT_EQ(model.execute(1, Octets{0, 1}), PeripheralResult::done);
  EXPECT_GT(world.power().state().load_a[1], 0.25);
  model.set_power(false);
  EXPECT_EQ(world.power().state().load_a[1], 0);
}

}  // namespace
}  // namespace srfs::sim
