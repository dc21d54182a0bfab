// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_acquisition/frame_removal.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace srfs {
namespace {

using enum FrameStanding;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::uint32_t under_way = 99;

std::vector<StoredFrame> frames(std::initializer_list<FrameStanding> standings) {
  std::vector<StoredFrame> all;
  for (const FrameStanding standing : standings)
    all.push_back({1, static_cast<std::uint16_t>(all.size() + 1), 10, standing});
  return all;
}

TEST(FrameRemoval, RemovesNothingWhileThereIsRoom) {
  const auto all = frames({sent, unmarked});
  EXPECT_THAT(frames_to_remove(all, 30, 10, under_way).value(), IsEmpty());
}

TEST(FrameRemoval, TakesSentThenEmptyThenUnmarkedAndOfEachTheOldestFirst) {
  const auto all = frames({unmarked, nothing, sent, detected, nothing, sent, unmarked});
  EXPECT_THAT(frames_to_remove(all, 70, 60, under_way).value(), ElementsAre(2, 5, 1, 4, 0, 6));
  EXPECT_THAT(frames_to_remove(all, 70, 5, under_way).value(), ElementsAre(2));
}

TEST(FrameRemoval, NeverTakesADetectionThatWasNotSent) {
  const auto all = frames({detected, unmarked, detected});
  EXPECT_THAT(frames_to_remove(all, 30, 10, under_way).value(), ElementsAre(1));
  EXPECT_FALSE(frames_to_remove(all, 30, 11, under_way)) << "and then removes nothing at all";
}

TEST(FrameRemoval, SparesTheTaskUnderWay) {
  auto all = frames({unmarked, unmarked});
  all[0].task = under_way;
  EXPECT_THAT(frames_to_remove(all, 20, 10, under_way).value(), ElementsAre(1));
  EXPECT_FALSE(frames_to_remove(all, 20, 20, under_way));
}

TEST(FrameRemoval, RefusesAFrameLargerThanTheStore) {
  EXPECT_FALSE(frames_to_remove({}, 100, 101, under_way));
  EXPECT_THAT(frames_to_remove({}, 100, 100, under_way).value(), IsEmpty());
}

}  // namespace
}  // namespace srfs
