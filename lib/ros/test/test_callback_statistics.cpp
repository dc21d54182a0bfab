// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "ros/callback_statistics.hpp"

namespace srfs::ros {
namespace {

MonotonicTime at(milliseconds t) {
  return MonotonicTime(seconds(100) + t);
}

TEST(CallbackStatistics, CountsRunTimesByKindAndName) {
  CallbackStatistics statistics;
  CallbackRecord& tick = statistics.record(CallbackKind::subscription, "/timing/tick");
  CallbackRecord& same = statistics.record(CallbackKind::subscription, "/timing/tick");
  CallbackRecord& other = statistics.record(CallbackKind::service, "/timing/tick");
  EXPECT_EQ(&tick, &same);
  EXPECT_NE(&tick, &other);

  statistics.add(tick, milliseconds(1), at(milliseconds(1)));
  statistics.add(tick, milliseconds(3), at(milliseconds(5)));
  EXPECT_EQ(tick.run_time.count(), 2U);
  EXPECT_EQ(tick.run_time.max(), milliseconds(3));
  EXPECT_EQ(tick.total, milliseconds(4));
  EXPECT_EQ(statistics.busy(), milliseconds(4));
  EXPECT_EQ(statistics.all().count(), 2U);
}

TEST(CallbackStatistics, ACallbackAtItsBudgetIsWithinIt) {
  CallbackStatistics statistics;
  CallbackRecord& r = statistics.record(CallbackKind::timer, "t");
  EXPECT_FALSE(statistics.add(r, milliseconds(20), at(milliseconds(0)))) << "20 ms unless set";
  EXPECT_TRUE(statistics.add(r, milliseconds(20) + nanoseconds(1), at(milliseconds(0))));
  EXPECT_EQ(r.over_budget, 1U);
}

TEST(CallbackStatistics, ReportsACallbackOverBudgetEveryTenSecondsAndCountsAll) {
  CallbackStatistics statistics;
  CallbackRecord& r = statistics.record(CallbackKind::timer, "t");
  int reports = 0;
  for (int ms = 0; ms < 30'000; ms += 100)
    reports += statistics.add(r, seconds(1), at(milliseconds(ms))) ? 1 : 0;
  EXPECT_EQ(reports, 3);
  EXPECT_EQ(r.over_budget, 300U);
}

TEST(CallbackStatistics, AKindHasABudgetAndARecordMayHaveItsOwn) {
  CallbackStatistics statistics;
  statistics.set_budget(CallbackKind::service, milliseconds(100));
  CallbackRecord& service = statistics.record(CallbackKind::service, "/x/get_state");
  CallbackRecord& change = statistics.record(CallbackKind::service, "/x/change_state");
  change.budget = seconds(2);
  EXPECT_FALSE(statistics.add(service, milliseconds(90), at(milliseconds(0))));
  EXPECT_TRUE(statistics.add(service, milliseconds(110), at(milliseconds(0))));
  EXPECT_FALSE(statistics.add(change, milliseconds(1900), at(milliseconds(0))));
}

TEST(CallbackStatistics, NamesBeyondItsBoundAreCountedTogether) {
  CallbackStatistics statistics;
  for (int i = 0; i < 1000; ++i) {
    CallbackRecord& r = statistics.record(CallbackKind::timer, "t" + std::to_string(i));
    statistics.add(r, milliseconds(1), at(milliseconds(i)));
  }
  EXPECT_EQ(statistics.records().size(), CallbackStatistics::most_names + 1);
  EXPECT_EQ(statistics.records().back().name, "(others)");
  EXPECT_EQ(statistics.records().back().run_time.count(), 1000 - CallbackStatistics::most_names);
}

TEST(CallbackStatistics, ATransitionIsNotCountedTwiceInTheSums) {
  CallbackStatistics statistics;
  statistics.add(statistics.record(CallbackKind::transition, "configuring"), milliseconds(30),
                 at(milliseconds(30)));
  statistics.add(statistics.record(CallbackKind::service, "/x/change_state"), milliseconds(31),
                 at(milliseconds(31)));
  EXPECT_EQ(statistics.all().count(), 1U);
  EXPECT_EQ(statistics.busy(), milliseconds(31));
}

TEST(CallbackStatistics, NamesTheLongestSinceTheLastQuestion) {
  CallbackStatistics statistics;
  statistics.add(statistics.record(CallbackKind::timer, "short"), milliseconds(1), at(milliseconds(1)));
  statistics.add(statistics.record(CallbackKind::timer, "long"), milliseconds(2), at(milliseconds(3)));
  const auto longest = statistics.take_longest();
  ASSERT_NE(longest.record, nullptr);
  EXPECT_EQ(longest.record->name, "long");
  EXPECT_EQ(longest.took, milliseconds(2));
  EXPECT_EQ(statistics.take_longest().record, nullptr);
}

TEST(CallbackStatistics, StartAnewAfterAReset) {
  CallbackStatistics statistics;
  CallbackRecord& r = statistics.record(CallbackKind::timer, "t");
  statistics.add(r, seconds(1), at(milliseconds(0)));
  statistics.reset();
  EXPECT_EQ(r.run_time.count(), 0U);
  EXPECT_EQ(r.over_budget, 0U);
  EXPECT_EQ(&statistics.record(CallbackKind::timer, "t"), &r);
}

}  // namespace
}  // namespace srfs::ros
