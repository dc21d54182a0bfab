// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/config.hpp"

namespace srfs {
namespace {

std::string error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const ConfigError& e) {
    return e.what();
  }
  return "no error";
}

TEST(ConfigSection, ReadsTypedValues) {
  const auto config = ConfigSection::parse("a: 5\nb: text\nc: [1, 2]\nd: {e: 0.5}\nf: true\n", "x.yaml");
  EXPECT_EQ(config.integer("a", 0, 10), 5);
  EXPECT_EQ(config.text("b"), "text");
  EXPECT_EQ(config.integers("c", 0, 9), (std::vector<std::int64_t>{1, 2}));
  EXPECT_EQ(config.section("d").number("e", 0, 1), 0.5);
  EXPECT_TRUE(config.boolean("f", false));
  EXPECT_NO_THROW(config.finish());
}

TEST(ConfigSection, NamesFileLineKeyAndWhatWasExpectedForAWrongType) {
  const auto config = ConfigSection::parse("nodes:\n  - name: timing\n    period: soon\n", "x.yaml");
  EXPECT_EQ(error_of([&] { (void)config.sections("nodes").at(0).integer("period", 1, 100); }),
            "x.yaml:3: 'nodes[0].period': expected an integer from 1 to 100, found 'soon'");
}

TEST(ConfigSection, RefusesAValueOutOfRange) {
  const auto config = ConfigSection::parse("p: 101\n", "x.yaml");
  EXPECT_EQ(error_of([&] { (void)config.integer("p", 1, 100); }),
            "x.yaml:1: 'p': expected an integer from 1 to 100, found '101'");
}

TEST(ConfigSection, NamesAnUnknownKeyAndTheKnownOnes) {
  const auto config = ConfigSection::parse("period: 1\nperoid: 2\n", "x.yaml");
  (void)config.integer("period", 1, 100);
  EXPECT_EQ(error_of([&] { config.finish(); }), "x.yaml:2: 'peroid': unknown key, expected one of period");
}

TEST(ConfigSection, SaysWhichRequiredKeyIsMissing) {
  const auto config = ConfigSection::parse("a: 1\n", "x.yaml");
  EXPECT_EQ(error_of([&] { (void)config.text("executable"); }),
            "x.yaml:1: 'executable': expected text, found nothing");
}

TEST(ConfigSection, ReportsBrokenYamlAndAMissingFile) {
  EXPECT_NE(error_of([] { ConfigSection::parse("a: [1,\n", "x.yaml"); }).find("x.yaml:"), std::string::npos);
  EXPECT_NE(
      error_of([] { ConfigSection::load("/nonexistent/x.yaml"); }).find("/nonexistent/x.yaml: cannot open"),
      std::string::npos);
}

TEST(ConfigSection, NotANumberIsNotInAnyRange) {
  const auto config = ConfigSection::parse("x: .nan\n", "x.yaml");
  EXPECT_NE(error_of([&] { (void)config.number("x", 0, 1); }), "no error");
}

}  // namespace
}  // namespace srfs
