// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <gtest/gtest.h>

#include "ros/parameters.hpp"

namespace srfs::ros {
namespace {

ParameterSet with_overrides(const std::string& yaml) {
  return ParameterSet(ConfigSection::parse(yaml, "x.yaml"));
}

std::string declare_error(const std::string& yaml) {
  try {
    ParameterSet set = with_overrides(yaml);
    set.declare("period_ms", {std::int64_t{100}, ParameterRange{10, 1000}, "Period"});
    set.finish();
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "";
}

TEST(ParameterSet, StartsFromTheDeploymentElseFromTheDefault) {
  ParameterSet set = with_overrides("period_ms: 250\n");
  EXPECT_EQ(
      std::get<std::int64_t>(set.declare("period_ms", {std::int64_t{100}, ParameterRange{10, 1000}, ""})),
      250);
  EXPECT_EQ(std::get<std::string>(set.declare("mode", {std::string("safe"), std::nullopt, ""})), "safe");
}

TEST(ParameterSet, RefusesOverridesOfTheWrongTypeRangeOrName) {
  EXPECT_EQ(declare_error("period_ms: 100\n"), "");
  EXPECT_EQ(declare_error("period_ms: fast\n"), "x.yaml:1: 'period_ms': expected integer, found 'fast'");
  EXPECT_EQ(declare_error("period_ms: 5\n"),
            "x.yaml:1: 'period_ms': expected integer from 10 to 1000, found '5'");
  EXPECT_NE(declare_error("peroid_ms: 5\n").find("'peroid_ms': unknown key, expected one of period_ms"),
            std::string::npos);
}

TEST(ParameterSet, AppliesAllChangesOrNone) {
  ParameterSet set;
  set.declare("a", {std::int64_t{1}, ParameterRange{0, 10}, ""});
  set.declare("b", {2.0, std::nullopt, ""});
  const auto refusals = set.set_atomically({{"a", std::int64_t{5}}, {"b", std::string("x")}});
  EXPECT_EQ(refusals[0], "");
  EXPECT_EQ(refusals[1], "parameter 'b' is of type double, not string");
  EXPECT_EQ(std::get<std::int64_t>(*set.find("a")), 1) << "nothing may change when one is refused";
}

TEST(ParameterSet, SaysWhyAChangeIsRefused) {
  ParameterSet set;
  set.declare("a", {std::int64_t{1}, ParameterRange{0, 10}, ""});
  set.declare("fixed", {true, std::nullopt, "", true});
  set.set_check([](const std::string&, const ParameterValue& v) -> Result<void, std::string> {
    if (std::get<std::int64_t>(v) == 7) return Err(std::string("seven is taken"));
    return {};
  });
  EXPECT_EQ(set.set_atomically({{"a", std::int64_t{11}}})[0], "parameter 'a': 11 is outside 0..10");
  EXPECT_EQ(set.set_atomically({{"fixed", false}})[0], "parameter 'fixed' is read-only");
  EXPECT_EQ(set.set_atomically({{"none", false}})[0], "parameter 'none' has not been declared");
  EXPECT_EQ(set.set_atomically({{"a", std::int64_t{7}}})[0], "seven is taken");
}

TEST(ParameterSet, ARefusalIsShortHoweverLongTheValueOrTheName) {
  ParameterSet set;
  set.declare("mode", {std::string("safe"), std::nullopt, "", false, {"safe", "nominal"}});
  set.declare("label", {std::string("x"), std::nullopt, ""});
  set.declare("inputs", {std::vector<std::int64_t>{}, std::nullopt, ""});
  set.set_check([](const std::string& name, const ParameterValue& value) -> Result<void, std::string> {
    if (name != "label") return {};
    return Err("not this one: " + std::get<std::string>(value));
  });
  const std::string text(200'000, 'x');
  const auto refusal = [&](const std::string& name, const ParameterValue& value) {
    const std::string why = set.set_atomically({{name, value}}).at(0);
    EXPECT_FALSE(why.empty());
    EXPECT_LE(why.size(), longest_refusal);
    return why;
  };
  EXPECT_EQ(refusal(text, true), "parameter '" + std::string(61, 'x') + "...' has not been declared");
  EXPECT_EQ(refusal("mode", text), "parameter 'mode': a text of 200000 octets is longer than 4096");
  EXPECT_EQ(refusal("mode", std::string(4096, 'x')),
            "parameter 'mode': '" + std::string(61, 'x') + "...' is not one of safe, nominal");
  EXPECT_EQ(refusal("label", std::string(4096, 'x')).substr(0, 18), "not this one: xxxx");
  EXPECT_EQ(refusal("inputs", std::vector<std::int64_t>(200'000)),
            "parameter 'inputs': 200000 items are more than 1024");
}

TEST(ParameterSet, AStepAllowsItsMultiplesAndTheHighest) {
  ParameterSet set;
  set.declare("i", {std::int64_t{10}, ParameterRange{10, 25, 4}, ""});
  set.declare("d", {0.0, ParameterRange{0, 1, 0.1}, ""});
  set.declare("list", {std::vector<std::int64_t>{}, ParameterRange{0, 8, 2}, ""});
  for (const std::int64_t fine : {10, 14, 18, 22, 25}) EXPECT_EQ(set.set_atomically({{"i", fine}})[0], "");
  EXPECT_EQ(set.set_atomically({{"i", std::int64_t{24}}})[0],
            "parameter 'i': 24 is not 10 plus a multiple of 4");
  for (const double fine : {0.1, 0.3, 0.7, 1.0}) EXPECT_EQ(set.set_atomically({{"d", fine}})[0], "");
  EXPECT_NE(set.set_atomically({{"d", 0.35}})[0], "");
  EXPECT_NE(set.set_atomically({{"d", std::nan("")}})[0], "");
  EXPECT_EQ(set.set_atomically({{"list", std::vector<std::int64_t>{2, 8}}})[0], "");
  EXPECT_NE(set.set_atomically({{"list", std::vector<std::int64_t>{2, 3}}})[0], "");
  EXPECT_EQ(descriptor("i", *set.declaration("i")).integer_range.at(0).step, 4U);
  EXPECT_EQ(descriptor("d", *set.declaration("d")).floating_point_range.at(0).step, 0.1);
}

TEST(ParameterSet, AChoiceAllowsOnlyItsTexts) {
  ParameterSet set;
  set.declare("mode", {std::string("safe"), std::nullopt, "", false, {"safe", "nominal"}});
  EXPECT_EQ(set.set_atomically({{"mode", std::string("nominal")}})[0], "");
  EXPECT_EQ(set.set_atomically({{"mode", std::string("fast")}})[0],
            "parameter 'mode': 'fast' is not one of safe, nominal");
  EXPECT_EQ(descriptor("mode", *set.declaration("mode")).additional_constraints, "one of: safe, nominal");
}

TEST(ParameterSet, ASetCheckSeesAllParametersAsTheyWouldBe) {
  ParameterSet set;
  set.declare("low", {std::int64_t{1}, std::nullopt, ""});
  set.declare("high", {std::int64_t{5}, std::nullopt, ""});
  set.set_set_check([](const ParameterSet::Proposal& p) -> Result<void, std::string> {
    if (std::get<std::int64_t>(*p.find("low")) > std::get<std::int64_t>(*p.find("high")))
      return Err(std::string("low is above high"));
    return {};
  });
  EXPECT_EQ(set.set_atomically({{"low", std::int64_t{7}}})[0], "low is above high");
  EXPECT_EQ(set.set_atomically({{"low", std::int64_t{7}}, {"high", std::int64_t{9}}})[0], "");
  EXPECT_EQ(std::get<std::int64_t>(*set.find("low")), 7);
}

TEST(ParameterSet, TellsOnceOfAWholeSet) {
  ParameterSet set;
  set.declare("a", {std::int64_t{1}, std::nullopt, ""});
  set.declare("b", {std::int64_t{1}, std::nullopt, ""});
  std::vector<std::vector<std::string>> told;
  set.set_applied([&](const std::vector<std::string>& names) { told.push_back(names); });
  EXPECT_EQ(set.set_atomically({{"a", std::int64_t{2}}, {"b", std::int64_t{2}}})[0], "");
  EXPECT_NE(set.set_atomically({{"a", std::string("x")}})[0], "");
  EXPECT_EQ(told, (std::vector<std::vector<std::string>>{{"a", "b"}}));
}

TEST(ParameterSet, TellsAfterAChangeHolds) {
  ParameterSet set;
  set.declare("a", {std::int64_t{1}, std::nullopt, ""});
  std::int64_t seen = 0;
  set.set_changed([&](const std::string& name) { seen = std::get<std::int64_t>(*set.find(name)); });
  EXPECT_EQ(set.set_atomically({{"a", std::int64_t{4}}})[0], "");
  EXPECT_EQ(seen, 4);
}

TEST(ParameterMessage, EveryTypeSurvivesTheRoundTrip) {
  const std::vector<ParameterValue> values{true,
                                           std::int64_t{-3},
                                           0.5,
                                           std::string("x"),
                                           std::vector<bool>{true, false},
                                           std::vector<std::int64_t>{1, 2},
                                           std::vector<double>{1.5},
                                           std::vector<std::string>{"a", "b"}};
  for (const auto& value : values) EXPECT_EQ(from_message(to_message(value)), value) << type_text(value);
  EXPECT_FALSE(from_message({})) << "NOT_SET is no value";
}

TEST(ListParameters, FollowsPrefixesAndDepthAsRclcppDoes) {
  using Names = std::vector<std::string>;
  const Names all{"camera.gain", "camera.lens.focus", "camera.lens.ring.step", "cameras", "period"};
  EXPECT_EQ(list_parameter_names(all, {}, 0).names, all);
  EXPECT_EQ(list_parameter_names(all, {}, 1).names, (Names{"cameras", "period"}));
  EXPECT_EQ(list_parameter_names(all, {}, 2).names, (Names{"camera.gain", "cameras", "period"}));
  EXPECT_EQ(list_parameter_names(all, {"camera"}, 0).names,
            (Names{"camera.gain", "camera.lens.focus", "camera.lens.ring.step"}));
  EXPECT_EQ(list_parameter_names(all, {"camera"}, 1).names, Names{"camera.gain"});
  EXPECT_EQ(list_parameter_names(all, {"camera.lens", "period"}, 1).names,
            (Names{"camera.lens.focus", "period"}));
  EXPECT_EQ(list_parameter_names(all, {"nothing"}, 0).names, Names{});
}

TEST(ListParameters, NamesEveryPrefixOnce) {
  const auto result = list_parameter_names({"a.b.c", "a.b.d", "a.e", "f"}, {}, 0);
  EXPECT_EQ(result.prefixes, (std::vector<std::string>{"a.b", "a"}));
}

}  // namespace
}  // namespace srfs::ros
