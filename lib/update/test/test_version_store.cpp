// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "lib/update/test/memory_version_files.hpp"
#include "tests/build_kind.hpp"
#include "tests/temporary_folder.hpp"
#include "update/version_store.hpp"

namespace srfs::update {
namespace {

constexpr milliseconds probation{5000};
const UtcTime now(seconds(1'700'000'000));

/// Applies change number @p kind to the store.
void change(VersionStore& store, MemoryVersionFiles& files, std::uint32_t kind) {
  const auto table = store.read().table;
  const VersionNumber some =
      table.versions().empty()
          ? golden
          : table.versions()[files.draw(static_cast<std::uint32_t>(table.versions().size()))].number;
  switch (kind) {
    case 0:
    case 1:
      (void)store.add(files.draw(2) == 0 ? "one" : "other", "test", now);
      break;
    case 2:
      (void)store.use(files.draw(5) == 0 ? golden : some, probation, "r");
      break;
    case 3:
      (void)store.commit(table.active());
      break;
    case 4:
      (void)store.fail(some, "r");
      break;
    case 5:
      (void)store.count_reset();
      break;
    default:
      (void)store.remove(some);
  }
}

TEST(VersionStoreProperties, EachChangeHappensWholeOrNotAtAllWhereverThePowerIsLost) {
  MemoryVersionFiles files;
  files.elsewhere = {{"one", std::string(900, '1')}, {"other", std::string(1200, '2')}};
  VersionStore store(files, "node");
  std::size_t losses = 0;
  constexpr std::size_t changes = testing_support::slow ? 20 : 60;
  for (std::size_t i = 0; i < changes; ++i) {
    const std::uint32_t kind = files.draw(7);
    const auto disk = files.disk;
    const auto random = files.random;
    const auto before = store.read().table;
    change(store, files, kind);
    const auto after_disk = files.disk;
    const auto after_random = files.random;
    const auto after = store.read().table;
    for (std::size_t call = 0;; ++call) {
      bool lost = false;
      for (std::uint32_t luck = 0; luck < 6; ++luck) {
        files.disk = disk;
        files.random = random;
        files.calls_until_loss = call;
        try {
          change(store, files, kind);
          files.calls_until_loss.reset();
        } catch (const PowerLoss&) {
          lost = true;
          ++losses;
          files.random = random + luck * 7919;
          files.lose_unsynced();
          const auto found = store.read();
          ASSERT_TRUE(found.table == before || found.table == after)
              << "change " << i << " of kind " << kind << ", call " << call;
          for (const Version& v : found.table.versions())
            ASSERT_EQ(store.damage(v), std::nullopt) << "change " << i << ", call " << call;
          // The store must remain usable.
          const auto number = store.add("one", "afterwards", now);
          ASSERT_TRUE(number);
          ASSERT_TRUE(store.use(*number, probation, ""));
          ASSERT_EQ(store.read().table.active(), *number);
          ASSERT_LE(files.names().size(), 2 + VersionTable::most_versions) << "nothing is left behind";
        }
      }
      if (!lost) break;
    }
    files.disk = after_disk;
    files.random = after_random;
    files.calls_until_loss.reset();
  }
  EXPECT_GT(losses, testing_support::slow ? 300U : 1000U);
}

struct StoreInMemory : testing::Test {
  MemoryVersionFiles files;
  VersionStore store{files, "node"};
  void SetUp() override { files.elsewhere = {{"one", "a program"}}; }
  void overwrite(const std::string& name, const std::string& text) {
    files.disk.inodes[files.disk.names.at(name)].now = text;
  }
};
using VersionStoreTest = StoreInMemory;

TEST_F(VersionStoreTest, ReadsTheOtherCopyWhenOneIsDamagedAndMendsItWithTheNextChange) {
  ASSERT_TRUE(store.add("one", "", now));
  ASSERT_TRUE(store.use(1, probation, ""));
  for (const char* copy : {"table_a", "table_b"}) {
    overwrite(copy, "rubbish");
    const auto reading = store.read();
    EXPECT_EQ(reading.table.active(), 1U) << copy;
    EXPECT_THAT(reading.problem, testing::HasSubstr(copy));
    ASSERT_TRUE(store.add("one", "", now));
    EXPECT_EQ(store.read().problem, "");
  }
}

TEST_F(VersionStoreTest, MeansGoldenWhenNoCopyCanBeReadAndBeginsAnew) {
  ASSERT_TRUE(store.add("one", "", now));
  ASSERT_TRUE(store.use(1, probation, ""));
  overwrite("table_a", "rubbish");
  overwrite("table_b", "");
  EXPECT_EQ(store.read().table.active(), golden);
  EXPECT_THAT(store.read().problem, testing::HasSubstr("golden is active"));
  ASSERT_TRUE(store.add("one", "", now));
  EXPECT_EQ(store.read().problem, "");
  EXPECT_EQ(store.read().table.active(), golden);
}

TEST_F(VersionStoreTest, ChangesNothingOnAFullDiskAndSaysSo) {
  ASSERT_TRUE(store.add("one", "", now));
  const auto before = store.read().table;
  files.refuses = true;
  EXPECT_EQ(store.add("one", "", now).error(), "no space");
  EXPECT_EQ(store.use(1, probation, "").error(), "no space");
  files.refuses = false;
  EXPECT_EQ(store.read().table, before);
}

TEST_F(VersionStoreTest, RefusesAnEmptyProgramAndOneThatIsNotThere) {
  files.elsewhere["nothing"] = "";
  EXPECT_FALSE(store.add("nothing", "", now));
  EXPECT_FALSE(store.add("missing", "", now));
  EXPECT_TRUE(files.names().empty());
}

TEST_F(VersionStoreTest, SeesThatAProgramIsGoneOrChanged) {
  ASSERT_TRUE(store.add("one", "", now));
  const Version version = store.read().table.versions().front();
  EXPECT_EQ(store.damage(version), std::nullopt);
  overwrite("node.1", "A program");
  EXPECT_THAT(*store.damage(version), testing::HasSubstr("SHA-256"));
  overwrite("node.1", "a prog");
  EXPECT_THAT(*store.damage(version), testing::HasSubstr("6 octets instead of 9"));
  files.disk.names.erase("node.1");
  EXPECT_TRUE(store.damage(version));
}

TEST(VersionStoreOnDisk, KeepsProgramsReadOnlyAndGivesThemBackAsTheyWere) {
  const testing_support::TemporaryFolder folder;
  const auto program = folder.path() / "program";
  std::ofstream(program) << std::string(200'000, 'p');
  PosixVersionFiles files(folder.path() / "versions" / "node");
  VersionStore store(files, "node");
  EXPECT_EQ(store.read().table, VersionTable()) << "no folder: golden alone";
  {
    const auto lock = files.lock(milliseconds(0));
    ASSERT_TRUE(lock);
    EXPECT_FALSE(files.lock(milliseconds(0))) << "one writer at a time";
    ASSERT_TRUE(store.add(program, "from here", now));
  }
  ASSERT_TRUE(files.lock(milliseconds(0)));
  const auto reading = store.read();
  ASSERT_EQ(reading.table.versions().size(), 1U);
  const Version& version = reading.table.versions().front();
  EXPECT_EQ(version.octets, 200'000U);
  EXPECT_EQ(version.origin, "from here");
  EXPECT_EQ(store.damage(version), std::nullopt);
  struct stat status {};
  ASSERT_EQ(stat((folder.path() / "versions" / "node" / "node.1").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0555U);
}

TEST(VersionStoreOnDisk, TakesNoFolderDeviceOrLinkToOneForAProgram) {
  const testing_support::TemporaryFolder folder;
  PosixVersionFiles files(folder.path() / "versions" / "node");
  VersionStore store(files, "node");
  ASSERT_TRUE(files.lock(milliseconds(0)));
  EXPECT_FALSE(store.add(folder.path(), "", now));
  EXPECT_FALSE(store.add("/dev/zero", "", now));
  EXPECT_TRUE(files.names().empty());
}

}  // namespace
}  // namespace srfs::update
