// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "ros/node_names.hpp"

namespace srfs::ros {
namespace {

RemapRule rule(const std::string& text) {
  return parse_remap_rule(text).value();
}

TEST(NodeNames, AreAbsoluteBelowTheNodeOrInItsNamespace) {
  const NodeNames root("eps");
  EXPECT_EQ(root.full_name(), "/eps");
  EXPECT_EQ(root.resolve("/can/task_flags", NameKind::topic), "/can/task_flags");
  EXPECT_EQ(root.resolve("~/get_state", NameKind::service), "/eps/get_state");
  EXPECT_EQ(root.resolve("tick", NameKind::topic), "/tick");

  const NodeNames below("eps", "/bus_b");
  EXPECT_EQ(below.full_name(), "/bus_b/eps");
  EXPECT_EQ(below.resolve("/can/task_flags", NameKind::topic), "/can/task_flags");
  EXPECT_EQ(below.resolve("~/get_state", NameKind::service), "/bus_b/eps/get_state");
  EXPECT_EQ(below.resolve("tick", NameKind::topic), "/bus_b/tick");
}

TEST(NodeNames, AreRemappedByTheFirstRuleThatMatchesTheExpandedName) {
  const NodeNames names("eps", "/",
                        {rule("/can/task_flags:=/can_b/task_flags"), rule("can/task_flags:=/never"),
                         rule("~/activity:=activity_of_eps")});
  EXPECT_EQ(names.resolve("/can/task_flags", NameKind::topic), "/can_b/task_flags");
  EXPECT_EQ(names.resolve("/eps/activity", NameKind::topic), "/activity_of_eps");
  EXPECT_EQ(names.resolve("/can_b/task_flags", NameKind::topic), "/can_b/task_flags")
      << "no rule of a result";
}

TEST(NodeNames, AreRemappedForTopicsOrServicesAloneWhereTheRuleSaysSo) {
  const NodeNames names("eps", "/", {rule("rostopic:///a:=/topic_a"), rule("rosservice:///a:=/service_a")});
  EXPECT_EQ(names.resolve("/a", NameKind::topic), "/topic_a");
  EXPECT_EQ(names.resolve("/a", NameKind::service), "/service_a");
}

TEST(NodeNames, OfTheNodeItselfComeFromRulesToo) {
  const NodeNames names("eps", "/", {rule("__ns:=/bus_b"), rule("__node:=eps_b"), rule("__ns:=/late")});
  EXPECT_EQ(names.full_name(), "/bus_b/eps_b") << "the first of a kind holds";
  EXPECT_EQ(names.resolve("~/x", NameKind::topic), "/bus_b/eps_b/x");
  EXPECT_EQ(NodeNames("eps", "/", {rule("__name:=other")}).name(), "other") << "the older word for __node";
}

TEST(NodeNames, AreNotChangedByRulesForAnotherNode) {
  const NodeNames names("eps", "/", {rule("adcs:/a:=/b"), rule("eps:/c:=/d"), rule("adcs:__ns:=/x")});
  EXPECT_EQ(names.full_name(), "/eps");
  EXPECT_EQ(names.resolve("/a", NameKind::topic), "/a");
  EXPECT_EQ(names.resolve("/c", NameKind::topic), "/d");
}

TEST(RemapRules, AreRefusedWithWhatIsWrong) {
  for (const char* text :
       {"", "/a", "/a:=", ":=/b", "/a:=/b/", "/a:=//b", "/1a:=/b", "/a:=/b c", "__ns:=a",
        "__ns:=", "__node:=/a", "__node:=", "no node:/a:=/b", "rostopic://:=/b", "~:=/b"}) {
    const auto parsed = parse_remap_rule(text);
    ASSERT_FALSE(parsed) << text;
    EXPECT_FALSE(parsed.error().empty());
  }
  EXPECT_TRUE(parse_remap_rule("__ns:=/"));
  EXPECT_FALSE(parse_remap_rule("/a:=/" + std::string(247, 'b'))) << "too long for a DDS topic";
}

Result<CommandLine, std::string> read(std::vector<const char*> arguments) {
  arguments.insert(arguments.begin(), "node");
  return read_command_line(static_cast<int>(arguments.size()), arguments.data());
}

TEST(RosArguments, StandBetweenTheirMarkAndTwoDashesAnywhereInTheLine) {
  const auto line =
      read({"--name", "eps", "--ros-args", "-r", "/a:=/b", "--remap", "__ns:=/c", "--", "--var", "x"});
  ASSERT_TRUE(line) << line.error();
  EXPECT_EQ(line->others, (std::vector<std::string>{"--name", "eps", "--var", "x"}));
  EXPECT_EQ(line->remap, (std::vector<RemapRule>{rule("/a:=/b"), rule("__ns:=/c")}));
  EXPECT_EQ(read({"-r", "/a:=/b"})->others.size(), 2U) << "without the mark it is the program's";
}

TEST(RosArguments, ThatAreNotKnownOrIncompleteAreRefused) {
  EXPECT_FALSE(read({"--ros-args", "-r"}));
  EXPECT_FALSE(read({"--ros-args", "-r", "nonsense"}));
  EXPECT_FALSE(read({"--ros-args", "--params-file", "x.yaml"}));
}

}  // namespace
}  // namespace srfs::ros
