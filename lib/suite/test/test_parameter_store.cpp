// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "suite/parameter_store.hpp"

namespace srfs::suite {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

ros::StoredParameter stored(const std::string& name, ros::ParameterValue value) {
  return {name, std::move(value), "2026-11-21T08:00:00Z"};
}

std::vector<std::string> names_of(const std::vector<ros::StoredParameter>& list) {
  std::vector<std::string> names;
  for (const auto& p : list) names.push_back(p.name);
  return names;
}

TEST(ParameterFile, EveryTypeSurvivesTheDisk) {
  const std::vector<ros::StoredParameter> all{
      stored("b", true),
      stored("i", std::int64_t{-9'000'000'000'000'000'000}),
      stored("d", 0.1),
      stored("inf", std::numeric_limits<double>::infinity()),
      stored("s", std::string("a \"quoted\"\n: [text] # %")),
      stored("empty", std::string()),
      stored("number as text", std::string("7")),
      stored("bs", std::vector<bool>{true, false}),
      stored("is", std::vector<std::int64_t>{1, -2}),
      stored("ds", std::vector<double>{1.0, 2.5e-300}),
      stored("ss", std::vector<std::string>{"x", "", "true"}),
      stored("none", std::vector<std::string>{}),
  };
  const auto list = read_stored(write_list("probe", all));
  ASSERT_TRUE(list) << list.error();
  EXPECT_EQ(list->history.values(), all);
  EXPECT_TRUE(list->damaged.empty());

  ParameterHistory history;
  history.add(all, "a \"test\"", "now");
  history.trial = all;
  const auto read = read_stored(write_stored("probe", history).value());
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(read->history, history);
  EXPECT_TRUE(read->damaged.empty());
}

TEST(ParameterFile, AnEmptyOneHoldsNothing) {
  ParameterHistory history;
  const auto read = read_stored(write_stored("probe", history).value());
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(read->history, history);
}

TEST(ParameterFile, ADamagedEntryOnlyLosesItself) {
  const auto read = read_stored(
      "format: 1\nparameters:\n"
      "  - { name: a, type: integer, value: 5, saved: x }\n"
      "  - { name: b, type: integer, value: many, trial: false, saved: x }\n"
      "  - { name: c, type: colour, value: 1, trial: false, saved: x }\n"
      "  - { type: integer, value: 1, trial: false }\n"
      "  - 17\n"
      "  - { name: d, type: string array, value: [x, y], trial: true, saved: x }\n");
  ASSERT_TRUE(read) << read.error();
  EXPECT_THAT(names_of(read->history.values()), ElementsAre("a"));
  EXPECT_THAT(names_of(read->history.trial), ElementsAre("d")) << "as earlier versions marked it";
  EXPECT_EQ(read->damaged.size(), 4U);
  EXPECT_THAT(read->damaged[0], HasSubstr("line 4"));
}

TEST(ParameterFile, WhatIsNoFileOfParametersIsRefusedWhole) {
  for (const char* text : {"", "17", "[1, 2]", "format: 1\n", "format: 2\ngenerations: []\ntrial: []\n",
                           "format: 3\nparameters: []\n", "format: 1\nparameters: {a: 1}\n", "format: [\n",
                           "\x01\x02\xff", "format: x\nparameters: []\n"})
    EXPECT_FALSE(read_stored(text)) << text;
}

TEST(ParameterFile, AnySingleFlippedBitAndAnyCutIsDamage) {
  ParameterHistory history;
  history.add({stored("a", std::int64_t{5}), stored("b", std::string("text"))}, "keep", "then");
  history.add({stored("a", std::int64_t{6}), stored("c", 2.5)}, "confirm", "now");
  history.trial = {stored("t", std::int64_t{9})};
  const std::string good = write_stored("probe", history).value();
  ASSERT_TRUE(read_stored(good));
  for (std::size_t octet = 0; octet < good.size(); ++octet) {
    EXPECT_FALSE(read_stored(good.substr(0, octet))) << "cut at " << octet;
    for (int bit = 0; bit < 8; ++bit) {
      std::string bad = good;
      bad[octet] = static_cast<char>(bad[octet] ^ (1 << bit));
      EXPECT_FALSE(read_stored(bad)) << "octet " << octet << " bit " << bit;
    }
  }
}

TEST(ParameterFile, OfAHandWrittenListNoFlippedBitDoesMoreThanLoseOrChangeEntries) {
  const std::string good = write_list("probe", {stored("a", std::int64_t{5}), stored("c", 2.5)});
  for (std::size_t octet = 0; octet < good.size(); ++octet) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string bad = good;
      bad[octet] = static_cast<char>(bad[octet] ^ (1 << bit));
      static_cast<void>(read_stored(bad));  // must return, with any result
    }
  }
}

TEST(ParameterHistory, KeepsTheLastTenSetsAndNoNumberTwice) {
  ParameterHistory history;
  for (int i = 1; i <= 14; ++i) history.add({stored("a", std::int64_t{i})}, "keep", "now");
  ASSERT_EQ(history.generations.size(), 10U);
  EXPECT_EQ(history.generations.front().number, 5U);
  EXPECT_EQ(history.generations.back().number, 14U);
  EXPECT_EQ(history.find(4), nullptr);
  EXPECT_EQ(history.find(9)->values, (std::vector{stored("a", std::int64_t{9})}));
}

TEST(ParameterHistory, TheSameValuesAgainAreNoNewSet) {
  ParameterHistory history;
  history.add({}, "reset", "now");
  EXPECT_TRUE(history.generations.empty()) << "the deployment's hold anyway";
  history.add({stored("a", true)}, "keep", "now");
  history.add({{"a", true, "later"}}, "keep", "later");
  EXPECT_EQ(history.generations.size(), 1U);
}

TEST(ParameterHistory, ThatIsTooLargeLosesItsOldestSetsAndATooLargeSetIsRefused) {
  ParameterHistory history;
  for (int i = 0; i < 10; ++i)
    history.add({stored("a", std::string(10'000, static_cast<char>('a' + i)))}, "keep", "now");
  const auto text = write_stored("probe", history);
  ASSERT_TRUE(text);
  EXPECT_LE(text->size(), largest_parameter_file);
  EXPECT_EQ(history.generations.size(), 6U);
  EXPECT_EQ(read_stored(*text)->history, history);

  history.add({stored("a", std::string(70'000, 'x'))}, "keep", "now");
  EXPECT_FALSE(write_stored("probe", history));
  history.add(std::vector<ros::StoredParameter>(most_stored_parameters + 1, stored("a", true)), "keep",
              "now");
  EXPECT_FALSE(write_stored("probe", history));
}

TEST(ParameterText, IsForPeople) {
  EXPECT_EQ(to_text({stored("a", std::int64_t{5}), stored("b", std::string("text")), stored("c", 2.5),
                     stored("d", true), stored("e", std::vector<std::string>{"x", "y"}),
                     stored("f", std::vector<bool>{true, false})}),
            "a=5, b=text, c=2.5, d=true, e=[x,y], f=[true,false]");
}

class StoredStart : public testing::Test {
 protected:
  static ros::ParameterSet with(std::vector<ros::StoredParameter> list) {
    ros::ParameterSet set(ConfigSection::parse("period_ms: 250\n", "x.yaml"));
    set.set_stored(std::move(list));
    return set;
  }
  static std::int64_t declare_period(ros::ParameterSet& set, bool read_only = false) {
    return std::get<std::int64_t>(
        set.declare("period_ms", {std::int64_t{100}, ros::ParameterRange{10, 1000}, "", read_only, {}}));
  }
};

TEST_F(StoredStart, GoesOverTheDeploymentsValue) {
  ros::ParameterSet set = with({stored("period_ms", std::int64_t{500})});
  EXPECT_EQ(declare_period(set), 500);
  set.finish();
  EXPECT_TRUE(set.set_aside().empty());
}

TEST_F(StoredStart, GoesOverThatOfAReadOnlyParameterToo) {
  ros::ParameterSet set = with({stored("period_ms", std::int64_t{500})});
  EXPECT_EQ(declare_period(set, true), 500);
}

TEST_F(StoredStart, SetsAsideWhatDoesNotFitAndStartsFromTheDeployment) {
  const std::vector<std::pair<ros::StoredParameter, std::string>> cases{
      {stored("period_ms", std::int64_t{5000}), "outside"},
      {stored("period_ms", 500.0), "type integer, not double"},
      {stored("nobody_knows", std::int64_t{1}), "no such parameter"},
  };
  for (const auto& [entry, why] : cases) {
    ros::ParameterSet set = with({entry});
    EXPECT_EQ(declare_period(set), 250) << why;
    set.finish();
    ASSERT_EQ(set.set_aside().size(), 1U) << why;
    EXPECT_THAT(set.set_aside()[0].reason, HasSubstr(why));
    EXPECT_TRUE(set.stored().empty());
  }
}

TEST_F(StoredStart, SetsAsideWhatTheNodesOwnCheckRefuses) {
  ros::ParameterSet set = with({stored("period_ms", std::int64_t{700})});
  declare_period(set);
  set.set_check([](const std::string&, const ros::ParameterValue& v) -> Result<void, std::string> {
    if (std::get<std::int64_t>(v) == 700) return Err(std::string("seven is taken"));
    return {};
  });
  set.finish();
  EXPECT_EQ(std::get<std::int64_t>(*set.find("period_ms")), 250);
  EXPECT_EQ(set.set_aside().at(0).reason, "seven is taken");
}

}  // namespace
}  // namespace srfs::suite
