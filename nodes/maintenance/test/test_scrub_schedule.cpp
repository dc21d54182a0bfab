// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/scrub_schedule.hpp"

#include <random>

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace srfs {
namespace {

using update::ScrubFinding;
using update::ScrubMode;

constexpr ScrubSchedule::Pace pace{
    .first_after = seconds(300), .interval = seconds(21600), .pause = milliseconds(100)};
constexpr ScrubSchedule::Pace by_telecommand{
    .first_after = seconds(300), .interval = seconds(0), .pause = seconds(0)};

template <class Action>
const Action* only(const ScrubSchedule::Actions& actions) {
  return actions.size() == 1 ? std::get_if<Action>(&actions.front()) : nullptr;
}
ScrubSchedule::Slice last_slice(std::uint32_t taken = 0) {
  ScrubSchedule::Slice slice;
  slice.status.taken = taken;
  slice.status.build = "b7";
  return slice;
}

TEST(ScrubScheduleTest, the_first_round_of_a_process_takes_what_was_changed_on_purpose_and_later_ones_watch) {
  ScrubSchedule schedule;
  const auto wait = ScrubSchedule::start(pace);
  ASSERT_NE(only<AwaitSlice>(wait), nullptr);
  EXPECT_EQ(only<AwaitSlice>(wait)->wait, seconds(300));

  const auto first = schedule.on_due();
  ASSERT_NE(only<CheckSlice>(first), nullptr);
  EXPECT_EQ(only<CheckSlice>(first)->begins, ScrubMode::start);
  ScrubSchedule::Slice slice;
  slice.more = true;
  const auto pause = schedule.on_slice(slice, pace);
  ASSERT_NE(only<AwaitSlice>(pause), nullptr);
  EXPECT_EQ(only<AwaitSlice>(pause)->wait, milliseconds(100));
  EXPECT_EQ(only<CheckSlice>(schedule.on_due())->begins, std::nullopt) << "the same round";

  const auto end = schedule.on_slice(last_slice(), pace);
  ASSERT_EQ(end.size(), 2U);
  EXPECT_TRUE(std::holds_alternative<ReportScrubRound>(end[0]));
  EXPECT_EQ(std::get<AwaitSlice>(end[1]).wait, seconds(21600));
  EXPECT_EQ(only<CheckSlice>(schedule.on_due())->begins, ScrubMode::watch);
}

TEST(ScrubScheduleTest, without_an_interval_rounds_come_by_telecommand_only) {
  ScrubSchedule schedule;
  EXPECT_TRUE(ScrubSchedule::start(by_telecommand).empty());
  EXPECT_EQ(only<CheckSlice>(schedule.run(false))->begins, ScrubMode::start);
  EXPECT_TRUE(schedule.run(false).empty()) << "one is under way";
  const auto end = schedule.on_slice(last_slice(), by_telecommand);
  ASSERT_EQ(end.size(), 1U);
  EXPECT_TRUE(std::holds_alternative<ReportScrubRound>(end[0]));
}

TEST(ScrubScheduleTest, a_retake_waits_for_the_round_under_way_and_says_what_it_took) {
  ScrubSchedule schedule;
  (void)schedule.run(false);
  EXPECT_TRUE(schedule.run(true).empty());
  const auto end = schedule.on_slice(last_slice(3), pace);
  ASSERT_EQ(end.size(), 3U);
  EXPECT_EQ(std::get<ReportFilesTaken>(end[0]).files, 3U);
  EXPECT_EQ(std::get<ReportFilesTaken>(end[0]).build, "b7");
  EXPECT_EQ(std::get<CheckSlice>(end[2]).begins, ScrubMode::retake);

  const auto retaken = schedule.on_slice(last_slice(), pace);
  ASSERT_EQ(retaken.size(), 3U);
  EXPECT_EQ(std::get<ReportFilesTaken>(retaken[0]).files, 0U) << "also when nothing had changed";
}

TEST(ScrubScheduleTest, findings_are_reported_in_their_order_before_what_follows) {
  ScrubSchedule schedule;
  (void)schedule.on_due();
  ScrubSchedule::Slice slice;
  slice.more = true;
  slice.findings = {{ScrubFinding::What::damaged, "/a", "digest"}, {ScrubFinding::What::mended, "/a", ""}};
  const auto actions = schedule.on_slice(slice, pace);
  ASSERT_EQ(actions.size(), 3U);
  EXPECT_EQ(std::get<ReportFinding>(actions[0]).finding.what, ScrubFinding::What::damaged);
  EXPECT_EQ(std::get<ReportFinding>(actions[1]).finding.what, ScrubFinding::What::mended);
  EXPECT_TRUE(std::holds_alternative<AwaitSlice>(actions[2]));
}

/// The worker and the timer around a schedule.
struct ScrubWorld {
  ScrubSchedule schedule;
  std::mt19937 random;
  std::optional<CheckSlice> checking;
  bool waits = false;
  bool retake_owed = false;
  int rounds = 0, retakes = 0;

  explicit ScrubWorld(std::uint32_t seed) : random(seed) { apply(ScrubSchedule::start(pace)); }
  void apply(const ScrubSchedule::Actions& actions) {
    for (const ScrubAction& action : actions) {
      if (const auto* slice = std::get_if<CheckSlice>(&action)) {
        ASSERT_FALSE(checking) << "two slices at a time";
        waits = false;
        checking = *slice;
      }
      if (std::holds_alternative<AwaitSlice>(action)) {
        ASSERT_FALSE(waits || checking);
        waits = true;
      }
    }
  }
  void ask(bool retake) {
    retake_owed = retake_owed || retake;
    apply(schedule.run(retake));
  }
  void answer() {
    if (random() % 4 == 0) {
      checking.reset();
      return apply(schedule.on_refused());
    }
    const CheckSlice slice = *checking;
    checking.reset();
    rounds += slice.begins ? 1 : 0;
    if (slice.begins == ScrubMode::retake) {
      ++retakes;
      retake_owed = false;
    }
    ScrubSchedule::Slice result;
    result.more = random() % 3 != 0;
    apply(schedule.on_slice(result, pace));
  }
  void step() {
    if (checking) return answer();
    waits = false;
    apply(schedule.on_due());
  }
};

TEST(ScrubScheduleProperties, one_slice_at_a_time_never_standing_still_and_no_retake_is_forgotten) {
  int retakes = 0;
  for (std::uint32_t seed = 0; seed < 500; ++seed) {
    SCOPED_TRACE(fmt::format("seed {}", seed));
    ScrubWorld world(seed);
    for (int i = 0; i < 200; ++i) {
      ASSERT_TRUE(world.checking || world.waits) << "it stands still";
      if (world.random() % 8 == 0) {
        world.ask(world.random() % 2 == 0);
      } else {
        world.step();
      }
      if (testing::Test::HasFatalFailure()) return;
    }
    for (int i = 0; i < 1000 && world.retake_owed; ++i) world.step();
    EXPECT_FALSE(world.retake_owed);
    EXPECT_GT(world.rounds, 5);
    retakes += world.retakes;
  }
  EXPECT_GT(retakes, 500);
}

}  // namespace
}  // namespace srfs
