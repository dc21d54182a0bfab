// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "nodes/payload/sensor_inputs.hpp"

namespace srfs {
namespace {

using Change = SensorInputs::Change;

constexpr MonotonicTime start{seconds(7)};

TEST(SensorInputs, ReportsAChangeOfAnAssignedInputAndNothingElse) {
  SensorInputs inputs(0b0011);
  EXPECT_EQ(inputs.on_reading({0b0001, 0b0011}, start), std::nullopt) << "the first reading is no change";
  EXPECT_EQ(inputs.on_reading({0b1101, 0b1111}, start), std::nullopt) << "others' inputs";
  EXPECT_EQ(inputs.on_reading({0b0010, 0b0011}, start), (Change{0b01, 0b10}));
  EXPECT_EQ(inputs.on_reading({0b0010, 0b0011}, start + seconds(60)), std::nullopt);
  EXPECT_EQ(inputs.levels(), 0b10);
  EXPECT_EQ(inputs.changes(), 1U);
}

TEST(SensorInputs, ReportsAtMostOneChangeAPeriodAndThenWhereItHasCome) {
  SensorInputs inputs(0b1000);
  (void)inputs.on_reading({0, 0b1000}, start);
  MonotonicTime now = start;
  int reported = 0;
  for (int i = 0; i < 1000; ++i) {  // a chattering input: 20 changes per period
    now += SensorInputs::event_period / 20;
    reported +=
        inputs.on_reading({static_cast<std::uint8_t>(i % 2 == 0 ? 0b1000 : 0), 0b1000}, now).has_value() ? 1
                                                                                                         : 0;
  }
  EXPECT_GE(reported, 10);
  EXPECT_LE(reported, 51);
  EXPECT_EQ(inputs.changes(), 1000U);

  SensorInputs calm(0b1000);
  (void)calm.on_reading({0, 0b1000}, start);
  EXPECT_TRUE(calm.on_reading({0b1000, 0b1000}, start));
  EXPECT_FALSE(calm.on_reading({0, 0b1000}, start + seconds(1)));
  EXPECT_EQ(calm.on_reading({0, 0b1000}, start + SensorInputs::event_period), (Change{0b1000, 0}))
      << "the change in the period";
}

TEST(SensorInputs, KeepsTheLastLevelOfAnInputThatCannotBeReadAndSaysSo) {
  SensorInputs inputs(0b0011);
  (void)inputs.on_reading({0b0011, 0b0011}, start);
  EXPECT_EQ(inputs.on_reading({0b0000, 0b0001}, start), (Change{0b11, 0b10}));
  EXPECT_EQ(inputs.valid(), 0b0001);
  EXPECT_EQ(inputs.failures(), 1U);
  EXPECT_EQ(inputs.on_reading({0b0000, 0b0000}, start + seconds(9)), std::nullopt);
  EXPECT_EQ(inputs.levels(), 0b10);
}

TEST(SensorInputs, AnInputThatIsReadForTheFirstTimeLaterHasNotChanged) {
  SensorInputs inputs(0b0011);
  (void)inputs.on_reading({0b0000, 0b0001}, start);
  EXPECT_EQ(inputs.on_reading({0b0010, 0b0011}, start), std::nullopt);
  EXPECT_EQ(inputs.changes(), 0U);
}

}  // namespace
}  // namespace srfs
