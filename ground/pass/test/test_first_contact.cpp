// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "ground/pass/first_contact.hpp"

namespace srfs::ground::pass {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;
using How = OrderEnd::How;
using Level = Finding::Level;

const UtcTime utc = *from_iso8601("2026-11-27T08:00:00Z");
const MonotonicTime start{seconds(1000)};

using Fields = std::map<std::string, std::string>;

/// The newest packets of a spacecraft, field by field.
class Spacecraft {
 public:
  Spacecraft& says(const std::string& structure, const Fields& fields, nanoseconds ahead = {}) {
    auto& known = said_[structure];
    for (const auto& [name, text] : fields) known[name] = text;
    TelemetryReport report;
    report.kind = TelemetryKind::housekeeping;
    report.name = structure;
    report.time = to_tai(utc + ahead);
    for (const auto& [name, text] : known) {
      mission::DecodedField field;
      field.name = name;
      field.text = text;
      report.fields.push_back(field);
    }
    latest.take(report, utc);
    return *this;
  }
  LatestValues latest;

 private:
  std::map<std::string, Fields> said_;
};

/// As it is some hours after all went well.
Spacecraft healthy() {
  Spacecraft spacecraft;
  spacecraft.says("beacon", {{"boot_count", "1"},
                             {"reset_cause", "power_on"},
                             {"mode", "nominal"},
                             {"time_valid", "true"},
                             {"sdls_spi.bd", "1"},
                             {"sdls_counter.bd", "42"},
                             {"farm_lockout", "false"},
                             {"command_loss_s", "259200"}});
  spacecraft.says("health", {{"mode", "nominal"}, {"reason", "commanded"}, {"present", ""}, {"next", ""}});
  spacecraft.says("boot_step", {{"step", "normal"}, {"in_rescue", "false"}});
  spacecraft.says("timing", {{"unhealthy_boots", "0"}});
  spacecraft.says("ttc", {{"sdls_keys_unusable", "0"}});
  spacecraft.says("payload_adcs", {{"rate_deg_s", "0.3"}});
  return spacecraft;
}

std::vector<std::string> lines(const std::vector<Finding>& findings) {
  std::vector<std::string> lines;
  for (const Finding& finding : findings)
    lines.push_back(std::string(to_text(finding.level)) + " " + finding.what);
  return lines;
}

std::vector<std::string> assessed(const Spacecraft& spacecraft) {
  return lines(assess_spacecraft(spacecraft.latest, utc));
}

TEST(Assessment, OfAHealthySpacecraftIsFine) {
  EXPECT_THAT(assessed(healthy()), Not(Contains(Not(::testing::StartsWith("fine")))));
}

TEST(Assessment, TellsOfEachBootState) {
  EXPECT_THAT(assessed(healthy().says("beacon", {{"boot_count", "7"}, {"reset_cause", "watchdog"}})),
              Contains("look boot 7, reset cause watchdog"));
  EXPECT_THAT(assessed(healthy().says("timing", {{"unhealthy_boots", "3"}})),
              Contains("act 3 boots in a row did not become healthy"));
  EXPECT_THAT(assessed(healthy().says("boot_step", {{"step", "last_good"}, {"cause", "unhealthy_starts"}})),
              Contains("look started with step last_good (unhealthy_starts)"));
  EXPECT_THAT(assessed(healthy().says("boot_step",
                                      {{"in_rescue", "true"}, {"unhealthy_starts", "4"}, {"detail", "ttc"}})),
              Contains(HasSubstr("act srfs_rescue answers")));
}

TEST(Assessment, TellsOfAnUnknownClock) {
  EXPECT_THAT(assessed(healthy().says("beacon", {{"time_valid", "false"}})),
              Contains(HasSubstr("act its clock was never set")));
  EXPECT_THAT(assessed(healthy().says("beacon", {}, seconds(-90))),
              Contains("look its clock is 90.0 s behind that of the ground"));
}

TEST(Assessment, TellsOfModeTumblingLockoutAndKeys) {
  const auto safe =
      healthy()
          .says("health",
                {{"mode", "safe"}, {"reason", "first start"}, {"present", "battery low"}, {"next", "none"}})
          .says("payload_adcs", {{"rate_deg_s", "12.5"}})
          .says("beacon", {{"farm_lockout", "true"}})
          .says("ttc", {{"sdls_keys_unusable", "1"}});
  const auto said = assessed(safe);
  EXPECT_THAT(said, Contains("look mode safe: first start; present now: battery low; next by itself: none"));
  EXPECT_THAT(said, Contains("act it turns by 12.5 deg/s (payload_adcs)"));
  EXPECT_THAT(said, Contains(HasSubstr("look FARM-1 is locked out")));
  EXPECT_THAT(said, Contains(HasSubstr("act 1 associations have no usable key")));
}

TEST(Assessment, OfNothingSaysNothing) {
  EXPECT_TRUE(assess_spacecraft(LatestValues{}, utc).empty());
}

TEST(LinkAssessment, SaysWhereTheWayEnds) {
  const auto only = [](const LinkFacts& facts) { return lines(assess_link(facts)).at(0); };
  EXPECT_THAT(only({.counters = {}}), HasSubstr("nothing came from the line"));
  EXPECT_THAT(only({.counters = {.octets = 5000}}), HasSubstr("no frame among them"));
  EXPECT_THAT(only({.counters = {.octets = 5000, .forged_frames = 3, .replayed_frames = 2, .old_frames = 1}}),
              HasSubstr("none is taken: 3 not authentic, 2 with used numbers, 1 too old"));
  EXPECT_THAT(only({.counters = {.octets = 5000, .frames = 10}}),
              HasSubstr("neither a beacon nor an answer"));
  EXPECT_THAT(only({.counters = {.octets = 5000, .frames = 10}, .beacon = true}),
              HasSubstr("no telecommand came through"));
  EXPECT_TRUE(
      assess_link({.counters = {.octets = 5000, .frames = 10}, .beacon = true, .answered = true}).empty());
  EXPECT_THAT(
      only({.counters = {.octets = 5000, .frames = 10, .bad_frames = 5}, .beacon = true, .answered = true}),
      HasSubstr("5 of 15 frames are bad"));
}

const std::vector<TelecommandText> questions{{"housekeeping.one_shot", {"structure=beacon"}},
                                             {"housekeeping.one_shot", {"structure=health"}}};

TEST(FirstContact, CallsUntilThereIsAnAnswerThenAsks) {
  FirstContact contact(questions, false, start + seconds(100));
  const LatestValues nothing;
  const auto call = contact.next(start, utc, nothing);
  ASSERT_TRUE(call);
  EXPECT_EQ(call->telecommand.name, "ttc.ping");
  EXPECT_FALSE(contact.next(start, utc, nothing));
  contact.on_end(call->tag, {.how = How::lost}, start);
  EXPECT_FALSE(contact.next(start + seconds(1), utc, nothing));
  const auto again = contact.next(start + FirstContact::call_period, utc, nothing);
  ASSERT_TRUE(again);
  contact.on_end(again->tag, {}, start + seconds(6));
  EXPECT_TRUE(contact.answered());
  for (const auto& question : questions) {
    const auto asked = contact.next(start + seconds(7), utc, nothing);
    ASSERT_TRUE(asked);
    EXPECT_EQ(asked->telecommand.arguments, question.arguments);
    contact.on_end(asked->tag, {}, start + seconds(7));
  }
  EXPECT_FALSE(contact.next(start + seconds(8), utc, nothing));
  EXPECT_TRUE(contact.is_over(start + seconds(8)));
}

TEST(FirstContact, LeavesAQuestionThatIsNeverAnswered) {
  FirstContact contact(questions, false, start + seconds(100));
  MonotonicTime now = start;
  std::size_t sent = 0;
  while (!contact.is_over(now) && sent < 50) {
    if (const auto action = contact.next(now, utc, {})) {
      ++sent;
      contact.on_end(action->tag,
                     {.how = action->telecommand.name == "ttc.ping" ? How::as_wanted : How::lost}, now);
    }
    now += seconds(1);
  }
  EXPECT_EQ(sent, 11U);
  EXPECT_TRUE(contact.answered());
}

/// A node that has just started has sampled nothing yet.
TEST(FirstContact, AsksAgainForWhatIsRefused) {
  FirstContact contact(questions, false, start + seconds(100));
  MonotonicTime now = start;
  std::map<std::string, int> asked;
  while (!contact.is_over(now)) {
    EXPECT_GT(contact.next_deadline(now), now) << "nobody waits for what has passed";
    if (const auto action = contact.next(now, utc, {})) {
      const bool call = action->telecommand.name == "ttc.ping";
      const int times = call ? 3 : ++asked[action->telecommand.arguments.front()];
      contact.on_end(action->tag, {.how = times < 3 ? How::otherwise : How::as_wanted}, now);
    }
    now += seconds(1);
  }
  EXPECT_EQ(asked, (std::map<std::string, int>{{"structure=beacon", 3}, {"structure=health", 3}}));
  EXPECT_LT(now, start + seconds(100));
}

TEST(FirstContact, EndsAtItsDeadlineWithoutAnAnswer) {
  FirstContact contact(questions, true, start + seconds(100));
  MonotonicTime now = start;
  while (!contact.is_over(now)) {
    if (const auto action = contact.next(now, utc, {})) {
      EXPECT_EQ(action->telecommand.name, "ttc.ping");
      contact.on_end(action->tag, {.how = How::lost}, now);
    }
    now += seconds(1);
  }
  EXPECT_FALSE(contact.answered());
  EXPECT_EQ(now, start + seconds(100));
}

/// How often the clock was set. @param end  of timing.set_time
std::size_t times_set(bool wanted, const std::string& valid, OrderEnd end, std::vector<Finding>& findings) {
  FirstContact contact(questions, wanted, start + seconds(100));
  Spacecraft spacecraft = healthy();
  spacecraft.says("beacon", {{"time_valid", valid}});
  std::size_t set = 0;
  for (MonotonicTime now = start; !contact.is_over(now); now += seconds(1)) {
    const auto action = contact.next(now, utc, spacecraft.latest);
    if (!action) continue;
    const bool sets = action->telecommand.name == "timing.set_time";
    if (sets) ++set;
    contact.on_end(action->tag, sets ? end : OrderEnd{}, now);
  }
  findings = contact.findings();
  return set;
}

TEST(FirstContact, SetsTheClockOnceIfThatIsWantedAndItWasNeverSet) {
  std::vector<Finding> findings;
  EXPECT_EQ(times_set(true, "false", {}, findings), 1U);
  EXPECT_THAT(lines(findings), Contains("fine its clock was set to that of the ground"));
  EXPECT_EQ(times_set(true, "false", {.how = How::lost, .why = "no report"}, findings), 1U);
  EXPECT_THAT(lines(findings), Contains("act its clock could not be set: no report"));
  EXPECT_EQ(times_set(true, "true", {}, findings), 0U);
  EXPECT_EQ(times_set(false, "false", {}, findings), 0U);
  EXPECT_EQ(times_set(true, "", {}, findings), 0U) << "it is not known whether it is set";
}

TEST(FirstContact, AsksSrfsRescueNothing) {
  FirstContact contact(questions, true, start + seconds(100));
  Spacecraft spacecraft;
  spacecraft.says("boot_step", {{"in_rescue", "true"}});
  const auto call = contact.next(start, utc, spacecraft.latest);
  contact.on_end(call->tag, {}, start);
  EXPECT_FALSE(contact.next(start, utc, spacecraft.latest));
  EXPECT_TRUE(contact.is_over(start));
}

TEST(FirstContact, IsReportedWithWhatIsToBeDoneFirst) {
  const std::vector<Finding> findings{{Level::fine, "boot 1"}, {Level::act, "a|b", "do it"}};
  const std::string text = contact_to_markdown(findings, utc);
  EXPECT_LT(text.find("a\\|b"), text.find("boot 1"));
  EXPECT_THAT(text, HasSubstr("| act | a\\|b | do it |"));
  EXPECT_EQ(contact_to_json(findings, true, utc)["findings"][1]["level"], "act");
}

}  // namespace
}  // namespace srfs::ground::pass
