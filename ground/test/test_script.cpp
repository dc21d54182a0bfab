// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "ground/script.hpp"

namespace srfs::ground {
namespace {

using Kind = ScriptStep::Kind;

Result<std::vector<ScriptStep>, ScriptError> parse(std::string_view text) {
  return parse_script(text, [](const auto& name, const auto&) -> std::optional<std::string> {
    return name == "unknown" ? std::optional<std::string>("no such telecommand") : std::nullopt;
  });
}

TEST(Script, ReadsEveryKindOfLine) {
  const auto steps = parse(
      "\n# comment\n  ping\ntc eps.switch_load load=1 state=on --timeout 3 # behind\nexpect failed "
      "peripheral_silent\r\n"
      "wait 5s\nwait 200ms\nwait 2min\nwait 0.5\nwait until 2026-11-21T08:00:00Z\nad on\nad "
      "off\nunlock\nsetvr 255");
  ASSERT_TRUE(steps) << steps.error().line << ": " << steps.error().message;
  ASSERT_EQ(steps->size(), 11U);
  EXPECT_EQ(steps->at(0).name, "ttc.ping");
  EXPECT_EQ(steps->at(0).line, 3U);
  EXPECT_EQ(steps->at(0).expectation, Expectation::completed);
  const ScriptStep& tc = steps->at(1);
  EXPECT_EQ(tc.arguments, (std::vector<std::string>{"load=1", "state=on"}));
  EXPECT_EQ(tc.timeout, milliseconds(3000));
  EXPECT_EQ(tc.expectation, Expectation::failed);
  EXPECT_EQ(tc.failure, "peripheral_silent");
  EXPECT_EQ(steps->at(2).duration, milliseconds(5000));
  EXPECT_EQ(steps->at(3).duration, milliseconds(200));
  EXPECT_EQ(steps->at(4).duration, milliseconds(120000));
  EXPECT_EQ(steps->at(5).duration, milliseconds(500));
  EXPECT_EQ(steps->at(6).until, from_iso8601("2026-11-21T08:00:00Z"));
  EXPECT_EQ(steps->at(7).kind, Kind::ad_on);
  EXPECT_EQ(steps->at(8).kind, Kind::ad_off);
  EXPECT_EQ(steps->at(9).kind, Kind::unlock);
  EXPECT_EQ(steps->at(10).vr, 255);
}

TEST(Script, QuotesKeepSpacesInOneWord) {
  const auto steps = parse("tc event_action.add event=a \"request=eps.switch_load load=2\"");
  ASSERT_TRUE(steps);
  EXPECT_EQ(steps->at(0).arguments, (std::vector<std::string>{"event=a", "request=eps.switch_load load=2"}));
}

TEST(Script, NamesTheLineItCannotRead) {
  for (const std::string_view wrong : {"nonsense",
                                       "tc",
                                       "tc unknown",
                                       "ping now",
                                       "tc a --timeout",
                                       "tc a --timeout 0",
                                       "tc a --timeout x",
                                       "wait",
                                       "wait 5d",
                                       "wait -1",
                                       "wait nan",
                                       "wait 1e30",
                                       "wait until",
                                       "wait until soon",
                                       "ad",
                                       "ad maybe",
                                       "unlock 1",
                                       "setvr",
                                       "setvr 256",
                                       "setvr -1",
                                       "expect",
                                       "expect done",
                                       "expect completed busy",
                                       "expect rejected a b"}) {
    const auto steps = parse("ping\n" + std::string(wrong) + "\nping\n");
    ASSERT_FALSE(steps) << wrong;
    EXPECT_EQ(steps.error().line, 2U) << wrong;
    EXPECT_FALSE(steps.error().message.empty());
  }
}

TEST(Script, AnExpectationBelongsToTheTelecommandBeforeIt) {
  EXPECT_TRUE(parse("ping\n\n# why\nexpect accepted\n"));
  EXPECT_FALSE(parse("expect accepted\n"));
  EXPECT_FALSE(parse("ping\nwait 1\nexpect accepted\n"));
  EXPECT_FALSE(parse("ping\nexpect accepted\nexpect completed\n"));
}

TEST(Script, IsBounded) {
  std::string lines;
  for (std::size_t i = 0; i <= script_lines_max; ++i) lines += "#\n";
  EXPECT_FALSE(parse(lines));
  EXPECT_FALSE(parse(std::string(script_octets_max + 1, ' ')));
}

TEST(Script, JudgesATelecommandByItsStages) {
  struct Case {
    Expectation expectation;
    Outcome outcome;
    Stage stage;
    std::optional<bool> judgement;
  };
  using E = Expectation;
  using O = Outcome;
  using S = Stage;
  for (const auto& [expectation, outcome, stage, judgement] : std::vector<Case>{
           {E::completed, O::passed, S::acceptance, std::nullopt},
           {E::completed, O::failed, S::progress, std::nullopt},
           {E::completed, O::passed, S::completion, true},
           {E::completed, O::failed, S::acceptance, false},
           {E::completed, O::timed_out, S::acceptance, false},
           {E::accepted, O::sent, S::acceptance, std::nullopt},
           {E::accepted, O::passed, S::acceptance, true},
           {E::accepted, O::passed, S::start, true},
           {E::accepted, O::failed, S::acceptance, false},
           {E::accepted, O::not_sent, S::acceptance, false},
           {E::rejected, O::failed, S::acceptance, true},
           {E::rejected, O::passed, S::acceptance, false},
           {E::rejected, O::timed_out, S::acceptance, false},
           {E::failed, O::passed, S::acceptance, std::nullopt},
           {E::failed, O::failed, S::start, true},
           {E::failed, O::failed, S::completion, true},
           {E::failed, O::passed, S::completion, false},
           {E::failed, O::failed, S::acceptance, false},
       }) {
    ScriptStep step;
    step.expectation = expectation;
    StageReport report;
    report.outcome = outcome;
    report.stage = stage;
    EXPECT_EQ(judge(step, report), judgement) << to_text(expectation) << ' ' << to_text(report);
  }
}

TEST(Script, ATimeTaggedTelecommandIsExpectedToBeScheduled) {
  const auto steps = parse(
      "tc a x=1 --at +30s\ntc b --at 2026-11-22T10:00:00Z --timeout 5\nexpect completed\nping --at "
      "+5min\nexpect "
      "scheduled\narm c y=2 --at +20s");
  ASSERT_TRUE(steps) << steps.error().message;
  const UtcTime now(seconds(1000));
  EXPECT_EQ(steps->at(0).at->at(now), now + seconds(30));
  EXPECT_EQ(steps->at(0).expectation, Expectation::scheduled);
  EXPECT_EQ(steps->at(0).arguments, std::vector<std::string>{"x=1"});
  EXPECT_EQ(steps->at(1).at->at(now), from_iso8601("2026-11-22T10:00:00Z"));
  EXPECT_EQ(steps->at(1).expectation, Expectation::completed);
  EXPECT_EQ(steps->at(2).at->at(now), now + seconds(300));
  EXPECT_TRUE(steps->at(3).arms);
  EXPECT_EQ(steps->at(3).at->at(now), now + seconds(20));
  EXPECT_EQ(steps->at(3).arguments, std::vector<std::string>{"y=2"});
  for (const char* wrong : {"tc a --at", "tc a --at soon", "tc a --at 30s", "tc a --at +x", "tc a --at -5s",
                            "tc a\nexpect scheduled"})
    EXPECT_FALSE(parse(wrong)) << wrong;
}

TEST(Script, OfAnInsertionOnlyAFailureCounts) {
  ScriptStep step;
  StageReport report;
  report.insertion = true;
  report.outcome = Outcome::passed;
  report.stage = Stage::completion;
  EXPECT_EQ(judge(step, report), std::nullopt) << "its telecommand is not completed";
  report.outcome = Outcome::failed;
  report.stage = Stage::acceptance;
  EXPECT_EQ(judge(step, report), false);
  step.expectation = Expectation::scheduled;
  report = {};
  report.outcome = Outcome::scheduled;
  EXPECT_EQ(judge(step, report), true);
}

TEST(Script, JudgesTheFailureCodeWhenOneIsNamed) {
  ScriptStep step;
  step.expectation = Expectation::rejected;
  step.failure = "busy";
  StageReport report;
  report.outcome = Outcome::failed;
  report.failure_name = "bad_argument";
  EXPECT_EQ(judge(step, report), false);
  report.failure_name = "busy";
  EXPECT_EQ(judge(step, report), true);
}

}  // namespace
}  // namespace srfs::ground
