// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/standing_orders.hpp"

#include <random>

#include <gtest/gtest.h>

namespace srfs {
namespace {

const MonotonicTime begin{seconds(100)};
constexpr seconds repeat{10};

StandingOrder order(std::uint8_t function) {
  return {function, {}, "order"};
}

TEST(StandingOrders, GoOutOnceInOrderAndThoseThatAreHeldAgainAfterTheRepeatTime) {
  StandingOrders orders;
  orders.set({order(1)}, {order(2), order(3)}, repeat, begin);
  for (const int expected : {1, 2, 3}) {
    ASSERT_NE(orders.next(begin), nullptr);
    EXPECT_EQ(orders.next(begin)->function, expected);
    EXPECT_FALSE(orders.take_first_round());
    orders.on_done(begin);
  }
  EXPECT_EQ(orders.take_first_round(), 3);
  EXPECT_FALSE(orders.take_first_round());
  EXPECT_EQ(orders.next(begin + seconds(9)), nullptr);
  const MonotonicTime again = begin + repeat;
  for (const int expected : {2, 3}) {
    ASSERT_NE(orders.next(again), nullptr);
    EXPECT_EQ(orders.next(again)->function, expected);
    orders.on_done(again);
  }
  EXPECT_EQ(orders.next(again), nullptr);
  EXPECT_FALSE(orders.take_first_round());
}

TEST(StandingOrders, ComeAtOnceAgainWhenThePeripheralMayHaveForgottenThem) {
  StandingOrders orders;
  orders.set({order(1)}, {order(2)}, repeat, begin);
  orders.on_done(begin);
  orders.on_done(begin);
  orders.on_peripheral_restarted(begin + seconds(1));
  ASSERT_NE(orders.next(begin + seconds(1)), nullptr);
  EXPECT_EQ(orders.next(begin + seconds(1))->function, 2);
}

TEST(StandingOrders, AreNoObstacleWhenOneIsRefused) {
  StandingOrders orders;
  orders.set({}, {order(1), order(2)}, repeat, begin);
  orders.on_refused(false, begin);
  EXPECT_EQ(orders.next(begin)->function, 2);
  orders.on_done(begin);
  EXPECT_EQ(orders.take_first_round(), 1);
  EXPECT_EQ(orders.next(begin + repeat)->function, 1);
}

TEST(StandingOrders, ThatCountOnceComeAgainInEachRoundUntilTheyAreCarriedOut) {
  StandingOrders orders;
  orders.set({order(1)}, {order(2)}, repeat, begin);
  MonotonicTime now = begin;
  for (int round = 0; round < 3; ++round, now += repeat) {
    ASSERT_NE(orders.next(now), nullptr);
    ASSERT_EQ(orders.next(now)->function, 1);
    orders.on_refused(false, now);
    ASSERT_EQ(orders.next(now)->function, 2);
    orders.on_done(now);
    EXPECT_FALSE(orders.take_first_round());
  }
  ASSERT_EQ(orders.next(now)->function, 1);
  orders.on_done(now);
  ASSERT_EQ(orders.next(now)->function, 2);
  orders.on_done(now);
  EXPECT_EQ(orders.take_first_round(), 2);
  EXPECT_EQ(orders.next(now + repeat)->function, 2);
}

TEST(StandingOrders, ThatCountOnceAreGivenUpWhenThePeripheralWillNeverTakeThem) {
  StandingOrders orders;
  orders.set({order(1)}, {}, repeat, begin);
  orders.on_refused(true, begin);
  EXPECT_EQ(orders.take_first_round(), 0);
  EXPECT_EQ(orders.next(begin + repeat), nullptr);
}

TEST(StandingOrders, GiveWayToTheNextAfterThreeTriesWithoutAnAnswer) {
  StandingOrders orders;
  orders.set({order(1)}, {order(2)}, repeat, begin);
  EXPECT_FALSE(orders.on_silence(begin));
  EXPECT_FALSE(orders.on_silence(begin));
  ASSERT_EQ(orders.next(begin)->function, 1);
  EXPECT_TRUE(orders.on_silence(begin));
  ASSERT_EQ(orders.next(begin)->function, 2);
  EXPECT_FALSE(orders.on_silence(begin));  // the count begins anew
  orders.on_done(begin);
  EXPECT_FALSE(orders.take_first_round());
  ASSERT_NE(orders.next(begin + repeat), nullptr);
  EXPECT_EQ(orders.next(begin + repeat)->function, 1);
}

TEST(StandingOrders, OfAModeThatAsksNothingAreObeyedAtOnce) {
  StandingOrders orders;
  orders.set({}, {}, repeat, begin);
  EXPECT_EQ(orders.take_first_round(), 0);
  EXPECT_EQ(orders.next(begin + seconds(1000)), nullptr);
  orders.on_peripheral_restarted(begin);
  EXPECT_EQ(orders.next(begin + seconds(1000)), nullptr);
}

TEST(StandingOrdersProperties, TheLastStateIsThatOfTheOrdersHoweverThePeripheralForgetsAndFails) {
  std::mt19937 random(5);
  for (int run = 0; run < 300; ++run) {
    StandingOrders orders;
    std::vector<StandingOrder> hold;
    for (std::uint8_t i = 0; i < 1 + random() % 4; ++i) hold.push_back(order(i));
    std::vector<bool> obeyed(hold.size(), false);
    MonotonicTime now = begin;
    orders.set({}, hold, repeat, now);
    for (int slot = 0; slot < 60; ++slot) {
      now += milliseconds(random() % 3000);
      if (slot < 40 && random() % 5 == 0) {
        obeyed.assign(hold.size(), false);
        if (random() % 2 == 0) orders.on_peripheral_restarted(now);  // else nobody has noticed
      }
      const StandingOrder* due = orders.next(now);
      if (due == nullptr || (slot < 40 && random() % 3 == 0)) continue;  // no answer
      obeyed[due->function] = true;
      orders.on_done(now);
    }
    for (const bool each : obeyed) ASSERT_TRUE(each) << run;
  }
}

}  // namespace
}  // namespace srfs
