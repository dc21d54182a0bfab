// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/config.hpp"
#include "ground/pass/pass_report.hpp"
#include "tests/mission_dictionary.hpp"
#include "tests/temporary_folder.hpp"
#include "wire/tm_sdls.hpp"

namespace srfs::ground::pass {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using testing_support::dictionary;

class PassPlanFile : public ::testing::Test {
 protected:
  PassPlanFile() {
    write("orbit.tle",
          "1 28057U 03049A   06177.78615833  .00000060  00000-0  35940-4 0  1836\n"
          "2 28057  98.4283 247.6961 0000884  88.1964 271.9322 14.35478080140550\n");
    write("evening.txt", "tc eps.switch_load load=2 state=on\nwait 1\n");
    write("targets.bin", std::string(1000, 'x'));
  }
  void write(const std::string& name, const std::string& content) const {
    std::ofstream(folder_.path() / name) << content;
  }
  [[nodiscard]] PassPlan load(const std::string& text) const {
    write("plan.yaml", text);
    return PassPlan::load(folder_.path() / "plan.yaml", dictionary());
  }
  [[nodiscard]] std::string refusal(const std::string& text) const {
    try {
      static_cast<void>(load(text));
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "";
  }
  testing_support::TemporaryFolder folder_;
};

const std::string head =
    "plan: evening\n"
    "station: { name: Zurich, latitude_deg: 47.4, longitude_deg: 8.5, height_m: 450 }\n";
const std::string orbit = "orbit: { tle: orbit.tle }\n";

TEST_F(PassPlanFile, SaysAllThatIsWanted) {
  const PassPlan plan = load(head + orbit +
                             "queries: [ttc.ping, housekeeping.one_shot structure=health]\n"
                             "script: evening.txt\n"
                             "gaps: true\n"
                             "up: [{ file: targets.bin, name: targets_2.bin }]\n"
                             "down:\n"
                             "  - { folder: images/, pattern: '*', priority: 9 }\n"
                             "  - { pattern: '*.txt', priority: 1 }\n");
  EXPECT_EQ(plan.name, "evening");
  EXPECT_EQ(plan.elements->catalogue, "28057");
  EXPECT_EQ(plan.queries.size(), 2U);
  EXPECT_EQ(plan.script.size(), 2U);
  EXPECT_TRUE(plan.gaps);
  EXPECT_EQ(plan.up.front().octets, 1000U);
  EXPECT_EQ(plan.up.front().name, "targets_2.bin");
  EXPECT_EQ(plan.down.front().pattern, "*.txt") << "the most urgent one is first";
  EXPECT_EQ(plan.down.back().folder, "images");
  EXPECT_EQ(items_of(plan).size(), 6U);
}

TEST_F(PassPlanFile, TakesTheStationFromAFileThatItExtends) {
  write("station.yaml", "station: { name: Zurich, latitude_deg: 47.4, longitude_deg: 8.5 }\n" + orbit);
  const PassPlan plan = load("extends: station\nplan: evening\nqueries: [ttc.ping]\n");
  EXPECT_EQ(plan.site.name, "Zurich");
  EXPECT_EQ(plan.site.lowest_elevation_deg, 10);
}

TEST_F(PassPlanFile, IsRefusedWithWhatIsWrong) {
  EXPECT_THAT(refusal(head), HasSubstr("tle"));
  EXPECT_THAT(refusal(head + "orbit: { tle: none.tle }\n"), HasSubstr("none.tle"));
  EXPECT_THAT(refusal(head + "orbit: { tle: evening.txt }\n"), HasSubstr("'orbit.tle'"));
  EXPECT_THAT(refusal(orbit + "plan: ../x\nstation: { name: a, latitude_deg: 1, longitude_deg: 1 }\n"),
              HasSubstr("plan"));
  EXPECT_THAT(refusal(head + orbit + "quieries: []\n"), HasSubstr("quieries"));
  EXPECT_THAT(refusal(head + orbit + "queries: [ttc.pong]\n"), HasSubstr("did you mean 'ttc.ping'"));
  EXPECT_THAT(refusal(head + orbit + "up: [{ file: gone.bin }]\n"), HasSubstr("gone.bin"));
  EXPECT_THAT(refusal(head + orbit + "up: [{ file: targets.bin, name: a/b }]\n"), HasSubstr("a/b"));
  EXPECT_THAT(refusal("plan: a\nstation: { name: a, latitude_deg: 91, longitude_deg: 1 }\n" + orbit),
              HasSubstr("latitude_deg"));
  write("bad.txt", "tc eps.switch_load load=2 state=on\nunlock\n");
  EXPECT_THAT(refusal(head + orbit + "script: bad.txt\n"), HasSubstr("line 2"));
  write("far.tle",
        "1 28129U 03058A   06175.57071136 -.00000104  00000-0  10000-3 0   459\n"
        "2 28129  54.7298 324.8098 0048506 266.2640  93.1663  2.00562768 18443\n");
  EXPECT_THAT(refusal(head + "orbit: { tle: far.tle }\n"), HasSubstr("225 minutes"));
}

TEST_F(PassPlanFile, AsksNothingThatMayNotBeAskedTwice) {
  EXPECT_THAT(refusal(head + orbit + "queries: [timing.set_time utc=2026-11-27T08:00:00Z]\n"),
              HasSubstr("belongs into the script"));
}

TEST_F(PassPlanFile, LeavesRoomForCodingAndLiveTelemetry) {
  PassPlan plan = load(head + orbit);
  suite::LinkSettings link;
  const LineRates fast = useful_rates(plan, link, dictionary());
  EXPECT_GT(fast.down_octets_s, 0.5 * link.baud / 10);
  EXPECT_LT(fast.down_octets_s, 0.83 * link.baud / 10);
  suite::LinkSettings sealed = link;
  sealed.tm_security = suite::TelemetrySecurity{.spi = 16, .key_file = "keys/tm_downlink.key"};
  const double share_of_seal =
      static_cast<double>(wire::tm_sdls_overhead_octets) / static_cast<double>(link.tm_frame_length);
  const double lost = fast.down_octets_s - useful_rates(plan, sealed, dictionary()).down_octets_s;
  EXPECT_GT(lost, 0.7 * share_of_seal * link.baud / 10) << "each frame has a number and a MAC";
  EXPECT_LT(lost, share_of_seal * link.baud / 10);
  plan.line.down_octets_s = 10;  // less than the live telemetry
  EXPECT_EQ(useful_rates(plan, link, dictionary()).down_octets_s, 0);
}

TEST_F(PassPlanFile, IsReportedWithPassesAndWhatIsLeft) {
  const PassPlan plan = load(head + orbit + "script: evening.txt\nup: [{ file: targets.bin }]\n");
  auto items = items_of(plan);
  items[0].state = ItemState::unknown;
  items[0].detail = "a|b\x1b";
  const UtcTime now = *from_iso8601("2006-06-27T00:00:00Z");
  const auto found = plan.passes(now, now + std::chrono::hours(24));
  ASSERT_TRUE(found);
  const LineRates rates{.down_octets_s = 1000, .up_octets_s = 1000};
  const PassJournal journal;
  const PassReport report{.plan = plan,
                          .items = items,
                          .journal = journal,
                          .coming = forecast(found->passes, items, rates, now),
                          .rates = rates,
                          .now = now};

  const std::string text = to_markdown(report);
  EXPECT_THAT(text, HasSubstr("# Plan evening: report of 2006-06-27 00:00:00 UTC"));
  EXPECT_THAT(text, HasSubstr("## Failed, or not known"));
  EXPECT_THAT(text, HasSubstr("a\\|b\\x1b"));
  EXPECT_THAT(text, HasSubstr("| up | targets.bin"));
  EXPECT_THAT(text, HasSubstr("## Coming passes over Zurich"));
  EXPECT_THAT(plan_to_markdown(report), Not(HasSubstr("## Left")));
  const auto json = to_json(report);
  EXPECT_EQ(json["passes"].size(), found->passes.size());
  EXPECT_EQ(json["passes"][0]["files"][0]["octets"], 1000);
  EXPECT_EQ(json["items"].size(), 3U);
}

}  // namespace
}  // namespace srfs::ground::pass
