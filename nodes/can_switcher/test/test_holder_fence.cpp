// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/holder_fence.hpp"

#include <random>

#include <gtest/gtest.h>

namespace srfs {
namespace {

template <class Action>
bool is_only(const FenceActions& actions) {
  return actions.size() == 1 && std::holds_alternative<Action>(actions.front());
}

TEST(HolderFence, SaysGoneAtOnceWhenNoSuchProcessRuns) {
  HolderFence fence(milliseconds(500));
  const FenceActions kill = fence.fence("payload_eps", 5);
  ASSERT_TRUE(is_only<KillHolder>(kill));
  EXPECT_EQ(std::get<KillHolder>(kill[0]).payload, "payload_eps");
  EXPECT_EQ(std::get<KillHolder>(kill[0]).process, 5U);
  EXPECT_TRUE(fence.busy());
  EXPECT_TRUE(is_only<HolderGone>(fence.on_killed(false, std::nullopt)));
  EXPECT_FALSE(fence.busy());
}

TEST(HolderFence, AwaitsTheExitOfAProcessThatItKilled) {
  HolderFence fence(milliseconds(500));
  (void)fence.fence("payload_eps", 5);
  const FenceActions wait = fence.on_killed(true, std::nullopt);
  ASSERT_TRUE(is_only<AwaitExit>(wait));
  EXPECT_EQ(std::get<AwaitExit>(wait[0]).wait, milliseconds(500));
  EXPECT_TRUE(is_only<HolderGone>(fence.on_exit()));
  EXPECT_TRUE(fence.on_exit().empty()) << "once";
}

TEST(HolderFence, KillsAgainAfterEachWaitAndSaysWhyItIsNotProven) {
  HolderFence fence(milliseconds(500));
  (void)fence.fence("payload_eps", std::nullopt);
  for (const char* problem : {"cannot kill pid 7", ""}) {
    const bool is_killed = problem[0] == 0;
    (void)fence.on_killed(true, is_killed ? std::nullopt : std::optional<std::string>(problem));
    const FenceActions again = fence.on_wait_over();
    ASSERT_EQ(again.size(), 2U);
    EXPECT_EQ(std::get<FenceUnproven>(again[0]).why, is_killed ? "killed, but still there" : problem);
    EXPECT_TRUE(std::holds_alternative<KillHolder>(again[1]));
    EXPECT_TRUE(fence.busy());
  }
}

TEST(HolderFenceProperties, WhateverTheKernelAnswersNobodyIsGoneWhoMayWriteAndEachFenceEnds) {
  std::mt19937 random(3);
  for (int run = 0; run < 2000; ++run) {
    HolderFence fence(milliseconds(500));
    bool runs = random() % 4 != 0;
    int gone = 0;
    bool awaited = false;
    std::vector<FenceAction> waiting = fence.fence("payload_eps", 5);
    for (int step = 0; step < 200 && gone == 0; ++step) {
      if (waiting.empty()) {
        ASSERT_TRUE(awaited) << "it stands still";
        if (random() % 3 == 0) runs = false;
        awaited = false;
        waiting = runs ? fence.on_wait_over() : fence.on_exit();
        continue;
      }
      const FenceAction action = waiting.front();
      waiting.erase(waiting.begin());
      FenceActions next;
      if (std::holds_alternative<KillHolder>(action)) {
        const bool refused = random() % 3 == 0;
        if (!refused && random() % 2 == 0) runs = false;  // gone before it is asked
        next = fence.on_killed(runs, refused ? std::optional<std::string>("refused") : std::nullopt);
      }
      awaited = awaited || std::holds_alternative<AwaitExit>(action);
      if (std::holds_alternative<HolderGone>(action)) {
        ASSERT_FALSE(runs) << "it may write";
        ++gone;
      }
      waiting.insert(waiting.end(), next.begin(), next.end());
    }
    EXPECT_EQ(gone, 1);
    EXPECT_FALSE(fence.busy());
  }
}

TEST(HolderIdentity, ASuccessorIsInnocentEvenBeforeItHasSaidItsNumber) {
  EXPECT_TRUE(is_holder(7, 7));
  EXPECT_TRUE(is_holder(6, 7));
  EXPECT_FALSE(is_holder(8, 7));
  EXPECT_FALSE(is_holder(0, 7));
  EXPECT_TRUE(is_holder(7, std::nullopt));
  EXPECT_TRUE(is_holder(0, std::nullopt));
}

}  // namespace
}  // namespace srfs
