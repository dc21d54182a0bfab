// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "hw/fake/fake_can_bus.hpp"
#include "nodes/can_switcher/transmit_drain.hpp"

namespace srfs {
namespace {

using State = TransmitDrain::State;

struct Drain : ::testing::Test {
  hw::FakeCanBus bus;
  TransmitDrain drain;
  MonotonicTime now{seconds(50)};

  void SetUp() override { bus.auto_echo = false; }
  State step(nanoseconds later = TransmitDrain::period) {
    now += later;
    while (bus.receive()) {
    }
    return drain.step(bus, now);
  }
};
using TransmitDrainTest = Drain;

TEST_F(TransmitDrainTest, WritesOneFrameThatNobodyListensToAndTakesItsEchoAsTheProof) {
  EXPECT_EQ(step(), State::waiting);
  EXPECT_EQ(step(), State::waiting);
  ASSERT_EQ(bus.sent.size(), 1U);
  EXPECT_EQ(bus.sent.front().id, 0x1CDA0101U);
  EXPECT_EQ(bus.sent.front().size, 0U);
  bus.confirm_oldest(now);
  EXPECT_EQ(step(), State::empty);
  EXPECT_EQ(bus.counters().withdrawals, 0U) << "the interface does not bounce for nothing";
}

TEST_F(TransmitDrainTest, TakesEverythingBackWhenTheMarkerDoesNotGetTheBus) {
  EXPECT_EQ(step(), State::waiting);
  EXPECT_EQ(step(TransmitDrain::patience - milliseconds(1)), State::waiting);
  EXPECT_EQ(step(), State::empty);
  EXPECT_EQ(bus.counters().withdrawals, 1U);
}

TEST_F(TransmitDrainTest, TakesEverythingBackWhenTheQueueHasNoRoomForTheMarker) {
  bus.refuse_with = hw::CanError::queue_full;
  EXPECT_EQ(step(), State::waiting);
  EXPECT_EQ(step(TransmitDrain::patience), State::empty);
  EXPECT_EQ(bus.counters().withdrawals, 1U);
}

TEST_F(TransmitDrainTest, WritesTheMarkerWhenTheQueueHasRoomAgain) {
  bus.refuse_with = hw::CanError::queue_full;
  EXPECT_EQ(step(), State::waiting);
  bus.refuse_with.reset();
  EXPECT_EQ(step(), State::waiting);
  bus.confirm_oldest(now);
  EXPECT_EQ(step(), State::empty);
}

TEST_F(TransmitDrainTest, TakesEverythingBackAtOnceFromAControllerThatIsBusOff) {
  bus.refuse_with = hw::CanError::bus_off;
  EXPECT_EQ(step(), State::empty);
  EXPECT_EQ(bus.counters().withdrawals, 1U);
}

TEST_F(TransmitDrainTest, FindsNothingInAnInterfaceThatIsDownOrGone) {
  bus.refuse_with = hw::CanError::down;
  EXPECT_EQ(step(), State::empty);
  bus.refuse_with = hw::CanError::gone;
  drain = TransmitDrain();
  EXPECT_EQ(step(), State::empty);
  EXPECT_EQ(bus.counters().withdrawals, 0U);
}

TEST_F(TransmitDrainTest, WithoutThePermissionSaysSoOnceEachWaitAndGoesOnUntilALateEcho) {
  bus.can_withdraw = false;
  EXPECT_EQ(step(), State::waiting);
  EXPECT_EQ(step(TransmitDrain::patience), State::unproven);
  EXPECT_EQ(step(), State::waiting);
  EXPECT_EQ(step(TransmitDrain::retry), State::unproven);
  bus.confirm_oldest(now);
  EXPECT_EQ(step(), State::empty);
  EXPECT_EQ(bus.sent.size(), 1U);
}

TEST_F(TransmitDrainTest, WritesTheMarkerAgainWhenItWasLostWithABusOff) {
  EXPECT_EQ(step(), State::waiting);
  bus.withdraw();  // like a bus-off; not requested by the drain
  EXPECT_EQ(step(), State::waiting) << "a loss is no proof";
  EXPECT_EQ(bus.sent.size(), 2U);
  bus.confirm_oldest(now);
  EXPECT_EQ(step(), State::empty);
}

TEST_F(TransmitDrainTest, IsNoFrameOfAPayloadAndGoesBehindAllOfThem) {
  EXPECT_GT(TransmitDrain::marker.id, 0x18DAFFFFU);
}

}  // namespace
}  // namespace srfs
