// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "eps_model.hpp"

#include <gtest/gtest.h>

#include <mission/structures.hpp>

namespace srfs::sim {
namespace {

using wire::PeripheralResult;

class EpsModelTest : public testing::Test {
 protected:
  SpacecraftWorld world{{}, *from_iso8601("2026-11-21T08:00:00Z")};
  EpsModel model{{world, 1}};
};

TEST_F(EpsModelTest, MeasuresInTheLengthOfTheDictionary) {
  EXPECT_EQ(model.measure().size(), mission::EpsMeasurement::max_size);
  EXPECT_GT(mission::EpsMeasurement::decode(model.measure())->battery_voltage_v, 6.0F);
}

TEST_F(EpsModelTest, ALoadSwitchShowsInTheNextMeasurement) {
  EXPECT_EQ(world.power().state().load_a[2], 0);
  EXPECT_EQ(model.execute(1, Octets{2, 1}), PeripheralResult::done);
  EXPECT_GT(world.power().state().load_a[2], 0.4);
  EXPECT_EQ(model.measure()[24], 0b0111);
}

TEST_F(EpsModelTest, RefusesArgumentsThatAreWrong) {
  EXPECT_EQ(model.execute(1, Octets{4, 1}), PeripheralResult::bad_argument);
  EXPECT_EQ(model.execute(1, Octets{2}), PeripheralResult::bad_argument);
  EXPECT_EQ(model.execute(1, Octets{2, 1, 0}), PeripheralResult::bad_argument);
  EXPECT_EQ(model.execute(9, Octets{}), PeripheralResult::unknown_function);
}

}  // namespace
}  // namespace srfs::sim
