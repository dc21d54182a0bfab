// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <linux/can/error.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hw/can_error_frame.hpp"
#include "hw/can_restart.hpp"

namespace srfs::hw {
namespace {

can_frame error_frame(canid_t classes, std::uint8_t controller = 0, std::uint8_t tec = 0,
                      std::uint8_t rec = 0) {
  can_frame raw{};
  raw.can_id = CAN_ERR_FLAG | classes;
  raw.len = CAN_ERR_DLC;
  raw.data[1] = controller;
  raw.data[6] = tec;
  raw.data[7] = rec;
  return raw;
}

struct Controller : ::testing::Test {
  CanController controller;
  CanCounters counters;
  CanTransition take(const can_frame& raw) { return apply(decode_error_frame(raw), controller, counters); }
};
using CanErrorFrame = Controller;

TEST_F(CanErrorFrame, TellsEveryStepFromActiveToPassiveAndBack) {
  EXPECT_EQ(take(error_frame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING)), CanTransition::state_changed);
  EXPECT_EQ(controller.state, CanBusState::warning);
  EXPECT_EQ(take(error_frame(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_WARNING)), CanTransition::none);
  EXPECT_EQ(take(error_frame(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_PASSIVE)), CanTransition::state_changed);
  EXPECT_EQ(controller.state, CanBusState::passive);
  EXPECT_EQ(take(error_frame(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE)), CanTransition::state_changed);
  EXPECT_EQ(controller.state, CanBusState::active);
}

TEST_F(CanErrorFrame, TakesTheWorseOfTransmitAndReceiveSide) {
  EXPECT_EQ(take(error_frame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_PASSIVE | CAN_ERR_CRTL_RX_WARNING)),
            CanTransition::state_changed);
  EXPECT_EQ(controller.state, CanBusState::passive);
}

TEST_F(CanErrorFrame, BusOffIsCountedOnceAndLeftByARestartOnly) {
  EXPECT_EQ(take(error_frame(CAN_ERR_BUSOFF)), CanTransition::went_bus_off);
  EXPECT_EQ(take(error_frame(CAN_ERR_BUSOFF)), CanTransition::none);
  EXPECT_EQ(take(error_frame(CAN_ERR_CRTL, CAN_ERR_CRTL_ACTIVE)), CanTransition::none);
  EXPECT_EQ(controller.state, CanBusState::bus_off);
  EXPECT_EQ(take(error_frame(CAN_ERR_RESTARTED)), CanTransition::restarted);
  EXPECT_EQ(controller.state, CanBusState::active);
  EXPECT_EQ(counters.bus_off, 1U);
  EXPECT_EQ(counters.restarts, 1U);
}

TEST_F(CanErrorFrame, ARestartThatNobodyNeededIsNoTransition) {
  EXPECT_EQ(take(error_frame(CAN_ERR_RESTARTED)), CanTransition::none);
  EXPECT_EQ(counters.restarts, 0U);
}

TEST_F(CanErrorFrame, CountsErrorsOfTheBusLostArbitrationAndOverflows) {
  take(error_frame(CAN_ERR_PROT | CAN_ERR_BUSERROR));
  take(error_frame(CAN_ERR_ACK));
  take(error_frame(CAN_ERR_LOSTARB));
  take(error_frame(CAN_ERR_CRTL, CAN_ERR_CRTL_RX_OVERFLOW));
  EXPECT_EQ(counters.bus_errors, 2U);
  EXPECT_EQ(counters.arbitration_lost, 1U);
  EXPECT_EQ(counters.receive_overruns, 1U);
  EXPECT_EQ(controller.state, CanBusState::active);
}

TEST_F(CanErrorFrame, BelievesErrorCountersOnlyWhereTheFrameSaysThatItHasThem) {
  take(error_frame(CAN_ERR_CRTL, CAN_ERR_CRTL_TX_WARNING, 100, 3));
  EXPECT_FALSE(controller.transmit_errors);
  take(error_frame(CAN_ERR_CRTL | CAN_ERR_CNT, CAN_ERR_CRTL_TX_WARNING, 104, 3));
  EXPECT_EQ(controller.transmit_errors, 104);
  EXPECT_EQ(controller.receive_errors, 3);
}

constexpr MonotonicTime start{seconds(50)};

TEST(CanRestart, HasNothingToDoWhileTheControllerIsOnTheBus) {
  CanRestart restart;
  EXPECT_FALSE(restart.next_attempt());
  restart.on_attempt(start);
  restart.on_recovered(start);
  EXPECT_FALSE(restart.next_attempt());
}

TEST(CanRestart, TriesFirstAfterTheInterfaceHadItsChance) {
  CanRestart restart;
  restart.on_bus_off(start);
  EXPECT_FALSE(restart.due(start + CanRestart::first_wait - nanoseconds(1)));
  EXPECT_TRUE(restart.due(start + CanRestart::first_wait));
}

TEST(CanRestart, IsNotPutOffByRepeatedReports) {
  CanRestart restart;
  restart.on_bus_off(start);
  restart.on_bus_off(start + milliseconds(90));
  EXPECT_TRUE(restart.due(start + CanRestart::first_wait));
}

TEST(CanRestart, NeverGivesUpAndNeverWaitsLongerThanItsBound) {
  CanRestart restart;
  restart.on_bus_off(start);
  MonotonicTime now = start;
  nanoseconds before{0};
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(restart.next_attempt());
    const nanoseconds wait = *restart.next_attempt() - now;
    ASSERT_GE(wait, before);
    ASSERT_LE(wait, CanRestart::longest_wait);
    before = wait;
    now = *restart.next_attempt();
    restart.on_attempt(now);
  }
  EXPECT_EQ(before, CanRestart::longest_wait);
}

TEST(CanRestart, GoesOnWithTheWaitOfAControllerThatFallsOffAgainAtOnceAndForgetsItWhenItStayedWell) {
  CanRestart restart;
  restart.on_bus_off(start);
  restart.on_recovered(start + milliseconds(100));
  const MonotonicTime again = start + seconds(1);
  restart.on_bus_off(again);
  EXPECT_EQ(restart.next_attempt(), again + 2 * CanRestart::first_wait);
  restart.on_recovered(again + milliseconds(200));
  const MonotonicTime later = again + milliseconds(200) + CanRestart::healthy_after;
  restart.on_bus_off(later);
  EXPECT_EQ(restart.next_attempt(), later + CanRestart::first_wait);
}

}  // namespace
}  // namespace srfs::hw
