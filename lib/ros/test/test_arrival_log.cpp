// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "ros/transport.hpp"

namespace srfs::ros {
namespace {

UtcTime at_us(std::int64_t us) {
  return UtcTime(microseconds(us));
}

TEST(ArrivalLog, ASampleArrivedWhenTheKernelHadItsDatagram) {
  ArrivalLog log;
  log.add(at_us(100), at_us(90), seconds(1));
  log.add(at_us(200), at_us(95), seconds(1));
  EXPECT_EQ(log.arrival_of(at_us(103)), at_us(90));
  EXPECT_EQ(log.arrival_of(at_us(200)), at_us(95));
  EXPECT_EQ(log.arrival_of(at_us(250)), at_us(95));
}

TEST(ArrivalLog, WhatItDoesNotKnowArrivedWhenItWasRead) {
  ArrivalLog log;
  EXPECT_EQ(log.arrival_of(at_us(5)), at_us(5));
  log.add(at_us(100), at_us(90), seconds(1));
  EXPECT_EQ(log.arrival_of(at_us(99)), at_us(99)) << "came by another way, before";
}

TEST(ArrivalLog, ForgetsTheOldestDatagrams) {
  ArrivalLog log;
  for (std::int64_t i = 1; i <= 100; ++i) log.add(at_us(10 * i), at_us(10 * i - 5), seconds(1));
  EXPECT_EQ(log.arrival_of(at_us(1001)), at_us(995));
  EXPECT_EQ(log.arrival_of(at_us(371)), at_us(365)) << "the 64th from the end";
  EXPECT_EQ(log.arrival_of(at_us(361)), at_us(361)) << "forgotten";
}

TEST(ArrivalLog, AStepOfTheSystemClockNeverPutsAnArrivalBehindItsReading) {
  ArrivalLog log;
  log.add(at_us(100), at_us(5000), seconds(1));
  EXPECT_EQ(log.arrival_of(at_us(110)), at_us(110));
}

TEST(ArrivalLog, WhateverTheClockSaysADatagramIsNoOlderThanTheLastLookIntoItsEmptySocket) {
  ArrivalLog log;
  const UtcTime read = at_us(0) + std::chrono::hours(3);
  log.add(read, at_us(0), milliseconds(20));
  EXPECT_EQ(log.arrival_of(read), read - milliseconds(20)) << "the clock was set ahead in between";
}

}  // namespace
}  // namespace srfs::ros
