// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "hw/can_bus.hpp"
#include "hw/fake/fake_can_bus.hpp"

namespace srfs::hw {
namespace {

constexpr MonotonicTime start{seconds(5)};
constexpr MonotonicTime lease_end = start + milliseconds(120);

TEST(LeasedCanBus, IsClosedUntilTheFirstGrant) {
  FakeCanBus bus;
  LeasedCanBus leased(bus);
  EXPECT_EQ(leased.send({.id = 1}, 1, start).error(), CanError::not_granted);
  EXPECT_TRUE(bus.sent.empty());
  EXPECT_EQ(leased.refused(), 1U);
}

TEST(LeasedCanBus, WritesUnderTheCurrentGrantBeforeTheEndOfTheLease) {
  FakeCanBus bus;
  LeasedCanBus leased(bus);
  ASSERT_TRUE(leased.begin(7, lease_end));
  EXPECT_TRUE(leased.send({.id = 1}, 7, start));
  EXPECT_EQ(leased.send({.id = 1}, 6, start).error(), CanError::not_granted);
  EXPECT_TRUE(leased.send({.id = 1}, 7, lease_end - nanoseconds(1)));
  EXPECT_EQ(leased.send({.id = 1}, 7, lease_end).error(), CanError::not_granted);
  EXPECT_EQ(bus.sent.size(), 2U);
}

TEST(LeasedCanBus, NeverTakesAGrantTwice) {
  FakeCanBus bus;
  LeasedCanBus leased(bus);
  ASSERT_TRUE(leased.begin(7, lease_end));
  leased.end();
  EXPECT_FALSE(leased.begin(7, lease_end + seconds(1)));
  EXPECT_FALSE(leased.begin(3, lease_end));
  EXPECT_FALSE(leased.granted(start));
  EXPECT_TRUE(leased.begin(8, lease_end));
}

TEST(LeasedCanBus, IsQuietAfterTheEchoOfTheLastOwnFrame) {
  FakeCanBus bus;
  bus.auto_echo = false;
  LeasedCanBus leased(bus);
  ASSERT_TRUE(leased.begin(1, lease_end));
  ASSERT_TRUE(leased.send({.id = 1}, 1, start));
  EXPECT_FALSE(leased.quiet());
  bus.confirm_oldest(start);
  EXPECT_TRUE(leased.quiet());
}

}  // namespace
}  // namespace srfs::hw
