// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "suite/node.hpp"
#include "suite/ring/check_alive.hpp"

namespace srfs::suite {
namespace {

MonotonicTime at(int s) {
  return MonotonicTime(seconds(s));
}

TEST(DueWorkTest, IsWhatWaitsAndWhatIsDueTogetherWithTheAgeOfTheOldest) {
  const DueWork work = due_work({2, 70, at(5)}, {1, 30, at(4)});
  EXPECT_EQ(work.due, 3U);
  EXPECT_EQ(work.oldest, at(4));
  EXPECT_EQ(due_work({2, 70, at(5)}, {}).oldest, at(5));
  EXPECT_EQ(due_work({}, {1, 30, at(4)}).oldest, at(4));
  EXPECT_EQ(due_work({}, {}).oldest, std::nullopt);
}

TEST(DueWorkTest, ANodeThatHandlesItsInputAndNeglectsItsOwnWorkGetsNothingDone) {
  const std::uint32_t before = due_work({1, 70, at(9)}, {1, 30, at(4)}).done;
  EXPECT_EQ(due_work({1, 95, at(10)}, {1, 30, at(4)}).done, before);
  EXPECT_NE(due_work({1, 95, at(10)}, {1, 31, at(4)}).done, before);
}

TEST(DueWorkTest, ANodeThatDoesItsOwnWorkAndLeavesItsInputGetsNothingDone) {
  const std::uint32_t before = due_work({3, 70, at(4)}, {1, 30, at(9)}).done;
  EXPECT_EQ(due_work({3, 70, at(4)}, {0, 35, std::nullopt}).done, before);
  EXPECT_NE(due_work({3, 71, at(4)}, {0, 35, std::nullopt}).done, before);
}

}  // namespace
}  // namespace srfs::suite
