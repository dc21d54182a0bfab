// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/lane_call.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace srfs {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::Not;

const LaneFolders folders{
    "/opt/srfs/bin/srfs-lane", "/opt/srfs", "/var/srfs/update/job", "/var/srfs/update/lane", {}};

update::Manifest manifest() {
  update::Manifest m;
  m.node = "payload_eps";
  m.options = {"-O2", "-g"};
  m.self_test = seconds(7);
  return m;
}

TEST(LaneCallTest, the_build_gets_the_sources_the_prefix_and_each_option_of_the_manifest) {
  const auto command = build_command(folders, manifest());
  EXPECT_EQ(command.at(0), "/opt/srfs/bin/srfs-lane");
  EXPECT_EQ(command.at(1), "build");
  EXPECT_THAT(command, Contains("/var/srfs/update/job/sources"));
  EXPECT_THAT(command, Contains("/opt/srfs"));
  EXPECT_THAT(command, Contains("--option=-O2"));
  EXPECT_THAT(command, Contains("--option=-g"));
}

TEST(LaneCallTest, a_mission_of_its_own_is_built_with_its_own_structs) {
  EXPECT_THAT(build_command(folders, manifest()), Not(Contains("--structures")));
  LaneFolders of_a_mission = folders;
  of_a_mission.structures = "/srv/mission/structures";
  const auto command = build_command(of_a_mission, manifest());
  const auto option = std::find(command.begin(), command.end(), "--structures");
  ASSERT_LT(std::distance(option, command.end()), static_cast<std::ptrdiff_t>(command.size()));
  ASSERT_NE(option + 1, command.end());
  EXPECT_EQ(*(option + 1), "/srv/mission/structures");
}

TEST(LaneCallTest, the_self_test_gets_what_was_built_and_the_time_of_the_manifest) {
  const auto command = self_test_command(folders, manifest(), "/etc/srfs/sim.yaml");
  EXPECT_EQ(command.at(1), "self-test");
  EXPECT_THAT(command, Contains(folders.built("payload_eps").string()));
  EXPECT_THAT(command, Contains("7"));
  EXPECT_THAT(command, Contains("/etc/srfs/sim.yaml"));
}

TEST(LaneCallTest, layers_of_the_sandbox_that_are_required_are_the_last_words) {
  LaneFolders board = folders;
  board.required = {"user", "files"};
  for (const auto& command :
       {build_command(board, manifest()), self_test_command(board, manifest(), "/d.yaml")}) {
    ASSERT_GT(command.size(), 3U);
    EXPECT_EQ(std::vector<std::string>(command.end() - 3, command.end()),
              (std::vector<std::string>{"--require", "user", "files"}));
  }
  EXPECT_THAT(build_command(folders, manifest()), Not(Contains("--require")));
}

TEST(LaneCallTest, a_report_of_success_has_the_program_s_digest_and_size) {
  const auto report = read_lane_report(
      R"({"outcome": "built", "sha256": "ab", "octets": 1234, "seconds": 2.5, "layers": ["rlimits"]})",
      "exit code 0");
  EXPECT_TRUE(report.good);
  EXPECT_EQ(report.program_sha256, "ab");
  EXPECT_EQ(report.program_octets, 1234U);
  EXPECT_EQ(report.took_ms, 2500U);
  EXPECT_TRUE(read_lane_report(R"({"outcome": "passed"})", "").good);
}

TEST(LaneCallTest, any_other_outcome_is_a_failure_with_its_reason) {
  const auto report = read_lane_report(R"({"outcome": "memory_limit", "reason": "768 MiB"})", "exit code 3");
  EXPECT_FALSE(report.good);
  EXPECT_EQ(report.reason, "memory_limit: 768 MiB");
}

TEST(LaneCallTest, a_report_that_is_none_is_a_failure_that_says_how_the_lane_ended) {
  for (const std::string_view text :
       {"", "{", "[]", "{}", R"({"outcome": 7})", R"({"outcome": "", "octets": "many"})"}) {
    const auto report = read_lane_report(text, "signal 9 (SIGKILL)");
    EXPECT_FALSE(report.good) << text;
    EXPECT_THAT(report.reason, HasSubstr("signal 9 (SIGKILL)")) << text;
  }
  const auto odd = read_lane_report(R"({"outcome": "built", "seconds": -3, "octets": "x"})", "");
  EXPECT_EQ(odd.took_ms, 0U);
  EXPECT_EQ(odd.program_octets, 0U);
}

}  // namespace
}  // namespace srfs
