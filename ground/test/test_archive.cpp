// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <csignal>
#include <fstream>
#include <random>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>
#include <mission/structures.hpp>

#include "ground/archive/archive_report.hpp"
#include "ground/archive/database.hpp"
#include "ground/archive/recorder.hpp"
#include "ground/station_status.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::ground {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const mission::Dictionary& dictionary() {
  static const auto loaded = mission::Dictionary::load(std::string(SRFS_SOURCE_DIR) + "/mission");
  return loaded;
}

const UtcTime start = *from_iso8601("2026-11-21T08:00:00Z");

ReceivedPacket made(wire::TmPacket packet, std::uint8_t vc = tm_channel::live) {
  ReceivedPacket received{.vc = vc, .packet = packet, .raw = wire::make_tm_packet(packet)};
  return received;
}

/// Housekeeping of timing, with a number that the test chooses.
ReceivedPacket timing(std::uint16_t sequence, UtcTime time, std::uint32_t ticks,
                      std::uint8_t vc = tm_channel::live) {
  mission::TimingHousekeeping fields{};
  fields.pulses_seen = ticks;
  OctetWriter source;
  source.u16(mission::structure::timing);
  fields.encode(source);
  return made({.apid = 2,
               .sequence_count = sequence,
               .time_reference = 1,
               .service = 3,
               .subtype = 25,
               .time = to_tai(time),
               .source = source.take()},
              vc);
}

ReceivedPacket verification(wire::RequestId request, std::uint8_t subtype, std::uint16_t sequence,
                            OctetView more = {}) {
  OctetWriter source;
  source.u16(request.packet_identification);
  source.u16(request.packet_sequence_control);
  source.bytes(more);
  return made({.apid = 17,
               .sequence_count = sequence,
               .service = 1,
               .subtype = subtype,
               .time = to_tai(start),
               .source = source.take()});
}

class ArchiveFile : public ::testing::Test {
 protected:
  void open() {
    auto opened = open_archive(file(), ArchiveUse::write);
    ASSERT_TRUE(opened) << opened.error();
    recorder_ = std::make_unique<Recorder>(std::move(*opened), dictionary(),
                                           [this](const std::string& text) { log_.push_back(text); });
  }
  void SetUp() override { open(); }
  [[nodiscard]] std::filesystem::path file() const { return folder_.path() / "archive.sqlite"; }
  Archive& archive() { return recorder_->archive(); }
  /// By another program.
  void run(const std::string& sql) {
    auto other = Database::open(file(), Database::Use::write);
    ASSERT_TRUE(other);
    const auto done = other->run(sql);
    ASSERT_TRUE(done) << done.error().message;
  }
  void put(const ReceivedPacket& packet) { recorder_->on_packet(packet, start); }
  std::vector<StoredPacket> packets(const PacketFilter& filter = {}) {
    recorder_->commit();
    std::vector<StoredPacket> found;
    EXPECT_TRUE(archive().packets(filter, [&](const StoredPacket& stored) {
      found.push_back(stored);
      return true;
    }));
    return found;
  }
  void order(const std::string& token, wire::RequestId request) {
    const auto encoded = dictionary().encode("eps.switch_load", {"load=2", "state=on"});
    EXPECT_TRUE(recorder_->on_telecommand({.command = *encoded,
                                           .arguments = {"load=2", "state=on"},
                                           .who = "pid 1 of user 0, tc",
                                           .token = token},
                                          request, false, start));
  }

  testing_support::TemporaryFolder folder_;
  std::vector<std::string> log_;
  std::unique_ptr<Recorder> recorder_;
};

TEST_F(ArchiveFile, KeepsALiveAndARetrievedCopyOfAPacketAsOne) {
  put(timing(5, start, 1));
  put(timing(5, start, 1, tm_channel::playback));
  put(timing(6, start + seconds(1), 2, tm_channel::playback));

  const auto found = packets();

  ASSERT_EQ(found.size(), 2U);
  EXPECT_TRUE(found[0].live && found[0].retrieved);
  EXPECT_TRUE(!found[1].live && found[1].retrieved);
  EXPECT_EQ(found[0].packet.raw, timing(5, start, 1).raw) << "raw packets are the truth";
}

TEST_F(ArchiveFile, DecodesThePastByTheDictionaryOfToday) {
  put(timing(5, start, 77));
  const auto report = decode_telemetry(dictionary(), packets().front().packet);
  EXPECT_EQ(report.name, "timing");
  EXPECT_FALSE(report.fields.empty());
}

TEST_F(ArchiveFile, FollowsATelecommandByTheReportsThatNameIt) {
  const wire::RequestId request{0x1811, 0xC005};
  order("a", request);
  const auto verdict = [&] {
    recorder_->commit();
    const auto found = archive().telecommands({}, 10);
    EXPECT_TRUE(found);
    return verdict_of(found->back(), dictionary(), start + seconds(1)).text;
  };
  EXPECT_EQ(verdict(), "sent");
  put(verification(request, 1, 1));
  put(verification({0x1811, 0xC006}, 2, 2, *from_hex("0017")));  // of another telecommand
  EXPECT_EQ(verdict(), "accepted");
  put(verification(request, 3, 3));
  put(verification(request, 7, 4));
  EXPECT_EQ(verdict(), "completed");

  order("b", request);  // the counter came round: from now on it is this one's
  put(verification(request, 2, 5, *from_hex("0017")));
  EXPECT_EQ(verdict(), "rejected: " + dictionary().failure_code(0x17)->name);
  const auto both = archive().telecommands({}, 10);
  EXPECT_EQ(both->front().reports.size(), 3U);
  EXPECT_EQ(both->front().entry.who, "pid 1 of user 0, tc");
  EXPECT_THAT(both->front().entry.arguments, ElementsAre("load=2", "state=on"));
}

TEST_F(ArchiveFile, SaysThatNoReportCameOnlyWhenItsTimeIsOver) {
  order("a", {0x1811, 0xC005});
  const auto found = archive().telecommands({}, 10);
  EXPECT_FALSE(verdict_of(found->back(), dictionary(), start + seconds(1)).failed);
  EXPECT_EQ(verdict_of(found->back(), dictionary(), start + seconds(3600)).text, "no report");
}

TEST_F(ArchiveFile, KnowsATelecommandByItsToken) {
  order("a", {0x1811, 0xC005});
  EXPECT_EQ(*recorder_->request_of("a"), (wire::RequestId{0x1811, 0xC005}));
  EXPECT_EQ(*recorder_->request_of("b"), std::nullopt);

  recorder_->on_not_sent("a");
  EXPECT_EQ(*recorder_->request_of("a"), std::nullopt) << "an order with its token is a new one";
}

TEST_F(ArchiveFile, SaysThatItDoesNotKnowATelecommandWhenItFails) {
  run("CREATE TRIGGER fails BEFORE INSERT ON telecommands BEGIN SELECT RAISE(ABORT, 'no room'); END");
  const auto encoded = dictionary().encode("eps.switch_load", {"load=2", "state=on"});
  const auto recorded = recorder_->on_telecommand(
      {.command = *encoded, .arguments = {"load=2", "state=on"}, .who = "tc", .token = "a"}, {0x1811, 0xC005},
      false, start);
  ASSERT_FALSE(recorded);
  EXPECT_THAT(recorded.error(), HasSubstr("no room"));
  run("DROP TABLE telecommands");
  EXPECT_FALSE(recorder_->request_of("a"));
}

TEST_F(ArchiveFile, FindsGapsAndFillsThemWithWhatIsRetrieved) {
  for (const std::uint16_t sequence : std::vector<std::uint16_t>{1, 2, 6, 7})
    put(timing(sequence, start + seconds(sequence), sequence));
  recorder_->commit();
  auto gaps = archive().gaps({}, true);
  ASSERT_EQ(gaps->size(), 1U);
  EXPECT_EQ(gaps->front().gap.first, 3);
  EXPECT_EQ(gaps->front().missing, 3U);

  for (const std::uint16_t sequence : std::vector<std::uint16_t>{4, 3, 3, 5})
    put(timing(sequence, start + seconds(sequence), sequence, tm_channel::playback));
  recorder_->commit();
  gaps = archive().gaps({}, false);
  EXPECT_EQ(gaps->front().state, GapState::filled) << "a copy that comes twice fills once";
  EXPECT_THAT(*archive().gaps({}, true), IsEmpty());
}

TEST_F(ArchiveFile, TakesTheGapsOfThinnedTelemetryForOneUntilItIsFilled) {
  for (std::uint16_t sequence = 0; sequence < 60; sequence = static_cast<std::uint16_t>(sequence + 3))
    put(timing(sequence, start + seconds(sequence), sequence));
  recorder_->commit();
  auto gaps = archive().gaps({}, true);
  ASSERT_EQ(gaps->size(), 1U);
  EXPECT_EQ(gaps->front().missing, 38U);
  ASSERT_TRUE(archive().count_attempt(gaps->front().id));

  put(timing(70, start + seconds(70), 70));  // a retrieval is under way: this is another gap
  recorder_->commit();
  EXPECT_EQ(archive().gaps({}, true)->size(), 2U);
  for (std::uint16_t sequence = 0; sequence < 50; ++sequence)
    put(timing(sequence, start + seconds(sequence), sequence, tm_channel::playback));
  ASSERT_TRUE(archive().close_gap(gaps->front().id));
  recorder_->commit();
  gaps = archive().gaps({}, false);
  EXPECT_EQ(gaps->front().state, GapState::given_up);
  EXPECT_EQ(gaps->front().missing, 5U) << "50, 52, 53, 55, 56";
}

TEST_F(ArchiveFile, FindsTheGapOfTheTimeInWhichItDidNotRun) {
  put(timing(1, start, 1));
  recorder_->commit();
  recorder_.reset();
  open();
  put(timing(4, start + seconds(3), 4));
  recorder_->commit();
  EXPECT_EQ(archive().gaps({}, true)->size(), 1U);
}

TEST(GapFinder, TakesLatePacketsAndACounterThatBeginsAnewForWhatTheyAre) {
  GapFinder finder;
  EXPECT_FALSE(finder.on_packet(2, 0x3FFE, start));
  EXPECT_FALSE(finder.on_packet(2, 0x3FFF, start));
  EXPECT_FALSE(finder.on_packet(2, 0, start)) << "the counter comes round";
  EXPECT_EQ(finder.on_packet(2, 3, start)->count, 2);
  EXPECT_FALSE(finder.on_packet(2, 2, start)) << "late";
  EXPECT_FALSE(finder.on_packet(2, 4, start));
  EXPECT_FALSE(finder.on_packet(3, 900, start)) << "another application process";
  const auto anew = finder.on_packet(3, 0, start + seconds(9));
  ASSERT_TRUE(anew);
  EXPECT_EQ(anew->count, std::nullopt);
  EXPECT_EQ(anew->to, start + seconds(9));
}

TEST(GapFinder, TakesAPacketOfALowerCountForLateOnlyWhenItIsNotYounger) {
  GapFinder finder;
  EXPECT_FALSE(finder.on_packet(2, 40, start));
  const auto restarted = finder.on_packet(2, 0, start + seconds(9));
  ASSERT_TRUE(restarted) << "its process began anew, after a few packets";
  EXPECT_EQ(restarted->count, std::nullopt);
  EXPECT_EQ(finder.last(2)->sequence, 0);
  EXPECT_FALSE(finder.on_packet(2, 0x3FFF, start + seconds(8))) << "late";
  EXPECT_EQ(finder.last(2)->sequence, 0);
  EXPECT_FALSE(finder.last(3));
}

TEST_F(ArchiveFile, RemembersTheNewestSequenceCountNotThatOfALatePacket) {
  for (const std::uint16_t sequence : std::vector<std::uint16_t>{1, 2, 3, 1})
    put(timing(sequence, start + seconds(sequence), sequence));
  recorder_->commit();
  recorder_.reset();
  open();
  put(timing(4, start + seconds(4), 4));
  recorder_->commit();
  EXPECT_THAT(*archive().gaps({}, true), IsEmpty());
}

TEST_F(ArchiveFile, FindsAGapWhereACommitFailed) {
  put(timing(1, start + seconds(1), 1));
  recorder_->commit();
  run("CREATE TRIGGER fails BEFORE INSERT ON sequences BEGIN SELECT RAISE(ABORT, 'no room'); END");
  EXPECT_EQ(recorder_->on_packet(timing(2, start + seconds(2), 2), start), 2);
  EXPECT_EQ(recorder_->on_packet(timing(3, start + seconds(3), 3), start), 3);
  recorder_->commit();
  run("DROP TRIGGER fails");
  EXPECT_EQ(recorder_->on_packet(timing(4, start + seconds(4), 4), start), 4)
      << "the number of a lost packet is not given again";
  const auto found = packets();
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found.back().id, 4);
  const auto gaps = archive().gaps({}, true);
  ASSERT_EQ(gaps->size(), 1U);
  EXPECT_EQ(gaps->front().gap.first, 2);
  EXPECT_EQ(gaps->front().missing, 2U);
  const auto passes = archive().passes({});
  ASSERT_EQ(passes->size(), 1U);
  EXPECT_EQ(passes->front().packets, 2U);
}

TEST_F(ArchiveFile, HasThePassWhoseFirstCommitFailed) {
  run("CREATE TRIGGER fails BEFORE INSERT ON passes BEGIN SELECT RAISE(ABORT, 'no room'); END");
  put(timing(1, start, 1));
  recorder_->commit();
  run("DROP TRIGGER fails");
  put(timing(2, start + seconds(1), 2));
  recorder_->commit();
  EXPECT_EQ(archive().passes({})->size(), 1U);
}

TEST_F(ArchiveFile, GivesNoParameterTheNumberOfAnotherAfterAFailure) {
  run("CREATE TRIGGER fails BEFORE DELETE ON dirty BEGIN SELECT RAISE(ABORT, 'no room'); END");
  put(timing(1, start, 1));
  recorder_->commit();
  EXPECT_FALSE(recorder_->make_minute(start + seconds(3600)));
  run("DROP TRIGGER fails");
  Aggregate other;
  other.add(-5, mission::LimitState::none);
  ASSERT_TRUE(archive().set_minute({99, 7}, {{"other.value", other}}));  // takes a number that was given
  ASSERT_TRUE(archive().commit());
  EXPECT_FALSE(recorder_->make_minute(start + seconds(3601))) << "what failed is not tried at once";
  EXPECT_TRUE(recorder_->make_minute(start + seconds(3700)));
  const auto points = archive().minutes("other.value", {});
  ASSERT_EQ(points->size(), 1U);
  EXPECT_EQ(points->front().values.max, -5);
  EXPECT_EQ(archive().minutes("timing.pulses_seen", {})->size(), 1U);
}

TEST_F(ArchiveFile, KeepsWhoAcknowledgedAnEventFirst) {
  ReceivedPacket event = timing(7, start, 0);
  event.packet.service = 5;
  event.packet.subtype = 3;
  event.raw = wire::make_tm_packet(event.packet);
  const auto id = recorder_->on_packet(event, start);
  const auto other = recorder_->on_packet(timing(8, start, 1), start);
  recorder_->commit();
  ASSERT_GT(id, 0);
  EXPECT_FALSE(*archive().acknowledgement_of(id));

  EXPECT_TRUE(recorder_->acknowledge(id, {start + seconds(5), "Ada"}));

  EXPECT_FALSE(recorder_->acknowledge(id, {start + seconds(9), "Grace"}));
  EXPECT_FALSE(recorder_->acknowledge(other, {start, "Ada"})) << "no event";
  EXPECT_FALSE(recorder_->acknowledge(999, {start, "Ada"})) << "no packet";
  const auto kept = archive().acknowledgement_of(id);
  ASSERT_TRUE(kept && *kept);
  EXPECT_EQ((*kept)->who, "Ada");
  EXPECT_EQ((*kept)->time, start + seconds(5));
}

TEST_F(ArchiveFile, FindsTheTelecommandOfARequestThatCameAgain) {
  const wire::RequestId request{0x1811, 0xC003};
  for (const auto& [name, sent] :
       {std::pair("eps.switch_load", start), std::pair("ttc.ping", start + seconds(100))}) {
    ASSERT_TRUE(archive().add(TelecommandEntry{
        .token = name, .request = request, .sent = sent, .who = "test", .name = name, .arguments = {}}));
  }
  ASSERT_TRUE(archive().commit());
  EXPECT_EQ((*archive().telecommand_of(request, start + seconds(50)))->entry.name, "eps.switch_load");
  EXPECT_EQ((*archive().telecommand_of(request, start + seconds(500)))->entry.name, "ttc.ping");
  EXPECT_FALSE(*archive().telecommand_of(request, start));
  EXPECT_FALSE(*archive().telecommand_of({1, 2}, start + seconds(500)));
}

TEST_F(ArchiveFile, PagesBackwardsByTheTimeOfAPacketWithoutRepeatingOne) {
  std::vector<std::int64_t> ids;
  for (std::uint16_t i = 0; i < 7; ++i) put(timing(i, start + seconds(i / 2), i));
  recorder_->commit();
  PacketFilter filter;
  filter.newest_first = true;
  filter.most = 3;
  for (int page = 0; page < 4; ++page) {
    ASSERT_TRUE(archive().packets(filter, [&ids](const StoredPacket& stored) {
      ids.push_back(stored.id);
      return true;
    }));
    filter.before_id = ids.back();
  }
  EXPECT_THAT(ids, ElementsAre(7, 6, 5, 4, 3, 2, 1));
}

TEST_F(ArchiveFile, SaysOnceThatItFailsAndThatItWorksOnlyWhenItDoes) {
  run("CREATE TRIGGER fails BEFORE INSERT ON packets BEGIN SELECT RAISE(ABORT, 'no room'); END");
  for (std::uint16_t i = 0; i < 5; ++i) {
    EXPECT_EQ(recorder_->on_packet(timing(i, start + seconds(i), i), start), 0);
    recorder_->commit();
  }
  ASSERT_EQ(log_.size(), 1U);
  EXPECT_THAT(log_.front(), HasSubstr("no room"));
  EXPECT_THAT(recorder_->problem(), HasSubstr("no room"));
  run("DROP TRIGGER fails");
  put(timing(5, start + seconds(5), 5));
  recorder_->commit();
  EXPECT_EQ(recorder_->problem(), "");
  ASSERT_EQ(log_.size(), 2U);
  EXPECT_EQ(log_.back(), "the archive works again; 5 packets were not recorded");
}

TEST_F(ArchiveFile, CountsThePacketsOfACommitThatFailedAsNotRecorded) {
  run("CREATE TRIGGER fails BEFORE INSERT ON sequences BEGIN SELECT RAISE(ABORT, 'no room'); END");
  put(timing(1, start, 1));
  put(timing(2, start + seconds(1), 2));
  recorder_->commit();
  run("DROP TRIGGER fails");
  put(timing(3, start + seconds(2), 3));
  recorder_->commit();
  EXPECT_EQ(log_.back(), "the archive works again; 2 packets were not recorded");
}

TEST_F(ArchiveFile, GoesOnWhileAnotherProgramHasTheFileAndFindsTheGap) {
  put(timing(1, start, 1));
  recorder_->commit();
  {
    auto other = Database::open(file(), Database::Use::write);
    ASSERT_TRUE(other->run("BEGIN IMMEDIATE"));
    EXPECT_EQ(recorder_->on_packet(timing(2, start + seconds(1), 2), start), 0);
  }
  put(timing(3, start + seconds(2), 3));
  recorder_->commit();
  const auto gaps = archive().gaps({}, true);
  ASSERT_EQ(gaps->size(), 1U);
  EXPECT_EQ(gaps->front().gap.first, 2);
}

TEST_F(ArchiveFile, ShowsTheLiveValueThatCameLastWhateverTheClockOnBoardSays) {
  put(timing(1, start + std::chrono::hours(24 * 365), 111));  // once, a time of next year
  put(timing(2, start, 222));
  put(timing(3, start + seconds(60), 333, tm_channel::playback));
  recorder_->commit();
  const auto status = read_status(archive(), dictionary());
  ASSERT_TRUE(status) << status.error();
  const auto rows = status->latest.rows("timing.pulses_seen", false);
  ASSERT_EQ(rows.size(), 1U);
  EXPECT_EQ(rows.front().field.text, "222");
}

TEST_F(ArchiveFile, MakesMinutesThatAgreeWithTheRawValues) {
  for (std::uint16_t i = 0; i < 300; ++i) put(timing(i, start + seconds(i), i));
  recorder_->commit();
  const Period all{start, start + seconds(300)};
  const auto by_raw =
      history(archive(), dictionary(), "timing.pulses_seen", all, 100);  // no minute is made yet
  ASSERT_TRUE(by_raw) << by_raw.error();

  while (recorder_->make_minute(start + seconds(3600))) {
  }
  const auto by_minutes = history(archive(), dictionary(), "timing.pulses_seen", all, 100);

  ASSERT_EQ(by_minutes->size(), 5U);
  ASSERT_EQ(by_raw->size(), 5U);
  for (std::size_t i = 0; i < 5; ++i) {
    const Aggregate& minute = (*by_minutes)[i].values;
    EXPECT_EQ(minute.count, 60U);
    EXPECT_EQ(minute.min, static_cast<double>(60 * i));
    EXPECT_EQ(minute.max, static_cast<double>(60 * i + 59));
    EXPECT_DOUBLE_EQ(minute.mean, static_cast<double>(60 * i) + 29.5);
    EXPECT_EQ(minute.mean, (*by_raw)[i].values.mean);
  }
  EXPECT_EQ(history(archive(), dictionary(), "timing.pulses_seen", all, 300)->size(), 300U)
      << "each value as it came";
  EXPECT_LE(history(archive(), dictionary(), "timing.pulses_seen", all, 2)->size(), 2U);
  EXPECT_FALSE(history(archive(), dictionary(), "nothing.of_this", all, 2));
}

TEST_F(ArchiveFile, HistoryIsOfHousekeepingReportsAlone) {
  put(timing(0, start, 7));
  auto other = timing(1, start + seconds(1), 9);
  other.packet.subtype = 10;  // the structure of a report, with the same number in front
  other.raw = wire::make_tm_packet(other.packet);
  put(other);
  recorder_->commit();

  const auto points = history(archive(), dictionary(), "timing.pulses_seen", {start, start + seconds(60)}, 1);

  ASSERT_TRUE(points) << points.error();
  ASSERT_EQ(points->size(), 1U);
  EXPECT_EQ(points->front().time, start) << "as it came: there is one alone";
  EXPECT_EQ(points->front().values.max, 7);
}

TEST_F(ArchiveFile, MakesAMinuteAgainWhenAPacketOfItIsRetrieved) {
  put(timing(1, start, 10));
  recorder_->commit();
  while (recorder_->make_minute(start + seconds(3600))) {
  }
  put(timing(2, start + seconds(2), 30, tm_channel::playback));
  recorder_->commit();
  while (recorder_->make_minute(start + seconds(3600))) {
  }
  const auto minutes = archive().minutes("timing.pulses_seen", {});
  ASSERT_EQ(minutes->size(), 1U);
  EXPECT_EQ(minutes->front().values.max, 30);
  EXPECT_EQ(minutes->front().values.count, 2U);
}

TEST_F(ArchiveFile, HasEveryPacketThatWasShownBeforeItsProcessWasKilled) {
  recorder_.reset();
  std::mt19937 random(7);
  std::uint16_t shown = 0;
  for (int kill_number = 0; kill_number < 100; ++kill_number) {
    std::array<int, 2> pipe_ends{};
    ASSERT_EQ(pipe(pipe_ends.data()), 0);
    const pid_t child = fork();
    if (child == 0) {
      auto opened = open_archive(file(), ArchiveUse::write);
      if (!opened) _exit(1);
      for (std::uint16_t sequence = shown;; ++sequence) {
        for (int copy = 0; copy < 3; ++copy)
          static_cast<void>((*opened)->add(timing(sequence, start + seconds(sequence), sequence), start));
        if (!(*opened)->commit()) _exit(1);
        if (write(pipe_ends[1], &sequence, sizeof sequence) < 0) _exit(1);
      }
    }
    close(pipe_ends[1]);
    const auto until = static_cast<int>(random() % 20) + 1;
    for (int i = 0; i < until; ++i) {
      std::uint16_t sequence = 0;
      ASSERT_EQ(read(pipe_ends[0], &sequence, sizeof sequence), static_cast<ssize_t>(sizeof sequence));
      shown = static_cast<std::uint16_t>(sequence + 1);
    }
    kill(child, SIGKILL);  // it writes on meanwhile, so anywhere
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status)) << "kill " << kill_number;
    close(pipe_ends[0]);
  }
  open();
  const auto found = packets();
  ASSERT_GE(found.size(), shown);
  for (std::size_t i = 0; i < found.size(); ++i) ASSERT_EQ(found[i].packet.packet.sequence_count, i);
  EXPECT_THAT(*archive().check(), IsEmpty());
}

TEST_F(ArchiveFile, RefusesWhatIsNoArchiveAndWhatIsNewer) {
  recorder_.reset();
  {
    auto database = Database::open(file(), Database::Use::write);
    ASSERT_TRUE(database->run("PRAGMA user_version=99"));
  }
  EXPECT_THAT(open_archive(file(), ArchiveUse::write).error(), HasSubstr("newer srfs-ground"));
  const auto other = folder_.path() / "other.sqlite";
  {
    auto database = Database::open(other, Database::Use::write);
    ASSERT_TRUE(database->run("CREATE TABLE songs(name TEXT); PRAGMA user_version=1"));
  }
  EXPECT_THAT(open_archive(other, ArchiveUse::write).error(), HasSubstr("not an archive"));
  std::ofstream(folder_.path() / "text.sqlite") << std::string(5000, 'x');
  EXPECT_FALSE(open_archive(folder_.path() / "text.sqlite", ArchiveUse::write));
  EXPECT_THAT(open_archive(folder_.path() / "none.sqlite", ArchiveUse::read).error(),
              HasSubstr("there is no archive"));
}

TEST_F(ArchiveFile, FindsDamageAndKeepsWhatCanBeRead) {
  constexpr std::uint16_t count = 2000;
  for (std::uint16_t i = 0; i < count; ++i) put(timing(i, start + seconds(i), i));
  recorder_->commit();
  recorder_.reset();
  {
    auto database = Database::open(file(), Database::Use::write);
    ASSERT_TRUE(database->run("PRAGMA wal_checkpoint(TRUNCATE)"));
  }
  // A page in the middle rots.
  const auto size = std::filesystem::file_size(file());
  {
    std::fstream octets(file(), std::ios::in | std::ios::out | std::ios::binary);
    octets.seekp(static_cast<std::streamoff>(size / 3 / 4096 * 4096));
    octets << std::string(4096, '\xA5');
  }
  {
    const auto damaged = open_archive(file(), ArchiveUse::read);
    const bool found = !damaged || !(*damaged)->check() || !(*damaged)->check()->empty();
    EXPECT_TRUE(found);
  }
  const auto repaired = repair_archive(file());
  ASSERT_TRUE(repaired) << repaired.error();
  open();
  EXPECT_THAT(*archive().check(), IsEmpty());
  EXPECT_GE(packets().size(), count * 9U / 10);
  EXPECT_TRUE(std::filesystem::exists(repaired->damaged));
}

TEST_F(ArchiveFile, ForgetsWhatIsOlder) {
  for (std::uint16_t i = 0; i < 10; ++i) put(timing(i, start + seconds(i), i));
  recorder_->commit();
  EXPECT_EQ(archive().prune("packets", start + seconds(4)), 4U);
  EXPECT_EQ(packets().size(), 6U);
  EXPECT_FALSE(archive().prune("sqlite_master", start));
}

TEST_F(ArchiveFile, NeverGivesTheNumberOfAPacketThatIsForgottenAgain) {
  for (std::uint16_t i = 0; i < 10; ++i) put(timing(i, start + seconds(i), i));
  recorder_->commit();
  EXPECT_EQ(archive().prune("packets", start + seconds(3600)), 9U);
  recorder_.reset();
  open();
  EXPECT_EQ(recorder_->on_packet(timing(10, start + seconds(10), 10), start), 11);
}

TEST_F(ArchiveFile, KeepsTheMinutesWhosePacketsAreForgotten) {
  const auto values = [&] {
    recorder_->commit();
    while (recorder_->make_minute(start + seconds(3600))) {
    }
    std::vector<std::int64_t> counts;
    const auto points = archive().minutes("timing.pulses_seen", {});
    for (const Point& point : *points) counts.push_back(static_cast<std::int64_t>(point.values.count));
    return counts;
  };
  for (std::uint16_t i = 0; i < 240; ++i) put(timing(i, start + seconds(i), i));
  ASSERT_THAT(values(), ElementsAre(60, 60, 60, 60));
  ASSERT_EQ(archive().prune("packets", start + seconds(90)), 90U);

  ASSERT_TRUE(archive().forget_minutes());
  EXPECT_THAT(values(), ElementsAre(60, 60, 60, 60)) << "there is nothing to make the first two of";
  put(timing(10, start + seconds(10), 10, tm_channel::playback));
  EXPECT_THAT(values(), ElementsAre(60, 60, 60, 60)) << "one packet of a forgotten minute is retrieved";
  recorder_.reset();
  open();
  put(timing(11, start + seconds(11), 11, tm_channel::playback));
  ASSERT_TRUE(archive().forget_minutes());
  EXPECT_THAT(values(), ElementsAre(60, 60, 60, 60)) << "a later run knows it";
}

TEST_F(ArchiveFile, TriesNoMoreOpenGapsOfAProcessThanItsMost) {
  constexpr int more = 1005;
  for (int i = 0; i < more; ++i) put(timing(static_cast<std::uint16_t>(3 * i), start + seconds(700 * i), 1));
  recorder_->commit();
  EXPECT_EQ(archive().gaps({}, true)->size(), 1000U);
  const auto all = archive().gaps({}, false);
  ASSERT_EQ(all->size(), 1004U);
  EXPECT_EQ(all->front().state, GapState::given_up) << "the oldest";
  EXPECT_EQ(all->back().state, GapState::open);
  ASSERT_TRUE(archive().give_up_gap(all->back().id));
  EXPECT_EQ(archive().gaps({}, false)->back().state, GapState::given_up);
}

TEST_F(ArchiveFile, BringsAnArchiveOfTheFirstSchemaUpToDate) {
  put(timing(1, start, 1));
  recorder_->commit();
  run("DROP TABLE pruned; DROP TABLE acknowledgements; DROP INDEX packet_latest; PRAGMA user_version=1");
  recorder_.reset();
  open();
  EXPECT_EQ(archive().prune("packets", start), 0U);
  EXPECT_EQ(packets().size(), 1U);
}

class DamagedArchive : public ArchiveFile {
 protected:
  void SetUp() override {
    open();
    for (std::uint16_t i = 0; i < count; ++i) put(timing(i, start + seconds(i), i));
    recorder_->commit();
    recorder_.reset();
    run("PRAGMA wal_checkpoint(TRUNCATE)");
  }
  void rot(std::uintmax_t page) {
    std::fstream octets(file(), std::ios::in | std::ios::out | std::ios::binary);
    octets.seekp(static_cast<std::streamoff>(page * 4096));
    octets << std::string(4096, '\xA5');
  }
  void rot_in_the_middle() { rot(std::filesystem::file_size(file()) / 3 / 4096); }
  static constexpr std::uint16_t count = 2000;
};

TEST_F(DamagedArchive, KeepsEachDamagedFile) {
  rot_in_the_middle();
  const auto first = repair_archive(file());
  ASSERT_TRUE(first) << first.error();
  const auto second = repair_archive(file());
  ASSERT_TRUE(second) << second.error();
  EXPECT_NE(first->damaged, second->damaged);
  EXPECT_TRUE(std::filesystem::exists(first->damaged) && std::filesystem::exists(second->damaged));
  EXPECT_EQ(second->lost, 0U);
}

TEST_F(DamagedArchive, ChangesNothingWhenNoPacketCanBeRead) {
  {
    auto database = Database::open(file(), Database::Use::read);
    rot(static_cast<std::uintmax_t>(
        *database->number("SELECT rootpage-1 FROM sqlite_master WHERE name='packets'")));
  }
  const auto size = std::filesystem::file_size(file());
  const auto repaired = repair_archive(file());
  ASSERT_FALSE(repaired);
  EXPECT_THAT(repaired.error(), HasSubstr("no packet can be read"));
  EXPECT_EQ(std::filesystem::file_size(file()), size);
  EXPECT_FALSE(std::filesystem::exists(file().string() + ".repaired"));
}

TEST_F(DamagedArchive, EndsWhateverRowNumberItClaims) {
  run("UPDATE packets SET id=4611686018427387904 WHERE id=2000");
  run("PRAGMA wal_checkpoint(TRUNCATE)");
  rot_in_the_middle();
  const auto repaired = repair_archive(file());
  ASSERT_TRUE(repaired) << repaired.error();
  open();
  EXPECT_GE(packets().size(), count * 9U / 10);
  EXPECT_EQ(packets({.newest_first = true}).front().id, std::int64_t{1} << 62);
}

TEST_F(DamagedArchive, CompletesARepairThatWasInterruptedBetweenTheRenames) {
  std::filesystem::rename(file(), file().string() + ".repaired");
  for (const ArchiveUse use : {ArchiveUse::read, ArchiveUse::write})
    EXPECT_THAT(open_archive(file(), use).error(), HasSubstr("interrupted")) << "no new one is begun";
  const auto repaired = repair_archive(file());
  ASSERT_TRUE(repaired) << repaired.error();
  EXPECT_TRUE(repaired->completed);
  open();
  EXPECT_EQ(packets().size(), count);
}

TEST(ArchiveReport, QuotesWhatWouldBreakALineOfValues) {
  EXPECT_EQ(csv_line({"a", "b,c", "say \"x\"", ""}), "a,\"b,c\",\"say \"\"x\"\"\",\r\n");
  EXPECT_EQ(csv_line(nlohmann::json{{"x", {"a", "b"}}, {"n", 5}, {"z", nullptr}}, {"n", "x", "z", "none"}),
            "5,a b,,\r\n");
}

TEST(ArchiveReport, WritesNoControlOfATerminalIntoALineOfValues) {
  EXPECT_EQ(csv_line({"a\033[2Jb", "c\r\nd", "\u009b", "e"}), "a\\x1b[2Jb,c\\x0d\\x0ad,\\u009b,e\r\n");
}

TEST(ArchiveReport, TakesATimeOrHowLongAgo) {
  EXPECT_EQ(parse_moment("2026-11-21T08:00:00Z", start), start);
  EXPECT_EQ(parse_moment("10m", start), start - seconds(600));
  EXPECT_EQ(parse_moment("3d", start), start - seconds(3 * 86400));
  EXPECT_EQ(parse_moment("yesterday", start), std::nullopt);
}

}  // namespace
}  // namespace srfs::ground
