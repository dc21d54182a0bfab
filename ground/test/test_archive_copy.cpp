// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <random>
#include <utility>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "ground/archive/archive_copy.hpp"
#include "ground/archive/postgresql_database.hpp"
#include "ground/archive/recorder.hpp"
#include "ground/archive/sqlite_database.hpp"
#include "ground/server.hpp"
#include "ground/test/archive_packets.hpp"
#include "tests/mission_dictionary.hpp"
#include "tests/postgresql_cluster.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::ground {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using testing_support::dictionary;

constexpr wire::RequestId request{0x1811, 0xC005};

testing_support::PostgresqlCluster& cluster() {
  static testing_support::PostgresqlCluster of_program;
  return of_program;
}

enum class Kind : std::uint8_t { sqlite, postgresql };

std::string text_of(const StoredPacket& stored) {
  return fmt::format("packet {} {} {} {} {} {}", stored.packet.packet.apid,
                     stored.packet.packet.sequence_count, to_utc(stored.packet.packet.time).ns(),
                     stored.received.ns(), stored.live, stored.retrieved);
}

template <class T>
T known(Result<T, std::string> read) {
  EXPECT_TRUE(read) << read.error();
  return read ? std::move(*read) : T();
}

/// What an archive knows, without the numbers of its rows.
std::vector<std::string> truth_of(Archive& archive) {
  std::vector<std::string> truth;
  EXPECT_TRUE(archive.packets({}, [&](const StoredPacket& stored) {
    const auto acknowledged = stored.packet.packet.service == 5;
    truth.push_back(text_of(stored) + (acknowledged ? " event" : ""));
    return true;
  }));
  for (const StoredTelecommand& stored : known(archive.telecommands({}, SIZE_MAX))) {
    std::string text = fmt::format("telecommand {} {} {} by {}", stored.entry.token, stored.entry.name,
                                   stored.entry.sent.ns(), stored.entry.who);
    for (const auto& report : stored.reports) text += fmt::format(" ({},{})", 1, report.subtype);
    truth.push_back(text);
  }
  for (const FileEntry& file : known(archive.files({})))
    truth.push_back(fmt::format("file {} {} {} {}", file.time.ns(), file.name, file.event,
                                file.octets ? static_cast<int>(*file.octets) : -1));
  for (const StoredGap& gap : known(archive.gaps({}, false)))
    truth.push_back(fmt::format("gap {} {} {} missing {} {} {}", gap.gap.apid, gap.gap.first,
                                gap.gap.count.value_or(0), gap.missing, gap.attempts, to_text(gap.state)));
  for (const Pass& pass : known(archive.passes({})))
    truth.push_back(fmt::format("pass {} {} {}", pass.began.ns(), pass.ended.ns(), pass.packets));
  for (const Point& point : known(archive.minutes("timing.pulses_seen", {})))
    truth.push_back(fmt::format("minute {} {} {} {} {}", point.time.ns(), point.values.count,
                                point.values.min, point.values.mean, point.values.max));
  for (const std::int64_t minute : known(archive.dirty_minutes(mission::structure::timing, {})))
    truth.push_back(fmt::format("dirty {}", minute));
  std::sort(truth.begin(), truth.end());
  return truth;
}

class ArchiveCopy : public ::testing::TestWithParam<Kind> {
 protected:
  void SetUp() override {
    if (GetParam() == Kind::postgresql && testing_support::PostgresqlCluster::programs().empty())
      GTEST_SKIP() << "PostgreSQL is not installed (packages.txt: postgresql-15)";
  }

  [[nodiscard]] ArchivePlace file(const std::string& name) const {
    return folder_.path() / (name + ".sqlite");
  }
  /// An archive of the kind that rows are copied into.
  [[nodiscard]] ArchivePlace another_target() {
    static int last = 0;
    ++last;
    if (GetParam() == Kind::sqlite) return file("target" + std::to_string(last));
    return {cluster().address(), last, 1};
  }
  static std::unique_ptr<Archive> opened(const ArchivePlace& place, ArchiveUse use = ArchiveUse::care) {
    auto archive = open_archive(place, use);
    EXPECT_TRUE(archive) << archive.error();
    return archive ? std::move(*archive) : nullptr;
  }
  static void put(Archive& archive, const ReceivedPacket& packet, UtcTime received = start) {
    const auto added = archive.add(packet, received);
    EXPECT_TRUE(added) << added.error();
  }
  static void order(Archive& archive, const std::string& token, UtcTime sent, wire::RequestId id = request) {
    EXPECT_TRUE(archive.add(TelecommandEntry{.token = token,
                                             .request = id,
                                             .sent = sent,
                                             .who = "Ada",
                                             .name = "ttc.ping",
                                             .arguments = {"a=1"}}));
  }
  static void commit(Archive& archive) {
    const auto committed = archive.commit();
    EXPECT_TRUE(committed) << committed.error();
  }
  /// Makes the minutes that are over, as a server does.
  static void settle(const ArchivePlace& place) {
    Recorder recorder(opened(place), dictionary(), [](const std::string& text) { ADD_FAILURE() << text; });
    while (recorder.make_minute(start + std::chrono::hours(24))) {
    }
  }
  static std::vector<std::string> truth(const ArchivePlace& place) {
    const auto archive = opened(place, ArchiveUse::read);
    return archive ? truth_of(*archive) : std::vector<std::string>();
  }
  static std::vector<CopiedRows> copy(const ArchivePlace& from, const ArchivePlace& into) {
    const auto copied = copy_archive(from, into, [](const CopiedRows&) {});
    EXPECT_TRUE(copied) << copied.error();
    return copied.value_or(std::vector<CopiedRows>());
  }

  static ReceivedPacket event(std::uint16_t sequence) {
    ReceivedPacket event = timing(sequence, start, 0);
    event.packet.apid = 3;
    event.packet.service = 5;
    event.packet.subtype = 3;
    event.raw = wire::make_tm_packet(event.packet);
    return event;
  }
  /// Some of everything. @param packets  of housekeeping, of which five are a gap
  void fill(const ArchivePlace& place, std::uint16_t packets) const {
    {
      const auto archive = opened(place);
      for (std::uint16_t sequence = 0; sequence < packets; ++sequence) {
        if (sequence >= 20 && sequence < 25) continue;
        put(*archive, timing(sequence, start + seconds(sequence), sequence), start + seconds(sequence));
      }
      put(*archive, timing(7, start + seconds(7), 7, tm_channel::playback), start + seconds(packets));
      order(*archive, "first", start);
      put(*archive, verification(request, 1, 1), start + seconds(1));
      order(*archive, "second", start + seconds(2));
      put(*archive, verification(request, 7, 2), start + seconds(3));
      order(*archive, "not sent", start + seconds(4), {0x1811, 0xC006});
      EXPECT_TRUE(archive->forget_token("not sent"));
      for (const auto octets : {std::optional<std::uint64_t>(7), std::optional<std::uint64_t>()})
        EXPECT_TRUE(archive->add(FileEntry{start, "1", "down", "a b.fits", "arrived", octets}));
      const auto id = archive->add(event(9), start);
      EXPECT_TRUE(id);
      EXPECT_TRUE(archive->acknowledge(id.value_or(0), {start + seconds(5), "Ada"}));
      commit(*archive);
      EXPECT_EQ(archive->gaps({}, true)->size(), 1U);
    }
    settle(place);
  }

  testing_support::TemporaryFolder folder_;
};

INSTANTIATE_TEST_SUITE_P(Into, ArchiveCopy, ::testing::Values(Kind::sqlite, Kind::postgresql),
                         [](const auto& of) { return of.param == Kind::sqlite ? "Sqlite" : "Postgresql"; });

TEST_P(ArchiveCopy, HasAllThatTheSourceHasAndNothingTwice) {
  const ArchivePlace source = file("source");
  const ArchivePlace target = another_target();
  fill(source, 600);

  const auto first = copy(source, target);
  EXPECT_EQ(truth(target), truth(source));
  EXPECT_THAT(first, Contains(AllOf(Field(&CopiedRows::table, "packets"), Field(&CopiedRows::added, 598U))));

  EXPECT_THAT(copy(source, target), Each(Field(&CopiedRows::added, 0U)));
  EXPECT_EQ(truth(target), truth(source));

  const auto archive = opened(target);
  std::int64_t id = 0;
  EXPECT_TRUE(archive->packets({.service = std::uint8_t{5}}, [&](const StoredPacket& stored) {
    id = stored.id;
    return false;
  }));
  EXPECT_EQ((*archive->acknowledgement_of(id))->who, "Ada");
}

TEST_P(ArchiveCopy, ComesBackFromItsTargetUnchanged) {
  const ArchivePlace source = file("source");
  const ArchivePlace target = another_target();
  fill(source, 100);
  copy(source, target);
  copy(target, file("again"));
  EXPECT_EQ(truth(file("again")), truth(source));
}

TEST_P(ArchiveCopy, IsCompletedByAnotherOneAfterItWasKilledAnywhere) {
  const ArchivePlace source = file("source");
  fill(source, 2000);
  const auto all = truth(source);
  std::mt19937 random(11);
  const ArchivePlace target = another_target();
  for (int kill_number = 0; kill_number < 12; ++kill_number) {
    const pid_t child = fork();
    if (child == 0) {
      static_cast<void>(copy_archive(source, target, [](const CopiedRows&) {}));
      _exit(0);
    }
    usleep(static_cast<useconds_t>(random() % 40'000));
    kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
  }
  copy(source, target);
  settle(target);
  EXPECT_EQ(truth(target), all);
  EXPECT_TRUE(opened(target, ArchiveUse::read)->check()->empty());
}

TEST_P(ArchiveCopy, EndsWhenItsSourceIsStartedAnewAndIsCompletedByAnotherOne) {
  if (GetParam() == Kind::sqlite) GTEST_SKIP() << "a file needs no server";
  const ArchivePlace original = file("original");
  const ArchivePlace source = another_target();
  fill(original, 2000);
  copy(original, source);
  bool stopped = false;
  const auto copied = copy_archive(source, file("target"), [&](const CopiedRows&) {
    if (std::exchange(stopped, true)) return;
    cluster().stop(SIGINT);
    cluster().start();
  });
  ASSERT_FALSE(copied) << "what its source had when it began is not known any more";
  EXPECT_THAT(copied.error(), HasSubstr("the same command completes it"));

  copy(source, file("target"));
  settle(file("target"));
  EXPECT_EQ(truth(file("target")), truth(original));
}

TEST_P(ArchiveCopy, AddsWhatCameSinceTheLastOne) {
  const ArchivePlace source = file("source");
  const ArchivePlace target = another_target();
  fill(source, 100);
  copy(source, target);
  {
    const auto archive = opened(source);
    for (std::uint16_t sequence = 20; sequence < 25; ++sequence)  // the gap is filled
      put(*archive, timing(sequence, start + seconds(sequence), sequence, tm_channel::playback),
          start + seconds(150));
    put(*archive, timing(100, start + seconds(100), 100), start + seconds(151));
    EXPECT_TRUE(archive->forget_token("second"));
    commit(*archive);
  }
  settle(source);

  copy(source, target);
  settle(target);
  EXPECT_EQ(truth(target), truth(source));
}

TEST_P(ArchiveCopy, OfTwoStationsIsTheSameInEitherOrder) {
  const ArchivePlace first = file("first");
  const ArchivePlace second = file("second");
  const wire::RequestId other{0x1811, 0xC009};
  for (const ArchivePlace& place : {first, second}) {
    const bool is_first = place.address == first.address;
    {
      const auto archive = opened(place);
      for (std::uint16_t sequence = 0; sequence < 90; ++sequence) {
        const bool missed = is_first ? sequence >= 30 && sequence < 40 : sequence < 20 || sequence == 35;
        if (missed || sequence == 50) continue;
        put(*archive, timing(sequence, start + seconds(sequence), sequence),
            start + seconds(sequence) + milliseconds(is_first ? 10 : 5));
      }
      // The second station has an older telecommand with the same request, and alone receives the report.
      order(*archive, is_first ? "first" : "second", start + seconds(is_first ? 60 : 10));
      if (!is_first) put(*archive, verification(request, 7, 2), start + seconds(61));
      if (is_first) order(*archive, "of the first", start + seconds(5), other);
      if (!is_first) put(*archive, verification(other, 1, 3), start + seconds(6));
      commit(*archive);
    }
    settle(place);
  }
  const ArchivePlace target = another_target();
  const ArchivePlace reversed = another_target();
  copy(first, target);
  copy(second, target);
  copy(second, reversed);
  copy(first, reversed);
  settle(target);
  settle(reversed);

  const auto all = truth(target);
  EXPECT_EQ(truth(reversed), all);
  EXPECT_THAT(copy(first, target), Each(Field(&CopiedRows::added, 0U)));
  EXPECT_EQ(truth(target), all);

  EXPECT_EQ(
      std::count_if(all.begin(), all.end(), [](const auto& row) { return row.starts_with("packet 2 "); }), 88)
      << "what neither received is missing: 35 and 50";
  EXPECT_THAT(all, Contains(AllOf(HasSubstr("telecommand first "), HasSubstr("(1,7)"))));
  EXPECT_THAT(all, Contains(AllOf(HasSubstr("telecommand of the first "), HasSubstr("(1,1)"))));
  EXPECT_THAT(all, Contains(HasSubstr("gap 2 30 21 missing 2 ")));
}

TEST_P(ArchiveCopy, LeavesARetrievedReportWithWhatWasSentBeforeTheSpacecraftMadeIt) {
  const ArchivePlace first = file("first");
  const ArchivePlace second = file("second");
  {
    const auto archive = opened(first);
    order(*archive, "first", start - seconds(1));
    ReceivedPacket report = verification(request, 7, 2);
    report.vc = tm_channel::playback;
    put(*archive, report, start + std::chrono::hours(2));
    commit(*archive);
    const auto other = opened(second);
    order(*other, "second", start + std::chrono::hours(1));
    commit(*other);
  }
  for (const bool reversed : {false, true}) {
    const ArchivePlace target = another_target();
    copy(reversed ? second : first, target);
    copy(reversed ? first : second, target);
    const auto all = truth(target);
    EXPECT_THAT(all, Contains(AllOf(HasSubstr("telecommand first "), HasSubstr("(1,7)"))));
    EXPECT_THAT(all, Contains(AllOf(HasSubstr("telecommand second "), Not(HasSubstr("(1,7)")))));
  }
}

TEST_P(ArchiveCopy, OfBeforeATelecommandWasKnownNotToHaveGoneUpChangesNothing) {
  const ArchivePlace source = file("source");
  const ArchivePlace older = file("older");
  const ArchivePlace target = another_target();
  {
    const auto archive = opened(source);
    order(*archive, "T", start);
    commit(*archive);
  }
  copy(source, older);
  {
    const auto archive = opened(source);
    EXPECT_TRUE(archive->forget_token("T"));
    commit(*archive);
  }
  copy(source, target);
  EXPECT_THAT(copy(older, target), Each(Field(&CopiedRows::added, 0U)));
  EXPECT_THAT(copy(source, target), Each(Field(&CopiedRows::added, 0U)));
  EXPECT_EQ(truth(target), truth(source));
}

TEST_P(ArchiveCopy, OfAnOlderArchiveLeavesTheLatestValueAndTelecommand) {
  const ArchivePlace older = file("older");
  const ArchivePlace target = another_target();
  for (const auto& [place, sequence, received] : {std::tuple(target, std::uint16_t{2}, start + seconds(100)),
                                                  std::tuple(older, std::uint16_t{1}, start)}) {
    const auto archive = opened(place);
    put(*archive, timing(sequence, received, sequence), received);
    order(*archive, fmt::format("{}", sequence), received);
    commit(*archive);
  }

  copy(older, target);

  const auto archive = opened(target);
  std::uint16_t latest = 0;
  EXPECT_TRUE(archive->packets({.service = std::uint8_t{3}, .latest_live = true, .most = 1},
                               [&](const StoredPacket& stored) {
                                 latest = stored.packet.packet.sequence_count;
                                 return true;
                               }));
  EXPECT_EQ(latest, 2);
  EXPECT_EQ(archive->telecommands({}, 1)->front().entry.token, "2");
  put(*archive, verification(request, 1, 1), start + seconds(101));
  commit(*archive);
  EXPECT_EQ(archive->telecommands({}, 1)->front().reports.size(), 1U) << "of the one that was sent last";
}

TEST_P(ArchiveCopy, OfAnOlderArchiveLeavesThePassThatIsGoingOn) {
  const ArchivePlace older = file("older");
  const ArchivePlace target = another_target();
  for (const auto& [place, sequence, received] : {std::tuple(target, std::uint16_t{2}, start + seconds(1000)),
                                                  std::tuple(older, std::uint16_t{1}, start)}) {
    const auto archive = opened(place);
    put(*archive, timing(sequence, received, sequence), received);
    commit(*archive);
  }

  copy(older, target);

  const auto archive = opened(target);
  put(*archive, timing(3, start + seconds(1050), 3), start + seconds(1050));
  commit(*archive);
  const auto passes = known(archive->passes({}));
  ASSERT_EQ(passes.size(), 2U);
  EXPECT_EQ(passes.back().packets, 2U);
}

TEST_P(ArchiveCopy, IsNoNewsToAReaderThatGoesOnBehindAPacket) {
  const ArchivePlace source = file("source");
  const ArchivePlace target = another_target();
  fill(source, 300);
  const auto station = opened(target);
  put(*station, timing(1000, start + seconds(1000), 1));
  commit(*station);
  const auto seen = known(station->newest_packet());
  const auto since = [&](std::int64_t number) {
    std::vector<std::uint16_t> sequences;
    EXPECT_TRUE(station->packets({.after_id = number}, [&](const StoredPacket& stored) {
      sequences.push_back(stored.packet.packet.sequence_count);
      return true;
    }));
    return sequences;
  };

  copy(source, target);  // beside the station
  EXPECT_THAT(since(seen), IsEmpty());

  put(*station, timing(1001, start + seconds(1001), 1));
  put(*station, timing(5, start + seconds(5), 5));  // a copy has it
  commit(*station);
  EXPECT_THAT(since(seen), ElementsAre(1001));
  EXPECT_THAT(since(0), ElementsAre(1000, 1001));

  const ArchivePlace again = file("again");
  copy(target, again);
  EXPECT_EQ(truth(again), truth(target));
}

TEST_P(ArchiveCopy, IsOfTheMomentInWhichItBeganWhateverAServerWritesMeanwhile) {
  const ArchivePlace source = file("source");
  const ArchivePlace target = another_target();
  fill(source, 300);
  const auto before = truth(source);
  const auto server = opened(source);
  std::uint16_t sequence = 300;
  const auto copied = copy_archive(source, target, [&](const CopiedRows&) {
    put(*server, timing(sequence, start + seconds(sequence), sequence), start + seconds(sequence));
    ++sequence;
    order(*server, fmt::format("meanwhile {}", sequence), start + seconds(sequence));
    commit(*server);
  });
  ASSERT_TRUE(copied) << copied.error();
  EXPECT_EQ(truth(target), before);

  const auto station = opened(target);
  put(*station, timing(sequence, start + seconds(sequence), sequence));
  commit(*station);
  EXPECT_EQ(known(station->gaps({}, true)).back().missing, sequence - 300U) << "what came meanwhile";
}

TEST_P(ArchiveCopy, LeavesTheAggregatesOfMinutesWhosePacketsAreForgotten) {
  const ArchivePlace source = file("source");
  const ArchivePlace target = another_target();
  for (const auto& [place, packets] : {std::pair(source, 30), std::pair(target, 180)}) {
    const auto archive = opened(place);
    for (int i = 0; i < packets; ++i) {
      const auto sequence = static_cast<std::uint16_t>(i);
      put(*archive, timing(sequence, start + seconds(i), sequence), start + seconds(i));
    }
    commit(*archive);
  }
  settle(target);
  EXPECT_TRUE(opened(target)->prune("packets", start + seconds(50)));  // the source's minute is not made yet

  copy(source, target);
  settle(target);

  const auto minutes = known(opened(target)->minutes("timing.pulses_seen", {}));
  ASSERT_EQ(minutes.size(), 3U);
  EXPECT_EQ(minutes.front().values.count, 60U);

  // The same the other way round, where fewer packets were known.
  copy(target, source);
  settle(source);
  EXPECT_EQ(truth(source), truth(target));
}

TEST_P(ArchiveCopy, CountsWhatIsMissingInAGapThatEndsEarlierInTheOtherArchive) {
  const ArchivePlace first = file("first");
  const ArchivePlace second = file("second");
  for (const auto& [place, end, late] : {std::tuple(first, 40, 10), std::tuple(second, 50, 5)}) {
    const auto archive = opened(place);
    for (int i = 0; i < 90; ++i) {
      if (i >= 30 && i < end) continue;
      const auto sequence = static_cast<std::uint16_t>(i);
      put(*archive, timing(sequence, start + seconds(i), sequence), start + seconds(i) + milliseconds(late));
    }
    commit(*archive);
    EXPECT_EQ(known(archive->gaps({}, true)).size(), 1U);
  }
  const ArchivePlace target = another_target();
  const ArchivePlace reversed = another_target();
  copy(first, target);
  copy(second, target);
  copy(second, reversed);
  copy(first, reversed);
  EXPECT_EQ(truth(reversed), truth(target));
  EXPECT_THAT(truth(target), Contains(HasSubstr("gap 2 30 20 missing 10 ")));

  copy(first, second);
  copy(second, first);
  EXPECT_EQ(truth(first), truth(second));
}

TEST(ArchiveLock, IsThatOfEachServerThatMayWriteTheFileHoweverItIsSpelled) {
  const testing_support::TemporaryFolder folder;
  const auto state = folder.path() / "state";
  const auto other = folder.path() / "other";
  for (const auto& made : {state, other}) std::filesystem::create_directory(made);
  const auto file = state / "archive.sqlite";
  const auto link = folder.path() / "link.sqlite";
  std::filesystem::create_symlink(file, link);
  std::ofstream(file) << "";
  const auto is_free = [&](const std::filesystem::path& path) {
    return lock_archive(path, other, folder.path() / "other/../link.sqlite").has_value();
  };
  for (const auto& path : {file, link, other / "../state/archive.sqlite"}) {
    EXPECT_TRUE(is_free(path));
    for (const auto& server : {state, other}) {
      const auto lock = lock_state(server);
      ASSERT_TRUE(lock);
      EXPECT_FALSE(is_free(path)) << path << " while a server has " << server;
      EXPECT_TRUE(is_free(folder.path() / "another.sqlite"));
    }
  }
}

TEST_P(ArchiveCopy, RefusesItselfAndOtherSchemas) {
  const ArchivePlace source = file("source");
  const ArchivePlace target = another_target();
  const auto error = [&](const ArchivePlace& from) {
    const auto copied = copy_archive(from, target, [](const CopiedRows&) {});
    return copied ? std::string() : copied.error();
  };
  EXPECT_THAT(error(source), HasSubstr("there is no archive"));
  fill(source, 30);
  copy(source, target);
  EXPECT_THAT(error(target), HasSubstr("not copied into itself"));
  const auto all = truth(target);
  ArchivePlace spelled = target;
  if (GetParam() == Kind::postgresql) {
    spelled.address += "&application_name=another";  // not known to be the same: nothing changes
    EXPECT_EQ(error(spelled), "");
  } else {
    spelled = file("link");
    std::filesystem::create_symlink(target.address, spelled.address);
    EXPECT_THAT(error(spelled), HasSubstr("not copied into itself"));
  }
  EXPECT_EQ(truth(target), all);

  const auto set_version_of_file = [&](const ArchivePlace& place, int version) {
    auto database = SqliteDatabase::open(place.address, SqliteDatabase::Use::write);
    ASSERT_TRUE(database && (*database)->run(fmt::format("PRAGMA user_version={}", version)));
  };
  const auto set_version = [&](int version) {
    if (GetParam() == Kind::sqlite) return set_version_of_file(target, version);
    PostgresqlDatabase::Settings settings;
    settings.address = target.address;
    settings.patience = settings.connecting = seconds(30);
    PostgresqlDatabase database(settings);
    const auto done = database.run(
        fmt::format("UPDATE srfs_{}.archive_version SET version={}", target.spacecraft, version));
    ASSERT_TRUE(done) << done.error().message;
  };
  set_version(99);
  EXPECT_THAT(error(source), HasSubstr("newer srfs-ground"));
  set_version(1);
  EXPECT_THAT(error(source), HasSubstr("srfs-ground serve brings it up to date"));
  set_version_of_file(source, 3);
  EXPECT_THAT(error(source),
              AllOf(HasSubstr("source.sqlite: of schema 3"), HasSubstr("brings it up to date")));
}

}  // namespace
}  // namespace srfs::ground
