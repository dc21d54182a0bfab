// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/heard_times.hpp"

#include <algorithm>
#include <random>
#include <set>
#include <utility>

#include <gtest/gtest.h>

namespace srfs::ros {
namespace {

using Verdict = HeardTimes::Verdict;

constexpr GuidPrefix timing{1, 15, 7};
constexpr GuidPrefix ttc{1, 15, 8};

MonotonicTime at(std::int64_t ns) {
  return MonotonicTime(nanoseconds(ns));
}

TEST(HeardTimes, TakesEachTimeOfASenderOnce) {
  HeardTimes heard(at(0));
  EXPECT_EQ(heard.add(timing, at(10)), Verdict::first);
  EXPECT_EQ(heard.look(timing, at(10)), Verdict::again);
  EXPECT_EQ(heard.add(timing, at(10)), Verdict::again);
  EXPECT_EQ(heard.add(ttc, at(10)), Verdict::first);
  EXPECT_EQ(heard.add(timing, at(9)), Verdict::first) << "overtaken";
}

TEST(HeardTimes, WhatWasMadeBeforeThePortWasOpenedIsTooOld) {
  HeardTimes heard(at(100));
  EXPECT_EQ(heard.add(timing, at(100)), Verdict::too_old);
  EXPECT_EQ(heard.add(timing, at(101)), Verdict::first);
  EXPECT_EQ(heard.add(timing, at(99)), Verdict::too_old);
}

TEST(HeardTimes, OneThatWasOvertakenByFewerThanItKnowsIsTaken) {
  HeardTimes heard(at(0));
  for (int i = 0; i < static_cast<int>(HeardTimes::least); ++i)
    ASSERT_EQ(heard.add(timing, at(1000 + i)), Verdict::first);
  EXPECT_EQ(heard.add(timing, at(999)), Verdict::first);
}

TEST(HeardTimes, TakesNoTimeTwiceWhateverComesInWhateverOrder) {
  std::mt19937 random(1);
  for (int round = 0; round < 20; ++round) {
    HeardTimes heard(at(0));
    std::set<std::pair<GuidPrefix, MonotonicTime>> taken;
    std::int64_t newest = 1;
    int fresh = 0;
    for (int i = 0; i < 5000; ++i) {
      GuidPrefix who = timing;
      who[11] = static_cast<std::uint8_t>(random() % (round % 2 == 0 ? 3 : 100));
      newest += static_cast<std::int64_t>(random() % 2);
      const auto back = static_cast<std::int64_t>(random() % (random() % 10 == 0 ? 5000 : 20));
      const MonotonicTime time = at(std::max<std::int64_t>(1, newest - back));
      const Verdict looked = heard.look(who, time);
      ASSERT_EQ(heard.add(who, time), looked);
      if (looked != Verdict::first) continue;
      ++fresh;
      ASSERT_TRUE(taken.emplace(who, time).second);
    }
    EXPECT_GT(fresh, 500);
  }
}

}  // namespace
}  // namespace srfs::ros
