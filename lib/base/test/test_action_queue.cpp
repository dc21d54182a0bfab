// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/action_queue.hpp"

#include <functional>
#include <stdexcept>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace srfs {
namespace {

TEST(ActionQueueTest, WhatAnActionLeadsToComesBehindWhatWaits) {
  ActionQueue<int> queue;
  std::vector<int> done;
  const auto carry_out = [&](int action) {
    done.push_back(action);
    if (action == 1) {
      EXPECT_FALSE(queue.run({10, 11}, [](int) { FAIL() << "the outer call does"; }));
    }
  };
  EXPECT_TRUE(queue.run({1, 2, 3}, carry_out));
  EXPECT_THAT(done, testing::ElementsAre(1, 2, 3, 10, 11));
}

TEST(ActionQueueTest, AnExceptionForgetsTheRestAndTheNextRunBeginsAnew) {
  ActionQueue<int> queue;
  std::vector<int> done;
  const auto carry_out = [&](int action) {
    if (action == 2) throw std::runtime_error("it fails");
    done.push_back(action);
  };
  EXPECT_THROW(queue.run({1, 2, 3}, carry_out), std::runtime_error);
  EXPECT_TRUE(queue.run({4}, carry_out));
  EXPECT_THAT(done, testing::ElementsAre(1, 4));
}

TEST(ActionQueueTest, WhatIsForgottenWithinAnActionIsNotCarriedOut) {
  ActionQueue<int> queue;
  std::vector<int> done;
  EXPECT_TRUE(queue.run({1, 2}, [&](int action) {
    done.push_back(action);
    queue.clear();
  }));
  EXPECT_THAT(done, testing::ElementsAre(1));
}

TEST(ActionQueueTest, WhatFollowsAfterThatIsCarriedOut) {
  ActionQueue<int> queue;
  std::vector<int> done;
  const std::function<void(int)> carry_out = [&](int action) {
    done.push_back(action);
    if (action != 1) return;
    queue.clear();
    EXPECT_FALSE(queue.run({3}, carry_out));
  };
  EXPECT_TRUE(queue.run({1, 2}, carry_out));
  EXPECT_THAT(done, testing::ElementsAre(1, 3));
}

TEST(ActionQueueTest, CarriesOutAListInItsOrder) {
  ActionQueue<int> queue;
  std::vector<int> done;
  ActionList<int, 3> list{1, 2};
  list.emplace_back(3);
  EXPECT_EQ(list.size(), 3U);
  EXPECT_TRUE(queue.run(list, [&](int action) { done.push_back(action); }));
  EXPECT_THAT(done, testing::ElementsAre(1, 2, 3));
  EXPECT_TRUE((ActionList<int, 1>().empty()));
}

}  // namespace
}  // namespace srfs
