// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <atomic>
#include <csignal>
#include <fstream>
#include <future>
#include <random>
#include <set>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "ground/archive/archive_report.hpp"
#include "ground/archive/archive_schema.hpp"
#include "ground/archive/postgresql_database.hpp"
#include "ground/archive/recorder.hpp"
#include "ground/archive/sqlite_database.hpp"
#include "ground/station_status.hpp"
#include "ground/test/archive_packets.hpp"
#include "tests/mission_dictionary.hpp"
#include "tests/postgresql_cluster.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::ground {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing_support::dictionary;

/// One for all tests of this program.
testing_support::PostgresqlCluster& cluster() {
  static testing_support::PostgresqlCluster of_program;
  return of_program;
}

/// A spacecraft that no other test has: an archive of its own in the cluster.
int another_spacecraft() {
  static int last = 0;
  return ++last;
}

class ArchiveTest : public ::testing::Test {
 protected:
  [[nodiscard]] virtual ArchivePlace place() const = 0;
  /// By another program.
  virtual void run(const std::string& sql) = 0;
  /// From now on, @p operation ("INSERT") on a table fails.
  virtual void break_table(const std::string& operation, const std::string& table) = 0;
  virtual void mend_table(const std::string& table) = 0;

  void open() {
    auto opened = open_archive(place(), ArchiveUse::write);
    ASSERT_TRUE(opened) << opened.error();
    recorder_ = std::make_unique<Recorder>(std::move(*opened), dictionary(),
                                           [this](const std::string& text) { log_.push_back(text); });
  }
  Archive& archive() { return recorder_->archive(); }
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

  std::vector<std::string> log_;
  std::unique_ptr<Recorder> recorder_;
};

/// An SQLite file.
class ArchiveFile : public virtual ArchiveTest {
 protected:
  void SetUp() override { open(); }
  [[nodiscard]] std::filesystem::path file() const { return folder_.path() / "archive.sqlite"; }
  [[nodiscard]] ArchivePlace place() const override { return file(); }
  void run(const std::string& sql) override {
    auto other = SqliteDatabase::open(file(), SqliteDatabase::Use::write);
    ASSERT_TRUE(other);
    const auto done = (*other)->run(sql);
    ASSERT_TRUE(done) << done.error().message;
  }
  void break_table(const std::string& operation, const std::string& table) override {
    run("CREATE TRIGGER fails BEFORE " + operation + " ON " + table +
        " BEGIN SELECT RAISE(ABORT, 'no room'); END");
  }
  void mend_table(const std::string&) override { run("DROP TRIGGER fails"); }

  testing_support::TemporaryFolder folder_;
};

/// A spacecraft's archive in a PostgreSQL.
class SharedArchive : public virtual ArchiveTest {
 protected:
  void SetUp() override {
    if (testing_support::PostgresqlCluster::programs().empty())
      GTEST_SKIP() << "PostgreSQL is not installed (packages.txt: postgresql-15)";
    open();
  }
  [[nodiscard]] ArchivePlace place() const override { return of_station(1); }
  [[nodiscard]] ArchivePlace of_station(unsigned station) const {
    ArchivePlace place(cluster().address(), spacecraft_, station);
    place.patience = patience_;
    return place;
  }
  [[nodiscard]] std::unique_ptr<PostgresqlDatabase> other() const {
    PostgresqlDatabase::Settings settings;
    settings.address = cluster().address();
    settings.patience = settings.connecting = seconds(30);
    settings.prepare = "SET search_path=srfs_" + std::to_string(spacecraft_);
    settings.lock = "SELECT pg_advisory_xact_lock(1397900883," + std::to_string(spacecraft_) + ")";
    return std::make_unique<PostgresqlDatabase>(settings);
  }
  void run(const std::string& sql) override {
    const auto done = other()->run(sql);
    ASSERT_TRUE(done) << done.error().message;
  }
  void break_table(const std::string& operation, const std::string& table) override {
    run("CREATE FUNCTION refuse() RETURNS trigger LANGUAGE plpgsql AS $$BEGIN RAISE 'no room'; END$$;"
        "CREATE TRIGGER fails BEFORE " +
        operation + " ON " + table + " FOR EACH ROW EXECUTE FUNCTION refuse()");
  }
  void mend_table(const std::string& table) override {
    run("DROP TRIGGER fails ON " + table + "; DROP FUNCTION refuse()");
  }

  int spacecraft_ = another_spacecraft();
  milliseconds patience_{60'000};  ///< the machine may be busy
};

enum class Kind : std::uint8_t { sqlite, postgresql };

/// What both must do.
class AnyArchive : public ArchiveFile, public SharedArchive, public ::testing::WithParamInterface<Kind> {
 protected:
  void SetUp() override { is_file() ? ArchiveFile::SetUp() : SharedArchive::SetUp(); }
  [[nodiscard]] static bool is_file() { return GetParam() == Kind::sqlite; }
  [[nodiscard]] ArchivePlace place() const override {
    return is_file() ? ArchiveFile::place() : SharedArchive::place();
  }
  void run(const std::string& sql) override { is_file() ? ArchiveFile::run(sql) : SharedArchive::run(sql); }
  void break_table(const std::string& operation, const std::string& table) override {
    is_file() ? ArchiveFile::break_table(operation, table) : SharedArchive::break_table(operation, table);
  }
  [[nodiscard]] std::unique_ptr<Database> another_writer() const {
    if (!is_file()) return other();
    auto opened = SqliteDatabase::open(file(), SqliteDatabase::Use::write);
    return opened ? std::move(*opened) : nullptr;
  }
  void mend_table(const std::string& table) override {
    is_file() ? ArchiveFile::mend_table(table) : SharedArchive::mend_table(table);
  }
};

INSTANTIATE_TEST_SUITE_P(Of, AnyArchive, ::testing::Values(Kind::sqlite, Kind::postgresql),
                         [](const auto& of) { return of.param == Kind::sqlite ? "Sqlite" : "Postgresql"; });

TEST_P(AnyArchive, KeepsALiveAndARetrievedCopyOfAPacketAsOne) {
  put(timing(5, start, 1));
  put(timing(5, start, 1, tm_channel::playback));
  put(timing(6, start + seconds(1), 2, tm_channel::playback));

  const auto found = packets();

  ASSERT_EQ(found.size(), 2U);
  EXPECT_TRUE(found[0].live && found[0].retrieved);
  EXPECT_TRUE(!found[1].live && found[1].retrieved);
  EXPECT_EQ(found[0].packet.raw, timing(5, start, 1).raw) << "raw packets are the truth";
}

TEST_P(AnyArchive, DecodesThePastByTheDictionaryOfToday) {
  put(timing(5, start, 77));
  const auto report = decode_telemetry(dictionary(), packets().front().packet);
  EXPECT_EQ(report.name, "timing");
  EXPECT_FALSE(report.fields.empty());
}

TEST_P(AnyArchive, FollowsATelecommandByTheReportsThatNameIt) {
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

TEST_P(AnyArchive, SaysThatNoReportCameOnlyWhenItsTimeIsOver) {
  order("a", {0x1811, 0xC005});
  const auto found = archive().telecommands({}, 10);
  EXPECT_FALSE(verdict_of(found->back(), dictionary(), start + seconds(1)).failed);
  EXPECT_EQ(verdict_of(found->back(), dictionary(), start + seconds(3600)).text, "no report");
}

TEST_P(AnyArchive, KnowsATelecommandByItsToken) {
  order("a", {0x1811, 0xC005});
  EXPECT_EQ(*recorder_->request_of("a"), (wire::RequestId{0x1811, 0xC005}));
  EXPECT_EQ(*recorder_->request_of("b"), std::nullopt);

  recorder_->on_not_sent("a");
  EXPECT_EQ(*recorder_->request_of("a"), std::nullopt) << "an order with its token is a new one";
}

TEST_P(AnyArchive, FailsOnWhenNothingOfAnUnrecordedTelecommandIsToBeForgotten) {
  break_table("INSERT", "telecommands");
  const auto encoded = dictionary().encode("eps.switch_load", {"load=2", "state=on"});
  ASSERT_FALSE(
      recorder_->on_telecommand({.command = *encoded, .token = "a"}, {0x1811, 0xC005}, false, start));
  recorder_->on_not_sent("a");
  EXPECT_THAT(recorder_->problem(), HasSubstr("no room"));
  EXPECT_EQ(log_.size(), 1U) << "it does not say that it works again";
}

TEST_P(AnyArchive, SaysThatItDoesNotKnowATelecommandWhenItFails) {
  break_table("INSERT", "telecommands");
  const auto encoded = dictionary().encode("eps.switch_load", {"load=2", "state=on"});
  const auto recorded = recorder_->on_telecommand(
      {.command = *encoded, .arguments = {"load=2", "state=on"}, .who = "tc", .token = "a"}, {0x1811, 0xC005},
      false, start);
  ASSERT_FALSE(recorded);
  EXPECT_THAT(recorded.error(), HasSubstr("no room"));
  run("DROP TABLE telecommands");
  EXPECT_FALSE(recorder_->request_of("a"));
}

TEST_P(AnyArchive, FindsGapsAndFillsThemWithWhatIsRetrieved) {
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

TEST_P(AnyArchive, TakesTheGapsOfThinnedTelemetryForOneUntilItIsFilled) {
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

TEST_P(AnyArchive, FindsTheGapOfTheTimeInWhichItDidNotRun) {
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

TEST_P(AnyArchive, RemembersTheNewestSequenceCountNotThatOfALatePacket) {
  for (const std::uint16_t sequence : std::vector<std::uint16_t>{1, 2, 3, 1})
    put(timing(sequence, start + seconds(sequence), sequence));
  recorder_->commit();
  recorder_.reset();
  open();
  put(timing(4, start + seconds(4), 4));
  recorder_->commit();
  EXPECT_THAT(*archive().gaps({}, true), IsEmpty());
}

TEST_P(AnyArchive, FindsAGapWhereACommitFailed) {
  put(timing(1, start + seconds(1), 1));
  recorder_->commit();
  break_table("UPDATE", "sequences");
  EXPECT_EQ(recorder_->on_packet(timing(2, start + seconds(2), 2), start), 2);
  EXPECT_EQ(recorder_->on_packet(timing(3, start + seconds(3), 3), start), 3);
  recorder_->commit();
  mend_table("sequences");
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

TEST_P(AnyArchive, HasThePassWhoseFirstCommitFailed) {
  break_table("INSERT", "passes");
  put(timing(1, start, 1));
  recorder_->commit();
  mend_table("passes");
  put(timing(2, start + seconds(1), 2));
  recorder_->commit();
  EXPECT_EQ(archive().passes({})->size(), 1U);
}

TEST_P(AnyArchive, GivesNoParameterTheNumberOfAnotherAfterAFailure) {
  break_table("DELETE", "dirty");
  put(timing(1, start, 1));
  recorder_->commit();
  EXPECT_FALSE(recorder_->make_minute(start + seconds(3600)));
  mend_table("dirty");
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

TEST_P(AnyArchive, KeepsWhoAcknowledgedAnEventFirst) {
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

TEST_P(AnyArchive, FindsTheTelecommandOfARequestThatCameAgain) {
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

TEST_P(AnyArchive, PagesBackwardsByTheTimeOfAPacketWithoutRepeatingOne) {
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

TEST_P(AnyArchive, SaysOnceThatItFailsAndThatItWorksOnlyWhenItDoes) {
  break_table("INSERT", "packets");
  for (std::uint16_t i = 0; i < 5; ++i) {
    EXPECT_EQ(recorder_->on_packet(timing(i, start + seconds(i), i), start), 0);
    recorder_->commit();
  }
  ASSERT_EQ(log_.size(), 1U);
  EXPECT_THAT(log_.front(), HasSubstr("no room"));
  EXPECT_THAT(recorder_->problem(), HasSubstr("no room"));
  mend_table("packets");
  put(timing(5, start + seconds(5), 5));
  recorder_->commit();
  EXPECT_EQ(recorder_->problem(), "");
  ASSERT_EQ(log_.size(), 2U);
  EXPECT_EQ(log_.back(), "the archive works again; 5 packets were not recorded");
}

TEST_P(AnyArchive, CountsThePacketsOfACommitThatFailedAsNotRecorded) {
  break_table("INSERT", "sequences");
  put(timing(1, start, 1));
  put(timing(2, start + seconds(1), 2));
  recorder_->commit();
  mend_table("sequences");
  put(timing(3, start + seconds(2), 3));
  recorder_->commit();
  EXPECT_EQ(log_.back(), "the archive works again; 2 packets were not recorded");
}

TEST_P(AnyArchive, GoesOnWhileAnotherProgramHasTheFileAndFindsTheGap) {
  put(timing(1, start, 1));
  recorder_->commit();
  {
    const auto writer = another_writer();
    ASSERT_TRUE(writer->begin());
    EXPECT_EQ(recorder_->on_packet(timing(2, start + seconds(1), 2), start), 0);
    recorder_->commit();
  }
  put(timing(3, start + seconds(2), 3));
  recorder_->commit();
  const auto gaps = archive().gaps({}, true);
  ASSERT_EQ(gaps->size(), 1U);
  EXPECT_EQ(gaps->front().gap.first, 2);
}

TEST_P(AnyArchive, ShowsTheLiveValueThatCameLastWhateverTheClockOnBoardSays) {
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

TEST_P(AnyArchive, MakesMinutesThatAgreeWithTheRawValues) {
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

TEST_P(AnyArchive, HistoryIsOfHousekeepingReportsAlone) {
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

TEST_P(AnyArchive, MakesAMinuteAgainWhenAPacketOfItIsRetrieved) {
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

TEST_P(AnyArchive, HasEveryPacketThatWasShownBeforeItsProcessWasKilled) {
  recorder_.reset();
  std::mt19937 random(7);
  std::uint16_t shown = 0;
  const int kills = is_file() ? 100 : 25;
  for (int kill_number = 0; kill_number < kills; ++kill_number) {
    std::array<int, 2> pipe_ends{};
    ASSERT_EQ(pipe(pipe_ends.data()), 0);
    const pid_t child = fork();
    if (child == 0) {
      auto opened = open_archive(place(), ArchiveUse::write);
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
    auto database = SqliteDatabase::open(file(), SqliteDatabase::Use::write);
    ASSERT_TRUE((*database)->run("PRAGMA user_version=99"));
  }
  EXPECT_THAT(open_archive(file(), ArchiveUse::write).error(), HasSubstr("newer srfs-ground"));
  const auto other = folder_.path() / "other.sqlite";
  {
    auto database = SqliteDatabase::open(other, SqliteDatabase::Use::write);
    ASSERT_TRUE((*database)->run("CREATE TABLE songs(name TEXT); PRAGMA user_version=1"));
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
    auto database = SqliteDatabase::open(file(), SqliteDatabase::Use::write);
    ASSERT_TRUE((*database)->run("PRAGMA wal_checkpoint(TRUNCATE)"));
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

TEST_P(AnyArchive, ForgetsWhatIsOlder) {
  for (std::uint16_t i = 0; i < 10; ++i) put(timing(i, start + seconds(i), i));
  recorder_->commit();
  EXPECT_EQ(archive().prune("packets", start + seconds(4)), 4U);
  EXPECT_EQ(packets().size(), 6U);
  EXPECT_FALSE(archive().prune("sqlite_master", start));
}

TEST_P(AnyArchive, NeverGivesTheNumberOfAPacketThatIsForgottenAgain) {
  for (std::uint16_t i = 0; i < 10; ++i) put(timing(i, start + seconds(i), i));
  recorder_->commit();
  EXPECT_EQ(archive().prune("packets", start + seconds(3600)), 9U);
  recorder_.reset();
  open();
  EXPECT_EQ(recorder_->on_packet(timing(10, start + seconds(10), 10), start), 11);
}

TEST_P(AnyArchive, KeepsTheMinutesWhosePacketsAreForgotten) {
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

TEST_P(AnyArchive, TriesNoMoreOpenGapsOfAProcessThanItsMost) {
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

/// An archive of the schema before the last step.
class OlderArchive : public AnyArchive {
 protected:
  void SetUp() override {
    AnyArchive::SetUp();
    if (IsSkipped()) return;
    put(timing(1, start, 1));
    recorder_->commit();
    recorder_.reset();
    make_older();
  }
  void make_older() {
    for (const char* index :
         {"packet_received", "packet_news", "report_packet", "file_time", "pass_began", "gap_begin"})
      run(fmt::format("DROP INDEX {}", index));
    run("CREATE INDEX packet_latest ON packets(service, structure)");
    run(is_file() ? "PRAGMA user_version=3" : "UPDATE archive_version SET version=1");
  }
  [[nodiscard]] static std::string last_step() {
    return is_file() ? fmt::format("{}; PRAGMA user_version={}", archive_steps.back(), archive_schema)
                     : fmt::format("{}; UPDATE archive_version SET version={}", postgresql_steps.back(),
                                   postgresql_steps.size());
  }
  [[nodiscard]] bool is_older() const {
    return *another_writer()->number(is_file() ? "PRAGMA user_version"
                                               : "SELECT version FROM archive_version") !=
           (is_file() ? archive_schema : std::int64_t{postgresql_steps.size()});
  }
  [[nodiscard]] std::int64_t indexes_of_reports() const {
    return *another_writer()->number(is_file()
                                         ? "SELECT count(*) FROM sqlite_master WHERE name='report_packet'"
                                         : "SELECT count(*) FROM pg_indexes WHERE indexname='report_packet' "
                                           "AND schemaname=current_schema()");
  }
};

INSTANTIATE_TEST_SUITE_P(Of, OlderArchive, ::testing::Values(Kind::sqlite, Kind::postgresql),
                         [](const auto& of) { return of.param == Kind::sqlite ? "Sqlite" : "Postgresql"; });

TEST_P(OlderArchive, IsNotReadAndFindsReportsByTheirPacketWhenItIsUpToDate) {
  EXPECT_THAT(open_archive(place(), ArchiveUse::read).error(), HasSubstr("brings it up to date"));
  EXPECT_EQ(indexes_of_reports(), 0);
  open();
  EXPECT_EQ(indexes_of_reports(), 1);
  EXPECT_EQ(packets().size(), 1U);
}

TEST_P(OlderArchive, IsBroughtUpToDateByTheNextOneWhenTheFirstWasKilledAnywhere) {
  std::mt19937 random(7);
  int cut = 0;
  for (int round = 0; round < 12; ++round) {
    const pid_t child = fork();
    if (child == 0) {
      static_cast<void>(open_archive(place(), ArchiveUse::care));
      _exit(0);
    }
    usleep(static_cast<useconds_t>(random() % 30'000));
    kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    if (is_older()) ++cut;
    open();
    EXPECT_FALSE(is_older());
    EXPECT_EQ(indexes_of_reports(), 1);
    EXPECT_EQ(packets().size(), 1U);
    recorder_.reset();
    make_older();
  }
  RecordProperty("cut", cut);
}

TEST_P(OlderArchive, IsWaitedForByAStationWhileAnotherProgramBringsItUpToDate) {
  const auto other = another_writer();
  ASSERT_TRUE(other->begin());
  auto opening =
      std::async(std::launch::async, [this] { return open_archive(place(), ArchiveUse::write).has_value(); });
  EXPECT_EQ(opening.wait_for(seconds(1)), std::future_status::timeout);
  const auto done = other->run(last_step());
  ASSERT_TRUE(done) << done.error().message;
  ASSERT_TRUE(other->commit());
  EXPECT_TRUE(opening.get());
}

TEST_F(ArchiveFile, RecordsAPacketAlthoughAnotherProgramTookItsNumber) {
  put(timing(1, start, 1));
  recorder_->commit();
  run("INSERT INTO packets SELECT id+1, time, received, apid, sequence+1, service, subtype, structure, "
      "copies, "
      "crc, raw FROM packets");
  const auto id = archive().add(timing(3, start + seconds(2), 3), start);
  ASSERT_TRUE(id) << id.error();
  EXPECT_EQ(*id, 3);
  EXPECT_EQ(packets().size(), 3U);
}

TEST_P(AnyArchive, GivesTheReportsOfATelecommandInTheOrderOfTheirReceiving) {
  const wire::RequestId request{0x1811, 0xC005};
  order("a", request);
  ASSERT_TRUE(archive().add(verification(request, 7, 2), start + seconds(2)));
  ASSERT_TRUE(archive().add(verification(request, 1, 1), start + seconds(1)));
  recorder_->commit();
  const auto found = archive().telecommands({}, 1);
  ASSERT_EQ(found->front().reports.size(), 2U);
  EXPECT_EQ(found->front().reports.front().subtype, 1);
}

TEST_F(ArchiveFile, BringsAnArchiveOfTheFirstSchemaUpToDate) {
  put(timing(1, start, 1));
  recorder_->commit();
  run("DROP TABLE pruned; DROP TABLE acknowledgements; DROP INDEX packet_received; DROP INDEX packet_news; "
      "DROP INDEX report_packet; DROP INDEX file_time; DROP INDEX pass_began; DROP INDEX gap_begin; "
      "PRAGMA user_version=1");
  recorder_.reset();
  open();
  EXPECT_EQ(archive().prune("packets", start), 0U);
  EXPECT_EQ(packets().size(), 1U);
}

/// The same spacecraft's packets at a second station.
class TwoStations : public SharedArchive {
 protected:
  void SetUp() override {
    SharedArchive::SetUp();
    if (IsSkipped()) return;
    auto opened = open_archive(of_station(2), ArchiveUse::write);
    ASSERT_TRUE(opened) << opened.error();
    second_ = std::move(*opened);
  }
  void put_at_second(const ReceivedPacket& packet) {
    const auto added = second_->add(packet, start);
    ASSERT_TRUE(added) << added.error();
    const auto committed = second_->commit();
    ASSERT_TRUE(committed) << committed.error();
  }
  void put_at_first(const ReceivedPacket& packet) {
    put(packet);
    recorder_->commit();
    EXPECT_EQ(recorder_->problem(), "");
  }
  static std::vector<std::int64_t> ids_after(Archive& archive, std::int64_t id) {
    std::vector<std::int64_t> ids;
    const auto read = archive.packets({.after_id = id}, [&](const StoredPacket& stored) {
      ids.push_back(stored.id);
      return true;
    });
    EXPECT_TRUE(read);
    return ids;
  }
  std::unique_ptr<Archive> second_;
};

TEST_F(TwoStations, HaveWhatBothReceiveOnceAndNoGapThatOneOfThemCloses) {
  for (std::uint16_t sequence = 0; sequence < 20; ++sequence) {
    const auto packet = timing(sequence, start + seconds(sequence), sequence);
    if (sequence < 12 || sequence > 15) put_at_first(packet);  // the antenna turns away
    if (sequence > 8 && sequence != 17) put_at_second(packet);
  }
  EXPECT_EQ(packets().size(), 20U);
  EXPECT_THAT(*archive().gaps({}, false), IsEmpty());
  EXPECT_EQ(archive().passes({})->size(), 2U) << "one of each station";
}

TEST_F(TwoStations, CountWhatNeitherReceivedAsMissing) {
  for (std::uint16_t sequence = 0; sequence < 10; ++sequence) {
    const auto packet = timing(sequence, start + seconds(sequence), sequence);
    if (sequence == 0 || sequence == 9) put_at_first(packet);
    if (sequence == 1 || sequence == 5) put_at_second(packet);
  }
  std::vector<std::uint32_t> missing;
  const auto gaps = archive().gaps({}, true);
  for (const StoredGap& gap : *gaps) missing.push_back(gap.missing);
  EXPECT_THAT(missing, ::testing::UnorderedElementsAre(6U, 3U)) << "1 and 5 came, to the other one";

  for (std::uint16_t sequence = 1; sequence < 9; ++sequence)
    put_at_second(timing(sequence, start + seconds(sequence), sequence, tm_channel::playback));
  EXPECT_THAT(*archive().gaps({}, true), IsEmpty());
}

TEST_F(TwoStations, HaveTheUnionAndMissTheRestWhateverEachOfThemLosesAndHowLateItIs) {
  constexpr std::uint16_t last = 60;  // both receive it, and the first
  for (const unsigned seed : {1U, 2U, 3U, 4U, 5U}) {
    std::mt19937 random(seed);
    const auto chance = [&random](unsigned percent) { return random() % 100 < percent; };
    std::array<std::uint16_t, 2> next{};  // of each station
    std::set<std::uint16_t> received;
    const UtcTime began = start + seconds(10'000 * seed);
    const auto first_sequence = static_cast<std::uint16_t>(1000 * seed);
    while (next[0] <= last || next[1] <= last) {
      const std::size_t station = next[1] > last || (next[0] <= last && chance(50)) ? 0 : 1;
      const std::uint16_t i = next.at(station)++;
      if (i != 0 && i != last && chance(40)) continue;
      received.insert(i);
      const auto packet = timing(static_cast<std::uint16_t>(first_sequence + i), began + seconds(i), i);
      station == 0 ? put_at_first(packet) : put_at_second(packet);
    }
    const Period period{began - seconds(200), began + seconds(200)};
    EXPECT_EQ(packets({.period = period}).size(), received.size()) << "seed " << seed;
    std::uint32_t missing = 0;
    const auto gaps = archive().gaps({began, began + seconds(last)}, true);
    for (const StoredGap& gap : *gaps) {
      if (gap.gap.from >= began) missing += gap.missing;
    }
    EXPECT_EQ(missing, 2 * (last + 1 - received.size())) << "as each of them says; seed " << seed;
  }
}

TEST_F(TwoStations, GiveATelecommandsReportsToTheOneThatWasSentLastByEither) {
  const wire::RequestId request{0x1811, 0xC005};
  order("first", request);
  put_at_second(verification(request, 7, 1));
  EXPECT_EQ(verdict_of(second_->telecommands({}, 10)->back(), dictionary(), start + seconds(1)).text,
            "completed");
  EXPECT_EQ(**second_->request_of("first"), request) << "no order goes up twice, whoever is asked";
}

TEST_F(TwoStations, TakeTurnsSoThatAReaderMissesNoPacketThatComesLate) {
  constexpr std::uint16_t each = 150;
  std::atomic<int> writers = 2;
  const auto writes = [&](unsigned station) {
    auto opened = open_archive(of_station(station), ArchiveUse::write);
    for (std::uint16_t i = 0; i < each; ++i) {
      const auto sequence = static_cast<std::uint16_t>(1000 * station + i);
      const auto packet = timing(sequence, start + seconds(sequence), sequence);
      // Another transaction may last longer than the patience.
      for (bool done = false; !done;)
        done = (*opened)->add(packet, start) && (*opened)->commit().value_or(false);
    }
    --writers;
  };
  std::thread first(writes, 3U);
  std::thread second(writes, 4U);
  std::vector<std::int64_t> seen;
  for (bool last = false; !last;) {
    last = writers == 0;
    for (const std::int64_t id : ids_after(archive(), seen.empty() ? 0 : seen.back())) seen.push_back(id);
  }
  first.join();
  second.join();
  EXPECT_EQ(seen, ids_after(archive(), 0));
  EXPECT_EQ(seen.size(), 2U * each);
}

TEST_F(TwoStations, MakeAMinuteOneAtATimeAndAgainWithAPacketThatCameMeanwhile) {
  put_at_first(timing(1, start, 10));
  const auto minute = archive().dirty_minute(start + seconds(3600));
  ASSERT_TRUE(minute && *minute);
  EXPECT_FALSE(second_->add(timing(2, start + seconds(1), 30), start)) << "it waits for the minute";
  EXPECT_FALSE(second_->dirty_minute(start + seconds(3600)).value_or(std::nullopt));
  EXPECT_FALSE(second_->commit().value_or(true));
  ASSERT_TRUE(archive().set_minute(**minute, {}));
  recorder_->commit();

  put_at_second(timing(2, start + seconds(1), 30));
  while (recorder_->make_minute(start + seconds(3600))) {
  }
  const auto points = second_->minutes("timing.pulses_seen", {});
  ASSERT_EQ(points->size(), 1U);
  EXPECT_EQ(points->front().values.max, 30);
  EXPECT_EQ(points->front().values.count, 2U);
}

TEST_F(TwoStations, KeepTheMinutesWhosePacketsTheOtherOneForgot) {
  put_at_first(timing(1, start, 10));
  put_at_first(timing(2, start + seconds(600), 10));
  while (recorder_->make_minute(start + seconds(3600))) {
  }
  ASSERT_EQ(archive().prune("packets", start + seconds(300)), 1U);
  put_at_second(timing(9, start + seconds(9), 99, tm_channel::playback));
  while (recorder_->make_minute(start + seconds(3600))) {
  }
  EXPECT_EQ(second_->minutes("timing.pulses_seen", {})->front().values.max, 10);
}

TEST_F(SharedArchive, GoesOnWithoutTheDatabaseAndTakesItUpAgain) {
  put(timing(1, start + seconds(1), 1));
  recorder_->commit();
  put(timing(2, start + seconds(2), 2));  // a transaction is open
  cluster().stop(SIGQUIT);
  recorder_->commit();
  EXPECT_THAT(recorder_->problem(), HasSubstr("postgresql://"));
  EXPECT_EQ(recorder_->on_packet(timing(3, start + seconds(3), 3), start), 0);
  recorder_->commit();
  EXPECT_EQ(log_.size(), 1U) << "it is told once";
  cluster().start();
  const MonotonicTime until = monotonic_now() + seconds(30);
  std::size_t lost = 2;  // 2 and 3
  for (; !recorder_->problem().empty() && monotonic_now() < until; ++lost) {
    put(timing(4, start + seconds(4), 4));
    recorder_->commit();
  }
  EXPECT_EQ(recorder_->problem(), "");
  EXPECT_EQ(log_.back(),
            "the archive works again; " + std::to_string(lost - 1) + " packets were not recorded");
  ASSERT_EQ(packets().size(), 2U);
  ASSERT_EQ(archive().gaps({}, true)->size(), 1U);
  EXPECT_EQ(archive().gaps({}, true)->front().missing, 2U);
}

TEST_F(SharedArchive, LosesNothingWhenTheDatabaseIsRestartedBetweenTwoTurns) {
  put(timing(1, start + seconds(1), 1));
  recorder_->commit();
  cluster().stop(SIGINT);
  cluster().start();
  put(timing(2, start + seconds(2), 2));
  recorder_->commit();
  EXPECT_EQ(packets().size(), 2U);
  EXPECT_THAT(log_, IsEmpty());
}

TEST_F(SharedArchive, IsOpenedByAStationWhileTheDatabaseIsAwayAndMadeWhenItComes) {
  recorder_.reset();
  spacecraft_ = another_spacecraft();
  cluster().stop(SIGINT);
  open();
  EXPECT_FALSE(archive().newest_packet());
  EXPECT_FALSE(open_archive(place(), ArchiveUse::read)) << "a command says so";
  cluster().start();
  const MonotonicTime until = monotonic_now() + seconds(30);
  for (std::uint16_t i = 0; archive().newest_packet().value_or(0) == 0 && monotonic_now() < until; ++i) {
    put(timing(i, start + seconds(i), i));
    recorder_->commit();
  }
  EXPECT_GT(packets().size(), 0U);
}

TEST_F(SharedArchive, HoldsUpTheStationForItsPatienceAloneWhenTheDatabaseDoesNotAnswer) {
  recorder_.reset();
  patience_ = seconds(1);
  open();
  put(timing(1, start + seconds(1), 1));
  recorder_->commit();
  std::vector<std::int64_t> frozen;
  {
    const auto connection = other();
    const auto pids =
        connection->prepare("SELECT pid FROM pg_stat_activity WHERE application_name='srfs-ground'");
    while ((*pids)->step().value_or(false)) frozen.push_back((*pids)->integer(0));
  }
  frozen.push_back(cluster().pid());
  for (const std::int64_t pid : frozen) ::kill(static_cast<pid_t>(pid), SIGSTOP);
  const MonotonicTime before = monotonic_now();
  for (std::uint16_t i = 2; i < 50; ++i) put(timing(i, start + seconds(i), i));
  recorder_->commit();
  const auto held = monotonic_now() - before;
  for (const std::int64_t pid : frozen) ::kill(static_cast<pid_t>(pid), SIGCONT);
  EXPECT_LT(held, seconds(5)) << "1 s, 1 s to end it, 0.2 s to connect, and a busy machine";
  EXPECT_NE(recorder_->problem(), "");
}

TEST_F(SharedArchive, LosesItsTurnWhenItDoesNothingInsideOfIt) {
  put(timing(1, start, 1));  // and stops there
  const auto writer = other();
  EXPECT_TRUE(writer->begin()) << "within 30 s";
  writer->roll_back();
  recorder_->commit();
  EXPECT_NE(recorder_->problem(), "");
}

TEST_F(SharedArchive, TakesTextThatIsNone) {
  ASSERT_TRUE(archive().add(FileEntry{.time = start,
                                      .transaction = "1",
                                      .direction = "down",
                                      .name = std::string("a\0b\xFF", 4),
                                      .event = "arrived",
                                      .octets = {}}));
  ASSERT_TRUE(archive().commit());
  EXPECT_EQ(archive().files({})->front().name, "a\uFFFDb\uFFFD");
}

TEST_F(SharedArchive, RefusesWhatIsNewerAndWhatIsNotThere) {
  recorder_.reset();
  run("UPDATE archive_version SET version=99");
  EXPECT_THAT(open_archive(place(), ArchiveUse::write).error(), HasSubstr("newer srfs-ground"));
  const ArchivePlace none(cluster().address(), another_spacecraft(), 1);
  EXPECT_THAT(open_archive(none, ArchiveUse::read).error(), HasSubstr("there is no archive"));
}

TEST_F(SharedArchive, IsNotChangedByOneWhoReads) {
  const auto reader = open_archive(place(), ArchiveUse::read);
  ASSERT_TRUE(reader);
  EXPECT_FALSE((*reader)->prune("packets", start));
}

TEST(PostgresqlAddress, HasNoPasswordAndAnErrorDoesNotShowIt) {
  for (const char* address :
       {"postgresql://me:secret@host/db", "postgresql://host/db?password=secret",
        "postgresql://me:secret@host:port:port/db", "postgresql://me:sec%zzret@host/db"}) {
    const auto opened = open_archive({address, 1, 1}, ArchiveUse::write);
    ASSERT_FALSE(opened) << address;
    EXPECT_THAT(opened.error(), ::testing::Not(HasSubstr("sec")));
  }
  EXPECT_EQ(wrong_address({"postgresql://me@host:5432/db?sslmode=verify-full", 1, 1}), std::nullopt);
  EXPECT_EQ(wrong_address({"/var/lib/archive.sqlite", 1, 1}), std::nullopt);
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
    auto database = SqliteDatabase::open(file(), SqliteDatabase::Use::read);
    rot(static_cast<std::uintmax_t>(
        *(*database)->number("SELECT rootpage-1 FROM sqlite_master WHERE name='packets'")));
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
