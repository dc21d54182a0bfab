// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "cfdp/gap_list.hpp"

namespace srfs::cfdp {
namespace {

using testing::ElementsAre;

constexpr MonotonicTime start{seconds(10)};
constexpr milliseconds delay(200);
constexpr milliseconds repeat(5000);

std::vector<CfdpSegment> segments(const GapList& list) {
  std::vector<CfdpSegment> all;
  for (const auto& gap : list.gaps()) all.push_back(gap.segment);
  return all;
}

TEST(GapLists, AgreeWithABitmapWhateverComes) {
  for (unsigned seed = 1; seed <= 200; ++seed) {
    std::mt19937 random(seed);
    constexpr std::size_t octets = 300;
    GapList list(10, delay, repeat);
    std::vector<bool> there(octets);
    std::uint64_t end = 0;
    MonotonicTime now = start;
    for (int i = 0; i < 200; ++i) {
      const std::uint64_t from = random() % octets;
      const CfdpSegment s{from, std::min<std::uint64_t>(octets, from + 1 + random() % 40)};
      const auto taken = list.judge(s);
      const bool any_new = std::find(there.begin() + static_cast<std::ptrdiff_t>(s.start),
                                     there.begin() + static_cast<std::ptrdiff_t>(s.end),
                                     false) != there.begin() + static_cast<std::ptrdiff_t>(s.end);
      ASSERT_FALSE(taken == GapList::Taken::duplicate && any_new);
      if (taken == GapList::Taken::new_octets) {
        ASSERT_TRUE(any_new);
        list.fill(s, now);
        std::fill(there.begin() + static_cast<std::ptrdiff_t>(s.start),
                  there.begin() + static_cast<std::ptrdiff_t>(s.end), true);
        end = std::max(end, s.end);
      }
      if (i == 120) {
        list.set_file_size(octets, now);
        end = octets;
      }
      ASSERT_EQ(list.end(), end);
      ASSERT_LE(list.gaps().size(), 11U);
      ASSERT_EQ(list.missing_octets(),
                static_cast<std::uint64_t>(
                    std::count(there.begin(), there.begin() + static_cast<std::ptrdiff_t>(end), false)));
      GapList again(10, delay, repeat);
      ASSERT_TRUE(again.restore(list.end(), segments(list), now));
      now += milliseconds(10);
    }
  }
}

TEST(GapLists, AskAfterTheDelayAndAgainAfterTheInterval) {
  GapList list(10, delay, repeat);
  list.fill({0, 10}, start);
  list.fill({20, 30}, start);
  EXPECT_THAT(list.take_due(9, true, start), ElementsAre());
  EXPECT_THAT(list.take_due(9, true, start + delay), ElementsAre(CfdpSegment{10, 20}));
  EXPECT_THAT(list.take_due(9, true, start + delay + repeat - milliseconds(1)), ElementsAre());
  EXPECT_THAT(list.take_due(9, false, start + delay + repeat), ElementsAre());
  EXPECT_THAT(list.take_due(9, true, start + delay + repeat), ElementsAre(CfdpSegment{10, 20}));
}

TEST(GapLists, WaitForTheRestOfAGapThatIsBeingFilledAndAskSoonForWhatWasLeftOut) {
  GapList list(10, delay, repeat);
  list.fill({100, 110}, start);
  ASSERT_THAT(list.take_due(9, true, start + delay), ElementsAre(CfdpSegment{0, 100}));
  const MonotonicTime later = start + repeat;
  list.fill({0, 10}, later);
  list.fill({20, 30}, later);  // 10-20 was lost again
  EXPECT_THAT(list.take_due(9, true, later + delay), ElementsAre(CfdpSegment{10, 20}));
  EXPECT_THAT(list.take_due(9, true, later + repeat), ElementsAre(CfdpSegment{30, 100}));
}

/// A list with gaps at 10-20, 30-40 and 50-60, all requested at @p asked. The first answer takes one second.
GapList asked_for_three_gaps(MonotonicTime asked) {
  GapList list(10, delay, repeat);
  // The list learns the duration of an answer from an earlier gap.
  list.fill({5, 10}, asked - seconds(2));
  EXPECT_THAT(list.take_due(9, true, asked - seconds(1)), ElementsAre(CfdpSegment{0, 5}));
  list.fill({0, 5}, asked);
  for (const std::uint64_t from : {20U, 40U, 60U}) list.fill({from, from + 10}, asked - delay);
  EXPECT_EQ(list.take_due(9, true, asked).size(), 3U);
  return list;
}

TEST(GapLists, AskAgainSoonForWhatTheSenderPassedOver) {
  const MonotonicTime asked = start + seconds(10);
  GapList list = asked_for_three_gaps(asked);
  const MonotonicTime answered = asked + seconds(2);
  list.fill({30, 40}, answered);  // skips the first gap
  EXPECT_THAT(list.take_due(9, true, answered + delay - milliseconds(1)), ElementsAre());
  EXPECT_THAT(list.take_due(9, true, answered + delay), ElementsAre(CfdpSegment{10, 20}));
  list.fill({70, 80},
            answered + seconds(3));  // new data: skipped the third gap too, and the first one again
  EXPECT_THAT(list.take_due(9, true, answered + seconds(3) + delay),
              ElementsAre(CfdpSegment{10, 20}, CfdpSegment{50, 60}));
}

TEST(GapLists, WaitForTheTurnOfWhatTheSenderServesLater) {
  const MonotonicTime asked = start + seconds(10);
  GapList list = asked_for_three_gaps(asked);
  const MonotonicTime served = asked + milliseconds(2200);
  list.fill({10, 15}, served);
  EXPECT_THAT(list.take_due(9, true, served + seconds(2)), ElementsAre());
  // No data for more than twice the duration of an answer: the gaps will not be filled.
  EXPECT_EQ(list.take_due(9, true, served + seconds(4)).size(), 3U);
}

TEST(GapLists, DataThatLeftBeforeTheAskingArrivedSaysNothingOfIt) {
  const MonotonicTime asked = start + seconds(10);
  GapList list = asked_for_three_gaps(asked);
  list.fill({70, 80}, asked + milliseconds(900));
  EXPECT_THAT(list.take_due(9, true, asked + milliseconds(1100)), ElementsAre());
}

TEST(GapLists, RefuseACheckpointThatMakesNoSense) {
  GapList list(2, delay, repeat);
  EXPECT_FALSE(list.restore(100, {{10, 10}}, start));
  EXPECT_FALSE(list.restore(100, {{20, 30}, {10, 15}}, start));
  EXPECT_FALSE(list.restore(100, {{90, 101}}, start));
  EXPECT_FALSE(list.restore(100, {{1, 2}, {3, 4}, {5, 6}, {7, 8}}, start));
  EXPECT_TRUE(list.restore(100, {{10, 20}, {90, 100}}, start));
}

TEST(SegmentSets, MeltWhatTouchesAndRefuseOneTooMany) {
  SegmentSet set(2);
  EXPECT_TRUE(set.add({10, 20}));
  EXPECT_TRUE(set.add({40, 50}));
  EXPECT_FALSE(set.add({60, 70}));
  EXPECT_TRUE(set.add({20, 40}));
  EXPECT_THAT(set.segments(), ElementsAre(CfdpSegment{10, 50}));
  EXPECT_TRUE(set.add({0, 5}));
  EXPECT_TRUE(set.add({3, 60}));
  EXPECT_THAT(set.segments(), ElementsAre(CfdpSegment{0, 60}));
  EXPECT_EQ(set.take(25), (CfdpSegment{0, 25}));
  EXPECT_EQ(set.take(100), (CfdpSegment{25, 60}));
  EXPECT_FALSE(set.take(100));
}

}  // namespace
}  // namespace srfs::cfdp
