// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ground/pass/pass_item.hpp"

namespace srfs::ground::pass {
namespace {

using ::testing::ElementsAre;

Item file(ItemKind kind, std::uint64_t octets, unsigned priority) {
  return {.kind = kind, .text = "file", .priority = priority, .octets = octets};
}

PassTimes pass_of(seconds length, seconds after = seconds(0)) {
  return {.rise = UtcTime(after), .set = UtcTime(after + length)};
}

TEST(Choice, IsTheMostUrgentFileThatFits) {
  const std::vector<Item> items{file(ItemKind::down, 900, 1), file(ItemKind::down, 400, 2),
                                file(ItemKind::down, 50, 3)};
  EXPECT_EQ(choose(items, {0, 1, 2}, 1000), 0U);
  EXPECT_EQ(choose(items, {0, 1, 2}, 500), 1U);
  EXPECT_EQ(choose(items, {0, 1, 2}, 60), 2U);
}

TEST(Choice, IsTheMostUrgentOfAllWhenNoneFits) {
  const std::vector<Item> items{file(ItemKind::down, 900, 1), file(ItemKind::down, 400, 2)};
  EXPECT_EQ(choose(items, {0, 1}, 10), 0U);
  EXPECT_EQ(choose(items, {}, 1000), std::nullopt);
}

TEST(Forecast, FillsThePassesInTurnAndCutsWhatIsTooBig) {
  const std::vector<Item> items{file(ItemKind::down, 2500, 1), file(ItemKind::down, 300, 2),
                                file(ItemKind::up, 40, 1)};
  const auto passes =
      forecast({pass_of(seconds(10)), pass_of(seconds(10), seconds(100)), pass_of(seconds(10), seconds(200))},
               items, {.down_octets_s = 100, .up_octets_s = 10}, UtcTime(seconds(0)));
  ASSERT_EQ(passes.size(), 3U);
  EXPECT_EQ(passes[0].down_octets, 1000U);
  EXPECT_EQ(passes[0].up_octets, 100U);
  const auto text = [&](const Forecast& pass) {
    std::vector<std::string> parts;
    for (const auto& part : pass.parts)
      parts.push_back(std::to_string(part.item) + ":" + std::to_string(part.octets) +
                      (part.whole ? "" : "..."));
    return parts;
  };
  EXPECT_THAT(text(passes[0]), ElementsAre("2:40", "1:300", "0:700..."));
  EXPECT_THAT(text(passes[1]), ElementsAre("0:1000..."));
  EXPECT_THAT(text(passes[2]), ElementsAre("0:800"));
}

TEST(Forecast, OfAPassUnderWayHasWhatIsLeftOfIt) {
  const auto passes =
      forecast({pass_of(seconds(10))}, {}, {.down_octets_s = 100, .up_octets_s = 10}, UtcTime(seconds(6)));
  EXPECT_EQ(passes.front().down_octets, 400U);
}

TEST(Items, OfTheSameTextHaveKeysOfTheirOwn) {
  PassPlan plan;
  for (int i = 0; i < 2; ++i) {
    ScriptStep step;
    step.text = "tc eps.switch_load load=2 state=on";
    plan.script.push_back(step);
  }
  plan.queries.push_back({"ttc.ping", {}});
  const auto items = items_of(plan);
  ASSERT_EQ(items.size(), 3U);
  EXPECT_EQ(items[0].kind, ItemKind::query);
  EXPECT_NE(items[1].key, items[2].key);
  EXPECT_EQ(items_of(plan)[2].key, items[2].key) << "each reading of the plan gives the same keys";
}

TEST(Wish, IsTheFirstWhosePatternMatches) {
  PassPlan plan;
  plan.down = {{"images", "*.fits", 1}, {"images", "*", 9}, {"", "log_?.txt", 5}};
  EXPECT_EQ(wish_for(plan, "images", "a.fits")->priority, 1U);
  EXPECT_EQ(wish_for(plan, "images", "a.txt")->priority, 9U);
  EXPECT_EQ(wish_for(plan, "", "log_1.txt")->priority, 5U);
  EXPECT_EQ(wish_for(plan, "", "log_10.txt"), nullptr);
  EXPECT_EQ(wish_for(plan, "other", "a.fits"), nullptr);
}

TEST(Pattern, MatchesTheWholeText) {
  EXPECT_TRUE(matches("", ""));
  EXPECT_TRUE(matches("*", ""));
  EXPECT_TRUE(matches("a*b*c", "aXbbYc"));
  EXPECT_TRUE(matches("*aab", "aaaab"));
  EXPECT_FALSE(matches("a*b", "a"));
  EXPECT_FALSE(matches("?", ""));
  EXPECT_FALSE(matches("abc", "abcd"));
}

}  // namespace
}  // namespace srfs::ground::pass
