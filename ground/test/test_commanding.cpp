// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mission/structures.hpp>

#include "ground/commanding.hpp"
#include "ground/telemetry.hpp"
#include "tests/mission_dictionary.hpp"

namespace srfs::ground {
namespace {

using testing_support::dictionary;

constexpr wire::RequestId request{0x1811, 0xc003};
constexpr MonotonicTime start{seconds(100)};

wire::TmPacket report(std::uint8_t subtype, const std::string& more = "",
                      const std::string& id = "1811c003") {
  return {.apid = 17, .service = 1, .subtype = subtype, .source = *from_hex(id + more)};
}

class CommandingTest : public ::testing::Test {
 protected:
  CommandingTest() {
    static_cast<void>(
        commanding.sent(request, *dictionary().command("eps.switch_load"), seconds(10), 7, start));
  }
  Commanding commanding{dictionary()};
};

TEST_F(CommandingTest, FollowsATelecommandToItsCompletion) {
  EXPECT_EQ(to_text(*commanding.on_packet(report(1), start + milliseconds(20))), "accepted");
  EXPECT_EQ(to_text(*commanding.on_packet(report(3), start + milliseconds(200))), "started");
  const auto progress = commanding.on_packet(report(5, "02"), start + milliseconds(300));
  EXPECT_EQ(to_text(*progress), "progress");
  EXPECT_EQ(progress->step, 2);
  const auto completed = commanding.on_packet(report(7), start + milliseconds(400));
  EXPECT_EQ(to_text(*completed), "completed");
  EXPECT_EQ(completed->elapsed, milliseconds(400));
  EXPECT_EQ(completed->tag, 7U);
  EXPECT_EQ(commanding.outstanding(), 0U);
}

TEST_F(CommandingTest, NamesTheArgumentThatTheSpacecraftRefused) {
  const auto rejected = commanding.on_packet(report(2,
                                                    "0006"
                                                    "01"),
                                             start);
  EXPECT_EQ(to_text(*rejected), "rejected");
  EXPECT_EQ(rejected->failure_name, "bad_argument");
  EXPECT_EQ(rejected->failure_text, "an argument is out of its range: argument 1 'load'");
  EXPECT_EQ(commanding.outstanding(), 0U);
}

TEST_F(CommandingTest, ATelecommandThatCannotBeRoutedIsRejected) {
  const auto rejected = commanding.on_packet(report(10, "0001"), start);
  ASSERT_TRUE(rejected);
  EXPECT_EQ(to_text(*rejected), "rejected");
  EXPECT_EQ(rejected->failure_name, "unknown_apid");
  EXPECT_EQ(commanding.outstanding(), 0U);
}

TEST_F(CommandingTest, ReadsAnyFailureReport) {
  EXPECT_EQ(commanding
                .on_packet(report(6,
                                  "01"
                                  "001e"),
                           start)
                ->failure_name,
            "peripheral_silent");
  EXPECT_EQ(commanding.on_packet(report(8, "ffff"), start)->failure_name, "unknown");
  EXPECT_EQ(commanding.outstanding(), 0U);
}

TEST_F(CommandingTest, SurvivesAReportThatIsCutShort) {
  EXPECT_EQ(commanding.on_packet(report(8), start)->failure_text, "the report carries no failure code");
}

TEST_F(CommandingTest, IgnoresReportsOfOthers) {
  EXPECT_FALSE(commanding.on_packet(report(1, "", "1811c004"), start));
  EXPECT_FALSE(commanding.on_packet(report(1, "", "1811"), start));
  EXPECT_FALSE(commanding.on_packet(report(9), start));
  wire::TmPacket housekeeping = report(1);
  housekeeping.service = 3;
  EXPECT_FALSE(commanding.on_packet(housekeeping, start));
  EXPECT_EQ(commanding.outstanding(), 1U);
}

TEST_F(CommandingTest, GivesUpAfterItsPatience) {
  EXPECT_TRUE(commanding.on_time(start + milliseconds(9999)).empty());
  EXPECT_EQ(commanding.next_deadline(), start + seconds(10));
  const auto late = commanding.on_time(start + seconds(10));
  ASSERT_EQ(late.size(), 1U);
  EXPECT_EQ(to_text(late[0]), "timed_out");
  EXPECT_EQ(late[0].failure_text, "no final report within 10000 ms");
  EXPECT_EQ(commanding.outstanding(), 0U);
  EXPECT_EQ(commanding.next_deadline(), std::nullopt);
  EXPECT_TRUE(commanding.on_time(start + seconds(11)).empty()) << "it is said once";
}

TEST_F(CommandingTest, TellsAnEndThatComesAfterItsPatience) {
  EXPECT_FALSE(commanding.on_packet(report(1), start)->late);
  ASSERT_EQ(commanding.on_time(start + seconds(10)).size(), 1U);
  EXPECT_TRUE(commanding.on_packet(report(3), start + seconds(30))->late);
  const auto completed = commanding.on_packet(report(7), start + seconds(50));
  ASSERT_TRUE(completed);
  EXPECT_TRUE(completed->late);
  EXPECT_TRUE(completed->is_completed());
  EXPECT_EQ(completed->tag, 7U);
  EXPECT_EQ(completed->elapsed, seconds(50));
  EXPECT_FALSE(commanding.on_packet(report(7), start + seconds(51))) << "it has ended";
}

TEST_F(CommandingTest, TakesNoReportForOneThatTimedOutLongAgo) {
  ASSERT_EQ(commanding.on_time(start + seconds(10)).size(), 1U);
  EXPECT_TRUE(commanding.on_packet(report(3), start + Commanding::late_longest));
  EXPECT_FALSE(commanding.on_packet(report(7), start + seconds(10) + Commanding::late_longest))
      << "it is of another station's telecommand";
}

TEST_F(CommandingTest, ForgetsOneThatTimedOutWhenItsIdIsUsedAgain) {
  ASSERT_EQ(commanding.on_time(start + seconds(10)).size(), 1U);
  static_cast<void>(commanding.sent(request, *dictionary().command("eps.switch_load"), seconds(10), 9,
                                    start + seconds(11)));
  EXPECT_EQ(commanding.on_packet(report(7), start + seconds(12))->tag, 9U);
  EXPECT_FALSE(commanding.on_packet(report(7), start + seconds(13)));

  static_cast<void>(commanding.sent(request, *dictionary().command("eps.switch_load"), seconds(1), 10,
                                    start + seconds(20)));
  commanding.forget_late(request);
  EXPECT_EQ(commanding.outstanding(), 1U) << "it is not late";
  ASSERT_EQ(commanding.on_time(start + seconds(21)).size(), 1U);
  commanding.forget_late(request);
  EXPECT_FALSE(commanding.on_packet(report(7), start + seconds(22))) << "it is of who sent it again";
}

TEST_F(CommandingTest, GivesUpOneThatTimedOutBeforeOneThatIsWaitedFor) {
  const auto& command = *dictionary().command("eps.switch_load");
  static_cast<void>(commanding.sent({0x1811, 1}, command, seconds(1), 8, start));
  ASSERT_EQ(commanding.on_time(start + seconds(1)).size(), 1U);
  for (std::uint16_t i = 2; i <= Commanding::max_outstanding; ++i)
    static_cast<void>(commanding.sent({0x1811, i}, command, seconds(100), i, start));
  EXPECT_EQ(commanding.outstanding(), Commanding::max_outstanding) << "the first one is among them";
  EXPECT_FALSE(commanding.on_packet(report(7, "", "18110001"), start + seconds(2)));
  EXPECT_TRUE(commanding.on_packet(report(7), start + seconds(2)));
}

TEST_F(CommandingTest, WaitsAnewWhenThereIsNews) {
  commanding.extend(7, start + seconds(8));
  commanding.extend(8, start + seconds(80));
  EXPECT_TRUE(commanding.on_time(start + milliseconds(17'999)).empty());
  EXPECT_EQ(commanding.on_time(start + seconds(18)).size(), 1U);
}

TEST_F(CommandingTest, FollowsAScheduledTelecommandWithoutHoldingAnybodyUp) {
  const wire::RequestId later{0x1811, 0xc009};
  commanding.follow_scheduled(later, *dictionary().command("eps.switch_load"), seconds(100), 8, start);
  EXPECT_EQ(commanding.outstanding(), 1U) << "the other one";
  EXPECT_EQ(commanding.on_inserted(request, true, start), std::nullopt) << "that was no time-tagged one";
  const auto scheduled = commanding.on_inserted(later, true, start);
  ASSERT_TRUE(scheduled);
  EXPECT_EQ(to_text(*scheduled), "scheduled");
  EXPECT_EQ(scheduled->tag, 8U);
  EXPECT_EQ(to_text(*commanding.on_packet(report(7, "", "1811c009"), start + seconds(50))), "completed");

  commanding.follow_scheduled(later, *dictionary().command("eps.switch_load"), seconds(100), 9, start);
  const auto refused = commanding.on_inserted(later, false, start);
  ASSERT_TRUE(refused);
  EXPECT_EQ(to_text(*refused), "not_sent");
  EXPECT_EQ(commanding.on_packet(report(7, "", "1811c009"), start), std::nullopt);
}

TEST_F(CommandingTest, SaysWhichActivityWasRefusedAndWhy) {
  EXPECT_EQ(commanding.on_packet(report(2, "003c02000601"), start)->failure_text,
            "the request of an activity would not be accepted: activity 2: an argument is out of its range: "
            "argument 1");
}

TEST_F(CommandingTest, KeepsABoundedNumber) {
  for (std::size_t i = 0; i < Commanding::max_outstanding + 5; ++i) {
    static_cast<void>(commanding.sent({0x1811, static_cast<std::uint16_t>(i)},
                                      *dictionary().command("ttc.ping"), seconds(1), i, start));
  }
  EXPECT_EQ(commanding.outstanding(), Commanding::max_outstanding);
}

ReceivedPacket playback_packet() {
  return {tm_channel::playback, {.apid = 17, .service = 3, .subtype = 25}};
}

ReceivedPacket done_event(std::uint32_t packets) {
  OctetWriter source;
  source.u16(mission::event::ttc_retrieval_done);
  mission::TtcRetrievalDoneEvent{mission::store::housekeeping, packets, 100}.encode(source);
  return {tm_channel::live,
          {.apid = mission::apid::ttc, .service = 5, .subtype = 1, .source = source.take()}};
}

StageReport stage_report(Stage stage, std::uint64_t tag = 1, Outcome outcome = Outcome::passed) {
  StageReport r;
  r.command = dictionary().command("storage.retrieve");
  r.tag = tag;
  r.outcome = outcome;
  r.stage = stage;
  return r;
}

TEST(Retrieval, IsCompleteWhenAllAnnouncedPacketsHaveCome) {
  Retrieval retrieval(1, mission::store::housekeeping);
  retrieval.on_packet(playback_packet(), start);  // belongs to an older retrieval
  retrieval.on_stage(stage_report(Stage::start), start);
  retrieval.on_packet(playback_packet(), start);
  EXPECT_TRUE(retrieval.on_packet(done_event(2), start));
  retrieval.on_stage(stage_report(Stage::completion), start);
  EXPECT_FALSE(retrieval.is_over(start));
  retrieval.on_packet(playback_packet(), start + milliseconds(100));
  EXPECT_TRUE(retrieval.is_over(start + milliseconds(100)));
  EXPECT_TRUE(retrieval.is_complete());
}

TEST(Retrieval, EndsIncompleteWhenPacketsAreLost) {
  Retrieval retrieval(1, mission::store::housekeeping);
  retrieval.on_stage(stage_report(Stage::start), start);
  retrieval.on_packet(done_event(2), start);
  retrieval.on_stage(stage_report(Stage::completion), start);
  EXPECT_FALSE(retrieval.is_over(start + milliseconds(1999)));
  EXPECT_TRUE(retrieval.is_over(start + milliseconds(2000)));
  EXPECT_FALSE(retrieval.is_complete());
}

TEST(Retrieval, LeavesThePacketsAndTheEventOfOtherRetrievalsAlone) {
  Retrieval first(1, mission::store::housekeeping);
  Retrieval second(2, mission::store::housekeeping);
  EXPECT_FALSE(second.on_packet(done_event(9), start)) << "it has not started";
  for (auto* retrieval : {&first, &second}) retrieval->on_stage(stage_report(Stage::start, 1), start);
  for (auto* retrieval : {&first, &second}) retrieval->on_packet(playback_packet(), start);
  for (auto* retrieval : {&first, &second}) retrieval->on_stage(stage_report(Stage::completion, 1), start);
  for (auto* retrieval : {&first, &second}) retrieval->on_stage(stage_report(Stage::start, 2), start);
  for (auto* retrieval : {&first, &second}) retrieval->on_packet(playback_packet(), start);

  EXPECT_TRUE(first.on_packet(done_event(1), start));

  EXPECT_TRUE(first.is_complete());
  EXPECT_EQ(first.received(), 1U);
  EXPECT_EQ(second.received(), 1U);
  EXPECT_FALSE(second.expected());
}

TEST(Retrieval, EndsAtOnceWhenItIsRefused) {
  Retrieval retrieval(1, mission::store::housekeeping);
  retrieval.on_stage(stage_report(Stage::acceptance, 1, Outcome::failed), start);
  EXPECT_TRUE(retrieval.is_over(start));
  EXPECT_FALSE(retrieval.is_complete());
}

TEST(Telemetry, ShowsHousekeepingWithUnitsAndLimits) {
  mission::PayloadEpsHousekeeping housekeeping;
  housekeeping.cycle = 42;
  housekeeping.measurement.battery_voltage_v = 6.5F;
  housekeeping.measurement.state_of_charge = 0.1F;
  housekeeping.time_to_empty_s = std::numeric_limits<float>::quiet_NaN();
  OctetWriter source;
  source.u16(mission::structure::payload_eps);
  housekeeping.encode(source);
  const auto report = decode_telemetry(dictionary(), {0,
                                                      {.apid = 17,
                                                       .time_reference = 1,
                                                       .service = 3,
                                                       .subtype = 25,
                                                       .time = to_tai(*from_iso8601("2026-11-21T08:00:00Z")),
                                                       .source = source.take()}});

  const auto json = to_json(report);
  EXPECT_EQ(json["type"], "tm_packet");
  EXPECT_EQ(json["structure"], "payload_eps");
  EXPECT_EQ(json["source"], "payload_eps");
  EXPECT_EQ(json["time"], "2026-11-21T08:00:00.000Z");
  EXPECT_EQ(json["fields"]["cycle"], 42);
  EXPECT_FLOAT_EQ(json["fields"]["battery_voltage_v"], 6.5F);
  EXPECT_TRUE(json["fields"]["time_to_empty_s"].is_null());
  EXPECT_EQ(json["limits"]["state_of_charge"], "red");
  EXPECT_EQ(json["limits"]["battery_voltage_v"], "yellow");
  EXPECT_EQ(json["units"]["battery_voltage_v"], "V");
  EXPECT_THAT(to_lines(report, false), testing::HasSubstr("battery_voltage_v                6.5 V (yellow)"));
  EXPECT_THAT(to_lines(report, true), testing::HasSubstr("\033[33;1m6.5 V"));
}

TEST(Telemetry, ShowsEventsAndBeacon) {
  OctetWriter event;
  event.u16(mission::event::ttc_mode_changed);
  mission::TtcModeChangedEvent{mission::MissionMode::safe, "bad \xff octet"}.encode(event);
  const auto json = to_json(
      decode_telemetry(dictionary(), {0, {.apid = 1, .service = 5, .subtype = 1, .source = event.take()}}));
  EXPECT_EQ(json["type"], "event");
  EXPECT_EQ(json["severity"], "info");
  EXPECT_EQ(json["fields"]["mode"], "safe");
  EXPECT_THAT(json["text"].get<std::string>(), testing::StartsWith("mode safe: bad "));

  OctetWriter beacon;
  beacon.u16(mission::structure::beacon);
  mission::Beacon{}.encode(beacon);
  EXPECT_EQ(
      to_json(decode_telemetry(
          dictionary(), {0, {.apid = 1, .service = 3, .subtype = 25, .source = beacon.take()}}))["type"],
      "beacon");
}

TEST(Telemetry, ShowsWhatItCannotDecodeAsOctets) {
  for (const char* source : {"", "00", "ffff", "0011", "001101020304"}) {
    const auto report = decode_telemetry(
        dictionary(), {0, {.apid = 99, .service = 3, .subtype = 25, .source = *from_hex(source)}});
    EXPECT_EQ(report.kind, TelemetryKind::other);
    EXPECT_EQ(to_hex(report.undecoded), source);
    EXPECT_EQ(to_json(report)["source"], "apid 99");
  }
}

}  // namespace
}  // namespace srfs::ground
