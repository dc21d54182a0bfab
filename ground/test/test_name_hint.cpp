// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ground/latest_values.hpp"
#include "ground/name_hint.hpp"

namespace srfs::ground {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(NameHint, CountsTheChangesBetweenNames) {
  EXPECT_EQ(edit_distance("", "abc"), 3U);
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3U);
  EXPECT_EQ(edit_distance("eps.swicth_load", "eps.switch_load"), 1U) << "two letters swapped";
  EXPECT_EQ(edit_distance("same", "same"), 0U);
}

TEST(NameHint, NamesWhatIsNearAndNothingElse) {
  const std::vector<std::string> known{"eps.switch_load", "eps.power_cycle_peripheral", "ttc.ping"};
  EXPECT_EQ(did_you_mean("eps.swich_load", known), "; did you mean 'eps.switch_load'?");
  EXPECT_EQ(did_you_mean("ping", known), "; did you mean 'ttc.ping'?");
  EXPECT_EQ(did_you_mean("something_else_entirely", known), "");
  EXPECT_EQ(did_you_mean("eps.", known), "; did you mean 'eps.switch_load' or 'eps.power_cycle_peripheral'?");
}

TelemetryReport housekeeping(double value, mission::LimitState limit) {
  TelemetryReport report;
  report.kind = TelemetryKind::housekeeping;
  report.name = "eps_power";
  report.fields = {{.name = "battery_v", .value = value, .text = "7.1", .unit = "V", .limit = limit},
                   {.name = "loads", .value = std::uint64_t{3}, .text = "3\x1b[2J", .unit = ""}};
  return report;
}

TEST(LatestValues, KeepTheNewestLivePacketOfAStructure) {
  LatestValues values;
  const UtcTime now = *from_iso8601("2026-11-21T08:00:00Z");
  values.take(housekeeping(1, mission::LimitState::green), now);
  values.take(housekeeping(2, mission::LimitState::red), now + seconds(5));
  values.take(housekeeping(3, mission::LimitState::green), now + seconds(4));
  auto stored = housekeeping(4, mission::LimitState::green);
  stored.vc = tm_channel::playback;
  values.take(stored, now + seconds(9));

  const auto out = values.rows("", true);
  ASSERT_EQ(out.size(), 1U);
  EXPECT_EQ(out[0].parameter, "eps_power.battery_v");
  EXPECT_EQ(std::get<double>(out[0].field.value), 2);
  EXPECT_EQ(values.rows("eps_power", false).size(), 2U);
  EXPECT_EQ(values.rows("eps_power.lo", false).size(), 1U);
  EXPECT_EQ(values.rows("adcs", false).size(), 0U);
}

TEST(LatestValues, FitTheScreenAndSteerNoTerminal) {
  LatestValues values;
  const UtcTime now = *from_iso8601("2026-11-21T08:00:00Z");
  values.take(housekeeping(1, mission::LimitState::yellow), now);
  const std::string screen = to_screen(values.rows("", false), now + seconds(7), 10, false);
  EXPECT_THAT(screen, HasSubstr("7.1 V"));
  EXPECT_THAT(screen, HasSubstr("7 s  yellow"));
  EXPECT_THAT(screen, Not(HasSubstr("\x1b")));
  EXPECT_THAT(to_screen(values.rows("", false), now, 1, false), HasSubstr("... and 2 more"));
}

TEST(LatestValues, TellAnAgeInTheUnitThatFits) {
  EXPECT_EQ(age_text(seconds(119)), "119 s");
  EXPECT_EQ(age_text(seconds(600)), "10 min");
  EXPECT_EQ(age_text(seconds(3 * 3600)), "3 h");
  EXPECT_EQ(age_text(seconds(5 * 86400)), "5 d");
}

}  // namespace
}  // namespace srfs::ground
