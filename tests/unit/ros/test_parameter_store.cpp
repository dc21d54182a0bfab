#include <limits>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ros/parameter_store.hpp"

namespace srfs::ros {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

StoredParameter stored(const std::string& name, ParameterValue value, bool trial = false) {
  return {name, std::move(value), trial, "2026-11-21T08:00:00Z"};
}

std::vector<std::string> names_of(const std::vector<StoredParameter>& list) {
  std::vector<std::string> names;
  for (const auto& p : list) names.push_back(p.name);
  return names;
}

TEST(ParameterFile, EveryTypeSurvivesTheDisk) {
  const std::vector<StoredParameter> all{
      stored("b", true),
      stored("i", std::int64_t{-9'000'000'000'000'000'000}),
      stored("d", 0.1, true),
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
  const auto read = read_stored(write_stored("probe", all));
  ASSERT_TRUE(read) << read.error();
  EXPECT_EQ(read->parameters, all);
  EXPECT_TRUE(read->damaged.empty());
}

TEST(ParameterFile, AnEmptyOneHoldsNothing) {
  const auto read = read_stored(write_stored("probe", {}));
  ASSERT_TRUE(read) << read.error();
  EXPECT_TRUE(read->parameters.empty());
}

TEST(ParameterFile, ADamagedEntryOnlyLosesItself) {
  const auto read = read_stored(
      "format: 1\nparameters:\n"
      "  - { name: a, type: integer, value: 5, trial: false, saved: x }\n"
      "  - { name: b, type: integer, value: many, trial: false, saved: x }\n"
      "  - { name: c, type: colour, value: 1, trial: false, saved: x }\n"
      "  - { type: integer, value: 1, trial: false }\n"
      "  - 17\n"
      "  - { name: d, type: string array, value: [x, y], trial: true, saved: x }\n");
  ASSERT_TRUE(read) << read.error();
  EXPECT_THAT(names_of(read->parameters), ElementsAre("a", "d"));
  EXPECT_EQ(read->damaged.size(), 4U);
  EXPECT_THAT(read->damaged[0], HasSubstr("line 4"));
}

TEST(ParameterFile, WhatIsNoFileOfParametersIsRefusedWhole) {
  for (const char* text :
       {"", "17", "[1, 2]", "format: 1\n", "format: 2\nparameters: []\n", "format: 1\nparameters: {a: 1}\n",
        "format: [\n", "\x01\x02\xff", "format: x\nparameters: []\n"})
    EXPECT_FALSE(read_stored(text)) << text;
}

TEST(ParameterFile, NoSingleFlippedBitDoesMoreThanLoseOrChangeOneEntry) {
  const std::vector<StoredParameter> all{stored("a", std::int64_t{5}), stored("b", std::string("text")),
                                         stored("c", 2.5)};
  const std::string good = write_stored("probe", all);
  for (std::size_t octet = 0; octet < good.size(); ++octet) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string bad = good;
      bad[octet] = static_cast<char>(bad[octet] ^ (1 << bit));
      (void)read_stored(bad);  // must come back, with whatever it finds
    }
  }
}

class StoredStart : public testing::Test {
 protected:
  static ParameterSet with(std::vector<StoredParameter> list) {
    ParameterSet set(ConfigSection::parse("period_ms: 250\n", "x.yaml"));
    set.set_stored(std::move(list));
    return set;
  }
  static std::int64_t declare_period(ParameterSet& set, bool read_only = false) {
    return std::get<std::int64_t>(
        set.declare("period_ms", {std::int64_t{100}, ParameterRange{10, 1000}, "", read_only, {}}));
  }
};

TEST_F(StoredStart, GoesOverTheDeploymentsValue) {
  ParameterSet set = with({stored("period_ms", std::int64_t{500})});
  EXPECT_EQ(declare_period(set), 500);
  set.finish();
  EXPECT_TRUE(set.set_aside().empty());
}

TEST_F(StoredStart, GoesOverThatOfAReadOnlyParameterToo) {
  ParameterSet set = with({stored("period_ms", std::int64_t{500})});
  EXPECT_EQ(declare_period(set, true), 500);
}

TEST_F(StoredStart, SetsAsideWhatDoesNotFitAndStartsFromTheDeployment) {
  const std::vector<std::pair<StoredParameter, std::string>> cases{
      {stored("period_ms", std::int64_t{5000}), "outside"},
      {stored("period_ms", 500.0), "type integer, not double"},
      {stored("period_ms", std::int64_t{500}, true), "nobody confirmed"},
      {stored("nobody_knows", std::int64_t{1}), "no such parameter"},
  };
  for (const auto& [entry, why] : cases) {
    ParameterSet set = with({entry});
    EXPECT_EQ(declare_period(set), 250) << why;
    set.finish();
    ASSERT_EQ(set.set_aside().size(), 1U) << why;
    EXPECT_THAT(set.set_aside()[0].reason, HasSubstr(why));
    EXPECT_TRUE(set.stored().empty());
  }
}

TEST_F(StoredStart, SetsAsideWhatTheNodesOwnCheckRefuses) {
  ParameterSet set = with({stored("period_ms", std::int64_t{700})});
  declare_period(set);
  set.set_check([](const std::string&, const ParameterValue& v) -> Result<void, std::string> {
    if (std::get<std::int64_t>(v) == 700) return Err(std::string("seven is taken"));
    return {};
  });
  set.finish();
  EXPECT_EQ(std::get<std::int64_t>(*set.find("period_ms")), 250);
  EXPECT_EQ(set.set_aside().at(0).reason, "seven is taken");
}

class Storing : public testing::Test {
 protected:
  Storing() {
    set.declare("a", {std::int64_t{1}, ParameterRange{0, 10}, ""});
    set.declare("b", {2.0, std::nullopt, ""});
    set.declare("fixed", {true, std::nullopt, "", true, {}});
    set.finish();
  }
  ParameterSet set;
};

TEST_F(Storing, KeepsTheNamedOnesAsTheyAre) {
  ASSERT_EQ(set.set_atomically({{"a", std::int64_t{4}}})[0], "");
  const auto result = set.store({.names = {"a"}, .values = {}}, "now");
  ASSERT_TRUE(result) << result.error();
  EXPECT_THAT(*result, ElementsAre(StoredParameter{"a", std::int64_t{4}, false, "now"}));
  EXPECT_TRUE(set.stored().empty()) << "not before it is on disk";
}

TEST_F(Storing, WithoutNamesKeepsWhatDiffersFromTheStart) {
  ASSERT_EQ(set.set_atomically({{"b", 3.0}})[0], "");
  const auto result = set.store({}, "now");
  ASSERT_TRUE(result);
  EXPECT_THAT(names_of(*result), ElementsAre("b"));
}

TEST_F(Storing, TakesAValueForTheNextStartAlsoOfAReadOnlyParameter) {
  const auto result = set.store({.names = {}, .values = {{"fixed", false}}, .trial = true}, "now");
  ASSERT_TRUE(result) << result.error();
  EXPECT_TRUE(result->at(0).trial);
  EXPECT_EQ(std::get<bool>(*set.find("fixed")), true) << "unchanged now";
}

TEST_F(Storing, IsAllOrNothingAndSaysWhy) {
  EXPECT_EQ(set.store({.names = {}, .values = {{"b", 1.0}, {"a", std::int64_t{11}}}}, "now").error(),
            "parameter 'a': 11 is outside 0..10");
  EXPECT_EQ(set.store({.names = {"none"}, .values = {}}, "now").error(),
            "parameter 'none' has not been declared");
  EXPECT_EQ(set.store({.names = {"a"}, .values = {}, .clear = true}, "now").error(),
            "parameter 'a' is not stored");
}

TEST_F(Storing, ReplacesAnOlderValueAndForgetsOnDemand) {
  set.set_stored_now({stored("a", std::int64_t{2}), stored("b", 5.0)});
  EXPECT_EQ(set.store({.names = {"a"}, .values = {}}, "now")->size(), 2U);
  EXPECT_THAT(names_of(*set.store({.names = {"a"}, .values = {}, .clear = true}, "now")), ElementsAre("b"));
  EXPECT_TRUE(set.store({.names = {}, .values = {}, .clear = true}, "now")->empty());
}

}  // namespace
}  // namespace srfs::ros
