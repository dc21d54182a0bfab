// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/version_line.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

TEST(VersionLine, TellsGoldenAndAVersionOnProbationApart) {
  update::VersionTable table;
  const auto number =
      table.add(std::string(64, 'a'), 4321, "payload_eps of the ground", UtcTime(seconds(1'795'000'000)));
  ASSERT_TRUE(table.use(number, seconds(90), ""));

  const auto golden = to_mission("payload_eps", table, nullptr);
  EXPECT_EQ(golden.version, 0U);
  EXPECT_EQ(golden.state, mission::VersionState::golden);
  EXPECT_FALSE(golden.active);
  EXPECT_TRUE(golden.last_good);

  const auto line = to_mission("payload_eps", table, table.find(number));
  EXPECT_EQ(line.version, 1U);
  EXPECT_EQ(line.state, mission::VersionState::probation);
  EXPECT_TRUE(line.active);
  EXPECT_FALSE(line.last_good);
  EXPECT_EQ(line.octets, 4321U);
  EXPECT_EQ(line.added_s, 1'795'000'000U);
  EXPECT_EQ(line.probation_s, 90U);
}

TEST(VersionLine, CutsTextsThatAreTooLongAndStillEncodes) {
  update::VersionTable table;
  const auto number = table.add(std::string(64, 'a'), 1, std::string(300, 'o'), UtcTime());
  ASSERT_TRUE(table.use(number, seconds(1), ""));
  ASSERT_TRUE(table.fail(number, std::string(300, 'r')));
  const auto line = to_mission(std::string(100, 'n'), table, table.find(number));
  const auto decoded = mission::NodeVersionHousekeeping::decode(line.encoded());
  ASSERT_TRUE(decoded);
  EXPECT_EQ(decoded->origin, std::string(40, 'o'));
  EXPECT_EQ(decoded->reason, std::string(40, 'r'));
  EXPECT_EQ(decoded->state, mission::VersionState::failed);
}

}  // namespace
}  // namespace srfs
