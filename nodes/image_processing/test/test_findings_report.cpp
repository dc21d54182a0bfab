// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_processing/findings_report.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

using image::Json;

TaskFindings many() {
  TaskFindings findings;
  findings.task = 17;
  findings.method = "streak";
  for (int i = 0; i < 40; ++i) {
    findings.streaks.push_back({i % 8, {1.0 + i, 2, 30, 40, 100.0 - i, 5000, 2}});
    findings.frames.push_back({{"file", "frames/0000000017/0001.fits"}, {"stars", i}});
  }
  findings.tracklets.push_back({{{0, 1, 2, 9, {}}, {1, 2, 3, 9, {}}}, 1, 2, 1, 1, 20, 0.1});
  return findings;
}

TEST(FindingsReport, HoldsEverythingWhereThereIsRoom) {
  const auto text = findings_text(many(), 100'000);
  ASSERT_TRUE(text);
  const Json json = Json::parse(*text);
  EXPECT_EQ(json["task"], 17);
  EXPECT_EQ(json["streaks"].size(), 40U);
  EXPECT_EQ(json["tracklets"][0]["points"].size(), 2U);
  EXPECT_EQ(json["frames"].size(), 40U);
  EXPECT_TRUE(json["solution"].is_null());
  EXPECT_EQ(json["left_out"]["streaks"], 0);
}

TEST(FindingsReport, KeepsTheMostSignificantInEveryBudgetAndSaysHowManyAreLeftOut) {
  const TaskFindings findings = many();
  std::size_t streaks_before = 0;
  for (std::size_t budget = 100; budget < 20'000; budget += 97) {
    const auto text = findings_text(findings, budget);
    if (!text) {
      EXPECT_LT(budget, 500U);
      continue;
    }
    ASSERT_LE(text->size(), budget);
    const Json json = Json::parse(*text);
    const std::size_t streaks = json["streaks"].size();
    if (json["tracklets"].size() == 1) {  // a smaller report gives the tracklet's place to streaks
      EXPECT_GE(streaks, streaks_before);
      streaks_before = streaks;
    }
    for (std::size_t i = 0; i < streaks; ++i) EXPECT_EQ(json["streaks"][i]["snr"], 100.0 - double(i));
    EXPECT_EQ(json["left_out"]["streaks"], 40 - streaks);
    EXPECT_EQ(json["left_out"]["frames"], 40 - json["frames"].size());
    EXPECT_EQ(json["left_out"]["tracklets"], 1 - json["tracklets"].size());
  }
  EXPECT_EQ(streaks_before, 40U);
}

TEST(FindingsReport, IsJsonWhateverTheFilesAreCalled) {
  TaskFindings findings = many();
  findings.refused.push_back({{"file", "frames/\xff\xfe.fits"}, {"why", "\"quoted\"\n"}});
  const auto text = findings_text(findings, 100'000);
  ASSERT_TRUE(text);
  EXPECT_EQ(Json::parse(*text)["refused"].size(), 1U);
}

}  // namespace
}  // namespace srfs
