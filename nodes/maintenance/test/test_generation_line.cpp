// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/generation_line.hpp"

#include <gmock/gmock.h>

namespace srfs {
namespace {

using testing::SizeIs;

TEST(GenerationLine, TheNewestSetIsTheOneThatHolds) {
  srfs_msgs::srv::SaveParameters_Response said;
  said.trial_left_ms = 1001;
  said.history.resize(2);
  said.history[0].number = 8;
  said.history[0].count = 3;
  said.history[0].saved = "2026-11-21T08:00:00Z";
  said.history[0].origin = "keep (telecommand)";
  said.history[0].values = "log_level=warn";
  said.history[1].number = 7;
  const auto lines = to_mission("payload_eps", said);
  ASSERT_THAT(lines, SizeIs(2));
  EXPECT_EQ(lines[0].node, "payload_eps");
  EXPECT_EQ(lines[0].number, 8U);
  EXPECT_TRUE(lines[0].current);
  EXPECT_EQ(lines[0].values, 3U);
  EXPECT_EQ(lines[0].saved, "2026-11-21T08:00:00Z");
  EXPECT_EQ(lines[0].origin, "keep (telecommand)");
  EXPECT_EQ(lines[0].content, "log_level=warn");
  EXPECT_EQ(lines[0].trial_left_s, 2U) << "rounded up: something is on trial";
  EXPECT_EQ(lines[1].number, 7U);
  EXPECT_FALSE(lines[1].current);
}

TEST(GenerationLine, ANodeThatKeepsNothingHasTheDeploymentsValues) {
  const auto lines = to_mission("ttc", {});
  ASSERT_THAT(lines, SizeIs(1));
  EXPECT_EQ(lines[0].number, 0U);
  EXPECT_TRUE(lines[0].current);
  EXPECT_EQ(lines[0].trial_left_s, 0U);
}

TEST(GenerationLine, CutsTextsThatAreTooLongAndStillEncodes) {
  srfs_msgs::srv::SaveParameters_Response said;
  said.history.resize(1);
  said.history[0].saved = std::string(32, 's');
  said.history[0].origin = std::string(99, 'o');
  said.history[0].values = std::string(300, 'v');
  const auto lines = to_mission(std::string(100, 'n'), said);
  const auto decoded = mission::ParameterGenerationHousekeeping::decode(lines.at(0).encoded());
  ASSERT_TRUE(decoded);
  EXPECT_EQ(decoded->saved, std::string(24, 's'));
  EXPECT_EQ(decoded->content, std::string(200, 'v'));
}

}  // namespace
}  // namespace srfs
