// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "update/version_table.hpp"

namespace srfs::update {
namespace {

using testing::ElementsAre;

constexpr milliseconds probation{5000};
const UtcTime now(seconds(1'700'000'000));
const std::string hash(64, 'a');

struct Table : testing::Test {
  VersionTable table;
  VersionNumber add() { return table.add(hash, 1000, "a file", now); }
  VersionNumber add_and_commit() {
    const VersionNumber number = add();
    EXPECT_TRUE(table.use(number, probation, ""));
    EXPECT_TRUE(table.commit(number));
    return number;
  }
  [[nodiscard]] VersionState state(VersionNumber number) const { return table.find(number)->state; }
  [[nodiscard]] std::vector<VersionNumber> numbers() const {
    std::vector<VersionNumber> all;
    for (const Version& v : table.versions()) all.push_back(v.number);
    return all;
  }
};
using VersionTableTest = Table;

TEST_F(VersionTableTest, BeginsWithGoldenAlone) {
  EXPECT_EQ(table.active(), golden);
  EXPECT_EQ(table.last_good(), golden);
  EXPECT_THAT(table.start_order(), ElementsAre(golden));
  EXPECT_FALSE(table.previous());
}

TEST_F(VersionTableTest, RunsAVersionOnProbationAndMakesItTheLastGoodOneWhenThatEndsWell) {
  const auto one = add();
  EXPECT_EQ(state(one), VersionState::candidate);
  ASSERT_TRUE(table.use(one, probation, ""));
  ASSERT_NE(table.on_trial(), nullptr);
  EXPECT_EQ(table.on_trial()->probation, probation);
  EXPECT_EQ(table.last_good(), golden);
  EXPECT_THAT(table.start_order(), ElementsAre(one, golden));

  ASSERT_TRUE(table.commit(one));
  EXPECT_EQ(table.on_trial(), nullptr);
  EXPECT_EQ(state(one), VersionState::committed);
  EXPECT_EQ(table.last_good(), one);
  EXPECT_FALSE(table.commit(one)) << "once";
}

TEST_F(VersionTableTest, GoesBackToTheLastGoodOneWhenAProbationFails) {
  const auto one = add_and_commit();
  const auto two = add();
  ASSERT_TRUE(table.use(two, probation, ""));
  ASSERT_TRUE(table.fail(two, "signal 11"));
  EXPECT_EQ(table.active(), one);
  EXPECT_EQ(state(two), VersionState::failed);
  EXPECT_EQ(table.find(two)->reason, "signal 11");
  EXPECT_EQ(state(one), VersionState::committed);
}

TEST_F(VersionTableTest, FailsAVersionThatSeesMoreThanTwoStartsOfTheSuiteInItsProbation) {
  EXPECT_FALSE(table.count_reset()) << "golden is not on trial";
  const auto one = add();
  ASSERT_TRUE(table.use(one, probation, ""));
  for (std::uint32_t resets = 1; resets <= VersionTable::most_resets; ++resets) {
    ASSERT_TRUE(table.count_reset());
    EXPECT_EQ(table.active(), one);
    EXPECT_EQ(decode_versions(encode(table))->find(one)->resets, resets);
  }
  ASSERT_TRUE(table.count_reset());
  EXPECT_EQ(table.active(), golden);
  EXPECT_EQ(state(one), VersionState::failed);
  EXPECT_EQ(table.find(one)->reason, "3 resets or starts of the suite in its probation");

  ASSERT_TRUE(table.use(one, probation, ""));
  ASSERT_TRUE(table.count_reset());
  EXPECT_EQ(table.active(), one) << "each probation counts its own";
}

TEST_F(VersionTableTest, VetoesAProbationWhenTheLastGoodOneIsAskedFor) {
  const auto one = add_and_commit();
  const auto two = add();
  ASSERT_TRUE(table.use(two, probation, ""));
  EXPECT_EQ(table.previous(), one);
  ASSERT_TRUE(table.use(one, probation, "by the operator"));
  EXPECT_EQ(table.on_trial(), nullptr);
  EXPECT_EQ(state(two), VersionState::failed);
  EXPECT_EQ(table.find(two)->reason, "by the operator");
}

TEST_F(VersionTableTest, PutsAnEarlierGoodVersionOnProbationTooAndGoldenNever) {
  const auto one = add_and_commit();
  const auto two = add_and_commit();
  EXPECT_EQ(state(one), VersionState::previous);
  EXPECT_EQ(table.previous(), one);
  ASSERT_TRUE(table.use(one, probation, ""));
  EXPECT_EQ(state(one), VersionState::probation);
  EXPECT_EQ(table.last_good(), two);
  ASSERT_TRUE(table.use(golden, probation, "back to the beginning"));
  EXPECT_EQ(table.active(), golden);
  EXPECT_EQ(table.last_good(), golden);
  EXPECT_EQ(state(two), VersionState::previous);
  EXPECT_EQ(state(one), VersionState::failed);
}

TEST_F(VersionTableTest, ReplacesAProbationByAnotherWithoutAVerdict) {
  const auto one = add();
  const auto two = add();
  ASSERT_TRUE(table.use(one, probation, ""));
  ASSERT_TRUE(table.use(two, probation, ""));
  EXPECT_EQ(state(one), VersionState::candidate);
  EXPECT_EQ(table.on_trial()->number, two);
}

TEST_F(VersionTableTest, FindsAnotherWhenTheActiveOrTheLastGoodOneIsDamaged) {
  const auto one = add_and_commit();
  const auto two = add_and_commit();
  ASSERT_TRUE(table.fail(two, "damaged"));
  EXPECT_EQ(table.active(), golden);
  EXPECT_EQ(table.last_good(), golden);
  EXPECT_THAT(table.start_order(), ElementsAre(golden, one));

  const auto three = add_and_commit();
  const auto four = add();
  ASSERT_TRUE(table.use(four, probation, ""));
  ASSERT_TRUE(table.fail(three, "damaged"));
  EXPECT_EQ(table.active(), four) << "still on probation";
  EXPECT_EQ(table.last_good(), golden);
}

TEST_F(VersionTableTest, OffersWhatWasGoodOnceNewestFirstAfterGolden) {
  const auto one = add_and_commit();
  const auto two = add_and_commit();
  const auto three = add_and_commit();
  const auto four = add();
  ASSERT_TRUE(table.use(four, probation, ""));
  EXPECT_THAT(table.start_order(), ElementsAre(four, three, golden, two, one));
}

TEST_F(VersionTableTest, HasRoomForFourAndGivesUpFailedThenPreviousThenCandidatesOldestFirst) {
  add_and_commit();
  add_and_commit();                          // 1 previous, 2 committed
  add();                                     // 3
  ASSERT_TRUE(table.use(3, probation, ""));  // on probation
  add();                                     // 4 candidate
  add();                                     // 5: drops the previous version
  EXPECT_THAT(numbers(), ElementsAre(2, 3, 4, 5));
  ASSERT_TRUE(table.fail(3, "crash"));
  add();  // 6: drops the failed version
  EXPECT_THAT(numbers(), ElementsAre(2, 4, 5, 6));
  add();  // 7: drops the oldest candidate
  EXPECT_THAT(numbers(), ElementsAre(2, 5, 6, 7));
  EXPECT_EQ(table.active(), 2U);
}

TEST_F(VersionTableTest, RefusesWhatMakesNoSense) {
  const auto one = add_and_commit();
  EXPECT_EQ(table.use(77, probation, "").error(), VersionRefusal::unknown_version);
  EXPECT_EQ(table.fail(golden, "").error(), VersionRefusal::unknown_version);
  EXPECT_EQ(table.remove(one).error(), VersionRefusal::in_use);
  EXPECT_EQ(table.remove(golden).error(), VersionRefusal::in_use);
  const auto revision = table.revision();
  EXPECT_TRUE(table.use(one, probation, "")) << "it is";
  EXPECT_EQ(table.revision(), revision);
}

TEST_F(VersionTableTest, UsesNoNumberTwice) {
  const auto one = add();
  ASSERT_TRUE(table.remove(one));
  EXPECT_EQ(add(), one + 1);
}

TEST_F(VersionTableTest, HoldsWhatAlwaysHoldsInRandomUseAndIsReadBack) {
  std::uint32_t random = 4711;
  const auto draw = [&](std::uint32_t below) {
    random = random * 1664525U + 1013904223U;
    return (random >> 8U) % below;
  };
  for (int i = 0; i < 20000; ++i) {
    const VersionNumber number =
        table.versions().empty() || draw(5) == 0
            ? golden
            : table.versions()[draw(static_cast<std::uint32_t>(table.versions().size()))].number;
    switch (draw(5)) {
      case 0:
        add();
        break;
      case 1:
        (void)table.use(number, probation, "r");
        break;
      case 2:
        (void)table.commit(table.active());
        break;
      case 3:
        (void)table.fail(number, "r");
        break;
      default:
        (void)table.remove(number);
    }
    ASSERT_LE(table.versions().size(), VersionTable::most_versions);
    ASSERT_TRUE(table.active() == table.last_good() || table.on_trial() != nullptr);
    ASSERT_TRUE(table.last_good() == golden || state(table.last_good()) == VersionState::committed);
    ASSERT_EQ(table.start_order().front(), table.active());
    for (const VersionNumber n : table.start_order())
      ASSERT_TRUE(n == golden || state(n) != VersionState::failed);
    if (i % 20 == 0) {
      ASSERT_EQ(decode_versions(encode(table)), table);
    }
  }
}

TEST_F(VersionTableTest, TextWithAChangedOctetOrCutOffIsNotRead) {
  add_and_commit();
  const auto two = add();
  ASSERT_TRUE(table.use(two, probation, ""));
  const std::string text = encode(table);
  ASSERT_EQ(decode_versions(text), table);
  for (std::size_t i = 0; i < text.size(); ++i) {
    std::string damaged = text;
    damaged[i] = static_cast<char>(damaged[i] ^ 4);
    EXPECT_FALSE(decode_versions(damaged)) << i;
    EXPECT_FALSE(decode_versions(text.substr(0, i))) << i;
  }
}

}  // namespace
}  // namespace srfs::update
