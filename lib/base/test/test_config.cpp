// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/config.hpp"
#include "base/file.hpp"
#include "tests/temporary_folder.hpp"

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

class ExtendedFile : public testing::Test {
 protected:
  /// Writes NAME.yaml.
  void write(const std::string& name, const std::string& text) const {
    ASSERT_TRUE(write_file_atomically(file(name), text));
  }
  [[nodiscard]] std::filesystem::path file(const std::string& name) const {
    return folder_.path() / (name + ".yaml");
  }
  [[nodiscard]] ConfigSection load(const std::string& name) const { return ConfigSection::load(file(name)); }

  testing_support::TemporaryFolder folder_;
};

TEST_F(ExtendedFile, MappingsAreMergedAndOtherValuesReplaced) {
  write("a", "x: 1\nm: {b: 1, d: {e: 1, f: 2}}\nlist: [1, 2, 3]\nitems: [{i: 1}, {i: 2}]\n");
  write("b", "extends: a\nm: {c: 3, d: {f: 4}}\nlist: [9]\n");
  write("c", "extends: b\nx: 7\n");
  const auto config = load("c");
  EXPECT_EQ(config.integer("x", 0, 9), 7);
  const auto m = config.section("m");
  EXPECT_EQ(m.keys(), (std::vector<std::string>{"b", "d", "c"}));
  EXPECT_EQ(m.section("d").integer("e", 0, 9), 1);
  EXPECT_EQ(m.section("d").integer("f", 0, 9), 4);
  EXPECT_EQ(config.integers("list", 0, 9), (std::vector<std::int64_t>{9}));
  EXPECT_EQ(config.sections("items").size(), 2U);
  EXPECT_NO_THROW(config.finish());
  EXPECT_EQ(config.files(), (std::vector<std::string>{file("c"), file("b"), file("a")}));
}

TEST_F(ExtendedFile, NullRemovesAKeyOfTheOtherFile) {
  write("a", "m: {b: 1, c: 2}\nring: {p: 1}\nempty:\n");
  write("b", "extends: a\nm: {b: null}\nring: null\n");
  const auto config = load("b");
  EXPECT_EQ(config.section("m").keys(), std::vector<std::string>{"c"});
  EXPECT_FALSE(config.has("ring"));
  EXPECT_FALSE(config.section("ring").has("p"));
  EXPECT_TRUE(config.has("empty")) << "null that removes nothing stays an empty section";
}

TEST_F(ExtendedFile, MessagesNameTheFileThatHasTheValue) {
  write("a", "m:\n  p: soon\n  q: 1\n");
  write("b", "extends: a\nm:\n  q: late\n");
  const auto m = load("b").section("m");
  EXPECT_TRUE(error_of([&] { (void)m.integer("p", 0, 9); }).starts_with(file("a").string() + ":2: 'm.p': "));
  EXPECT_TRUE(error_of([&] { (void)m.integer("q", 0, 9); }).starts_with(file("b").string() + ":3: 'm.q': "));
  const auto unknown = load("b").section("m");
  (void)unknown.has("q");
  EXPECT_TRUE(error_of([&] { unknown.finish(); }).starts_with(file("a").string() + ":2: 'm.p': unknown key"));
}

TEST_F(ExtendedFile, ALoopOrAMissingFileIsRefusedByName) {
  write("a", "extends: b\n");
  write("b", "extends: c\n");
  write("c", "extends: a\n");
  EXPECT_EQ(error_of([&] { (void)load("a"); }),
            file("c").string() + ":1: 'extends': expected a file that does not extend this one, found 'a'");
  write("self", "extends: self\n");
  EXPECT_TRUE(error_of([&] { (void)load("self"); }).ends_with("found 'self'"));
  write("orphan", "x: 1\nextends: nothing\n");
  EXPECT_EQ(error_of([&] { (void)load("orphan"); }),
            file("orphan").string() +
                ":2: 'extends': expected the name of a file in this folder, without .yaml (" +
                file("nothing").string() + "), found 'nothing'");
  write("far", "extends: ../a\n");
  EXPECT_TRUE(error_of([&] { (void)load("far"); }).starts_with(file("far").string() + ":1: 'extends'"));
}

}  // namespace
}  // namespace srfs
