// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ground/telemetry.hpp"
#include "ground/time_tag.hpp"
#include "tests/mission_dictionary.hpp"

namespace srfs::ground {
namespace {

using testing_support::dictionary;

// From the interface control document: eps.switch_load 2 on, count 3, APID 17.
const std::string activity =
    "00"
    "1f8193ae25000000"
    "1811c003000a2f08010000000102013cd4";

TelemetryReport report_of(std::uint8_t subtype, const std::string& source) {
  return decode_telemetry(dictionary(),
                          {0, {.apid = 1, .service = 11, .subtype = subtype, .source = *from_hex(source)}});
}

TEST(TimeTags, SayHowLongFromNowInTheUnitsThatPeopleWrite) {
  for (const auto& [text, after] : {std::pair("+5", seconds(5)),
                                    {"+30s", seconds(30)},
                                    {"+2000ms", seconds(2)},
                                    {"+10m", seconds(600)},
                                    {"+10min", seconds(600)},
                                    {"+1.5h", seconds(5400)}}) {
    const auto tag = parse_time_tag(text);
    ASSERT_TRUE(tag) << text;
    EXPECT_FALSE(tag->absolute) << text;
    EXPECT_EQ(tag->after, after) << text;
  }
  EXPECT_TRUE(parse_time_tag("2026-11-22T10:00:00Z")->absolute);
  for (const char* text : {"", "+", "10m", "+m", "+-5s", "+10x", "+200h", "tomorrow"})
    EXPECT_FALSE(parse_time_tag(text)) << text;
}

TEST(ScheduleReports, NameTheCommandOfAnActivity) {
  const auto report = report_of(10, "0001" + activity);
  ASSERT_EQ(report.kind, TelemetryKind::schedule);
  const auto json = to_json(report);
  EXPECT_EQ(json["type"], "schedule");
  EXPECT_EQ(json["report"], "detail");
  ASSERT_EQ(json["activities"].size(), 1U);
  EXPECT_EQ(json["activities"][0]["apid"], 17);
  EXPECT_EQ(json["activities"][0]["sequence"], 3);
  EXPECT_EQ(json["activities"][0]["command"], "eps.switch_load load=2 state=on");
  EXPECT_THAT(to_lines(report, false), testing::HasSubstr("eps.switch_load load=2 state=on"));
}

TEST(ScheduleReports, ShowSummariesAndGroups) {
  const auto summary = to_json(report_of(13,
                                         "0002"
                                         "03"
                                         "1f8193ae25000000"
                                         "000000110003"
                                         "00"
                                         "1f8193ae26000000"
                                         "000500120004"));
  EXPECT_EQ(summary["report"], "summary");
  EXPECT_EQ(summary["activities"][0]["group"], 3);
  EXPECT_EQ(summary["activities"][1]["source"], 5);
  const auto groups = report_of(27,
                                "0002"
                                "0101"
                                "0900");
  EXPECT_EQ(to_json(groups)["groups"][1]["group"], 9);
  EXPECT_EQ(to_json(groups)["groups"][1]["enabled"], false);
  EXPECT_THAT(to_lines(groups, false), testing::HasSubstr("group 9   disabled"));
}

TEST(ScheduleReports, ThatAreNotWholeAreShownAsOctets) {
  for (const auto& [subtype, source] :
       std::vector<std::pair<int, std::string>>{{10, "0001" + activity.substr(0, 40)},
                                                {10, "0001" + activity + "00"},
                                                {10, "0001" + activity.substr(0, activity.size() - 1) + "5"},
                                                {13, "0001"},
                                                {13,
                                                 "0001"
                                                 "00"
                                                 "2f8193ae25000000"
                                                 "000000110003"},
                                                {27,
                                                 "0001"
                                                 "01"},
                                                {27, ""},
                                                {99, "0000"}}) {
    const auto report = report_of(static_cast<std::uint8_t>(subtype), source);
    EXPECT_EQ(report.kind, TelemetryKind::other) << subtype << ' ' << source;
    EXPECT_EQ(to_hex(report.undecoded), source);
  }
}

}  // namespace
}  // namespace srfs::ground
