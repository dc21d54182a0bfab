// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/flag_check.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

struct FlagCheckTest : testing::Test {
  [[nodiscard]] srfs_msgs::msg::TaskFlags flag(std::uint32_t switcher) const {
    srfs_msgs::msg::TaskFlags m;
    m.switcher_incarnation = switcher;
    m.grant_counter = 1;
    m.flags = {false, true};
    m.holder = "b";
    m.tick_received_ns = static_cast<std::uint64_t>(now.ns());
    m.allotted_us = 60'000;
    m.lease_end_ns = m.tick_received_ns + 120'000'000;
    return m;
  }
  bool ask(const srfs_msgs::msg::TaskFlags& m) {
    return check.is_plausible(m, slots, now, [this] { return running; });
  }

  std::vector<suite::Slot> slots{
      {.payload = "a", .allotted = milliseconds(60), .overrun = milliseconds(20), .reset = milliseconds(40)},
      {.payload = "b", .allotted = milliseconds(60), .overrun = milliseconds(20), .reset = milliseconds(40)}};
  MonotonicTime now{seconds(1000)};
  std::optional<std::uint32_t> running = 7;
  FlagCheck check;
};

TEST_F(FlagCheckTest, TakesTheFlagOfTheSwitcherThatRunsAndNoOther) {
  EXPECT_FALSE(ask(flag(6)));
  EXPECT_TRUE(ask(flag(7)));
  running.reset();
  EXPECT_TRUE(ask(flag(7))) << "it was believed before";
  EXPECT_FALSE(ask(flag(8)));
}

TEST_F(FlagCheckTest, RefusesAnotherFlagThanTheHolders) {
  auto m = flag(7);
  m.flags = {true, false};
  EXPECT_FALSE(ask(m));
  m.flags = {true, true};
  EXPECT_FALSE(ask(m));
}

TEST_F(FlagCheckTest, RefusesALeaseThatThePlanCannotGive) {
  auto m = flag(7);
  m.lease_end_ns += 1;
  EXPECT_FALSE(ask(m));
}

TEST_F(FlagCheckTest, RefusesWhatWasReceivedInTheFutureOrLongAgo) {
  auto m = flag(7);
  m.tick_received_ns += 1;
  EXPECT_FALSE(ask(m));
  now += seconds(11);
  EXPECT_FALSE(ask(m));
}

TEST_F(FlagCheckTest, TakesTheFlagOfAPayloadThatWasAddedMeanwhileAtAFreePlace) {
  auto m = flag(7);
  m.holder = "c";
  m.flags = {false, false, true};
  EXPECT_TRUE(ask(m));
  m.flags = {false, true, false};
  EXPECT_FALSE(ask(m));
}

}  // namespace
}  // namespace srfs
