// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "base/file.hpp"
#include "programs/srfs/ad_hoc.hpp"
#include "suite/deployment.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::tool {
namespace {

/// "a=1 b=[1, 2]", or why not.
std::string shown(const Result<std::vector<GivenParameter>, std::string>& parameters) {
  if (!parameters) return "wrong: " + parameters.error();
  std::string text;
  for (const GivenParameter& p : *parameters) text += (text.empty() ? "" : " ") + p.name + "=" + p.value;
  return text;
}

TEST(AdHoc, ParametersAreTakenOutOfTheRosArgumentsAlone) {
  const auto read =
      read_ad_hoc_arguments({"-p", "mine", "--ros-args", "-p", "a:=1", "-r", "x:=y", "--params-file",
                             "f.yaml", "--param", "b:=[1, 2]", "--", "-p", "too"});
  ASSERT_TRUE(read);
  EXPECT_EQ(shown(read->parameters), "a=1 b=[1, 2]");
  EXPECT_EQ(read->files, std::vector<std::string>{"f.yaml"});
  EXPECT_EQ(read->others,
            (std::vector<std::string>{"-p", "mine", "--ros-args", "-r", "x:=y", "--", "-p", "too"}));
}

TEST(AdHoc, WrongArgumentsAreNamed) {
  for (const char* text : {"a=1", ":=1", ""})
    EXPECT_FALSE(read_ad_hoc_arguments({"--ros-args", "-p", text})) << text;
  EXPECT_EQ(read_ad_hoc_arguments({"--ros-args", "-p"}).error(), "-p: expected a value behind it");
}

TEST(AdHoc, AParameterFileOfRos2IsReadForTheNode) {
  const std::string file =
      "/**:\n  ros__parameters: { all: 1 }\n/counter:\n  ros__parameters:\n    list: [1, 2]\n    group: { "
      "inner: "
      "text }\nother:\n  ros__parameters: { theirs: 1 }\n";
  EXPECT_EQ(shown(parameters_of_file(file, "counter")), "all=1 list=[1, 2] group.inner=text");
  EXPECT_EQ(shown(parameters_of_file("counter: { all: 1 }", "counter")),
            "wrong: counter: expected ros__parameters, a mapping");
  EXPECT_TRUE(shown(parameters_of_file("counter: [", "counter")).starts_with("wrong: "));
  EXPECT_EQ(shown(parameters_of_file("[]", "counter")), "wrong: expected names of nodes");
}

TEST(AdHoc, ANodeIsCalledAsItsProgram) {
  EXPECT_EQ(node_name_of("/opt/bin/tick_counter_node"), "tick_counter");
  EXPECT_EQ(node_name_of("counter"), "counter");
}

TEST(AdHoc, WhatIsWrittenIsADeployment) {
  const testing_support::TemporaryFolder folder;
  const auto text =
      ad_hoc_deployment("counter", "/a b/counter_node",
                        {{"every", "1"}, {"every", "10"}, {"words", "\"x: # y\""}, {"l", "[1, 2]"}});
  ASSERT_TRUE(text);
  ASSERT_TRUE(write_file_atomically(folder.path() / "d.yaml", *text));
  const auto deployment = suite::Deployment::load(folder.path() / "d.yaml");
  ASSERT_NE(deployment.find("counter"), nullptr);
  const suite::NodeEntry& entry = *deployment.find("counter");
  EXPECT_EQ(entry.executable, "/a b/counter_node");
  EXPECT_EQ(entry.parameters.integer("every", 0, 100), 10);
  EXPECT_EQ(entry.parameters.text("words"), "x: # y");
  EXPECT_TRUE(deployment.open_orders);
  EXPECT_FALSE(deployment.ring.enabled);
  EXPECT_FALSE(ad_hoc_deployment("counter", "x", {{"every", "["}}));
}

}  // namespace
}  // namespace srfs::tool
