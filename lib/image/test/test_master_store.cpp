// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/file/master_store.hpp"

#include <cerrno>
#include <cmath>
#include <cstdio>
#include <limits>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/file.hpp"
#include "tests/temporary_folder.hpp"

namespace {

/// The calls that replace and remove files: one of them can be made to fail, or to be the process's last.
struct Disk {
  int calls = 0;
  int fails_at = -1;
  int dies_at = -1;
  /// @return whether this call fails
  bool call() {
    const int now = calls++;
    if (now == dies_at) ::_exit(0);
    if (now != fails_at) return false;
    errno = EIO;
    return true;
  }
};
Disk disk;

}  // namespace

// In place of the C library's, in this program.
extern "C" int fsync(int fd) {
  return disk.call() ? -1 : static_cast<int>(::syscall(SYS_fsync, fd));
}
extern "C" int rename(const char* from, const char* to) noexcept {
  return disk.call() ? -1 : ::renameat(AT_FDCWD, from, AT_FDCWD, to);
}
extern "C" int unlink(const char* path) noexcept {
  return disk.call() ? -1 : ::unlinkat(AT_FDCWD, path, 0);
}

namespace srfs::image {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;
using testing::UnorderedElementsAre;

Master dark_of(float level, double exposure_s = 0.5) {
  Master master{MasterKind::dark, Plane(20, 16, level), 8, 1, {20, 16, exposure_s, 6.0, std::nullopt}};
  master.level.at(3, 4) = std::numeric_limits<float>::quiet_NaN();
  return master;
}

class MasterStoreTest : public testing::Test {
 protected:
  void TearDown() override { disk = {}; }
  [[nodiscard]] static std::vector<std::string> names_in(const std::filesystem::path& folder) {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::directory_iterator(folder))
      names.push_back(entry.path().filename().string());
    return names;
  }
  /// The level of the newest dark.
  [[nodiscard]] static float newest(const MasterStore& store) {
    const auto listed = store.list(MasterKind::dark);
    EXPECT_THAT(listed.problems, IsEmpty());
    if (listed.masters.empty()) return 0;
    const auto read = store.read(listed.masters.front());
    return read ? read->master.level.at(0, 0) : -1;
  }

  testing_support::TemporaryFolder folder_;
  std::filesystem::path calibration_ = folder_.path() / "calibration";
  MasterStore store_{calibration_};
};

TEST_F(MasterStoreTest, GivesBackWhatWasSavedTheNewestFirst) {
  const auto first = store_.save(dark_of(10)).value().master;
  const auto second = store_.save(dark_of(12.5)).value().master;
  Master flat{MasterKind::flat, Plane(20, 16, 1), 5, 0, {20, 16, {}, {}, 280.0}};
  const auto of_flat = store_.save(flat).value().master;

  const auto listed = store_.list(MasterKind::dark);

  EXPECT_EQ(of_flat.generation, 1U) << "each kind counts by itself";
  EXPECT_NE(first.sha256, second.sha256);
  EXPECT_THAT(listed.problems, IsEmpty());
  ASSERT_THAT(listed.masters, SizeIs(2));
  EXPECT_EQ(listed.masters[0].generation, 2U);
  EXPECT_EQ(listed.masters[0].setting.exposure_s, 0.5);
  EXPECT_EQ(listed.masters[0].setting.gain, 6.0);
  EXPECT_FALSE(listed.masters[0].setting.temperature_k.has_value());
  EXPECT_EQ(listed.masters[1].generation, 1U);
  const auto read = store_.read(listed.masters[0]).value();
  EXPECT_EQ(read.sha256, second.sha256);
  EXPECT_EQ(read.master.level.at(0, 0), 12.5F);
  EXPECT_TRUE(std::isnan(read.master.level.at(3, 4)));
  EXPECT_EQ(read.master.frames, 8);
  EXPECT_EQ(read.master.defects, 1U);
  const auto flats = store_.list(MasterKind::flat).masters;
  ASSERT_THAT(flats, SizeIs(1));
  EXPECT_EQ(flats[0].setting.temperature_k, 280.0);
}

TEST_F(MasterStoreTest, ListsNoFileThatWasCutShort) {
  ASSERT_TRUE(store_.save(dark_of(10)));
  ASSERT_TRUE(store_.save(dark_of(12)));
  const auto path = calibration_ / "dark_0002.master";
  for (const std::size_t octets : {std::size_t{900}, std::size_t{60}, std::size_t{0}}) {
    std::string content = read_file(path).value();
    content.resize(std::min(content.size(), octets));
    ASSERT_TRUE(write_file_atomically(path, content));

    const auto listed = store_.list(MasterKind::dark);

    ASSERT_THAT(listed.problems, SizeIs(1));
    EXPECT_THAT(listed.problems[0], HasSubstr("dark_0002.master is broken"));
    ASSERT_THAT(listed.masters, SizeIs(1));
    EXPECT_EQ(listed.masters[0].generation, 1U);
  }
}

TEST_F(MasterStoreTest, ReadsNoFileWithAnOctetChanged) {
  ASSERT_TRUE(store_.save(dark_of(10)));
  const auto listed = store_.list(MasterKind::dark).masters.at(0);
  const auto path = calibration_ / "dark_0001.master";
  const std::string whole = read_file(path).value();
  for (std::size_t at = 0; at < whole.size(); at += 97) {
    std::string content = whole;
    content[at] = static_cast<char>(content[at] ^ 0x10);
    ASSERT_TRUE(write_file_atomically(path, content));
    const auto read = store_.read(listed);
    ASSERT_FALSE(read) << at;
    EXPECT_THAT(read.error().reason, HasSubstr("dark_0001.master is broken"));
  }
}

TEST_F(MasterStoreTest, KeepsTwoGenerationsOfASettingAndSixOfAKind) {
  for (int k = 0; k < 4; ++k) ASSERT_TRUE(store_.save(dark_of(static_cast<float>(k))));
  EXPECT_THAT(names_in(calibration_), UnorderedElementsAre("dark_0003.master", "dark_0004.master"));

  for (int k = 0; k < 5; ++k) ASSERT_TRUE(store_.save(dark_of(50, 1.0 + k)));

  EXPECT_THAT(names_in(calibration_),
              UnorderedElementsAre("dark_0004.master", "dark_0005.master", "dark_0006.master",
                                   "dark_0007.master", "dark_0008.master", "dark_0009.master"));
}

TEST_F(MasterStoreTest, ABrokenFileGoesWithTheNextSaveAndItsNumberIsNotUsedAgain) {
  ASSERT_TRUE(store_.save(dark_of(10)));
  ASSERT_TRUE(write_file_atomically(calibration_ / "dark_0007.master", "no master"));

  const auto saved = store_.save(dark_of(11)).value();

  EXPECT_EQ(saved.master.generation, 8U);
  EXPECT_THAT(names_in(calibration_), UnorderedElementsAre("dark_0001.master", "dark_0008.master"));
}

TEST_F(MasterStoreTest, WhatCannotBeRemovedDoesNotMakeASaveFail) {
  ASSERT_TRUE(store_.save(dark_of(10)));
  std::filesystem::create_directories(calibration_ / "dark_0000.master");  // no file: unlink fails

  const auto saved = store_.save(dark_of(11));

  ASSERT_TRUE(saved);
  ASSERT_THAT(saved->problems, SizeIs(1));
  EXPECT_THAT(saved->problems[0], HasSubstr("dark_0000.master"));
  EXPECT_EQ(store_.read(saved->master)->master.level.at(0, 0), 11);
}

TEST_F(MasterStoreTest, WhateverTheDiskRefusesASaveThatFailedLeavesTheGenerationBefore) {
  int refused = 0;
  for (int n = 0;; ++n) {
    const MasterStore store(folder_.path() / std::to_string(n));
    ASSERT_TRUE(store.save(dark_of(10)));
    ASSERT_TRUE(store.save(dark_of(11)));
    disk = {.fails_at = n};
    const auto saved = store.save(dark_of(12));
    const bool is_over = disk.calls <= n;
    disk = {};
    refused += saved ? 0 : 1;

    EXPECT_EQ(newest(store), saved ? 12 : 11) << n;
    if (is_over) break;
    const auto again = store.save(dark_of(13));
    ASSERT_TRUE(again) << n;
    EXPECT_THAT(again->problems, IsEmpty());
    EXPECT_EQ(newest(store), 13) << n;
    EXPECT_THAT(names_in(folder_.path() / std::to_string(n)), SizeIs(2)) << n;
  }
  EXPECT_EQ(refused, 3) << "of the file, its name and the folder";
}

TEST_F(MasterStoreTest, KilledAtAnyStepItLeavesTheOldOrTheNewGenerationWhole) {
  bool has_seen_old = false;
  for (int n = 0;; ++n) {
    const auto folder = folder_.path() / std::to_string(n);
    const MasterStore store(folder);
    ASSERT_TRUE(store.save(dark_of(10)));
    ASSERT_TRUE(store.save(dark_of(11)));
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      disk = {.dies_at = n};
      ::_exit(store.save(dark_of(12)) ? 1 : 2);
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFEXITED(status));

    const float level = newest(store);
    EXPECT_TRUE(level == 11 || level == 12) << n << ": " << level;
    has_seen_old = has_seen_old || level == 11;
    if (WEXITSTATUS(status) == 1) break;
    ASSERT_EQ(WEXITSTATUS(status), 0) << n;
    ASSERT_TRUE(store.save(dark_of(13))) << n;
    EXPECT_EQ(newest(store), 13) << n;
    EXPECT_THAT(names_in(folder), SizeIs(2)) << "nothing half written stays; step " << n;
  }
  EXPECT_TRUE(has_seen_old);
  EXPECT_EQ(newest(MasterStore(folder_.path() / "0")), 13);
}

/// The process can open nothing more.
class NoDescriptors {
 public:
  NoDescriptors() {
    ::getrlimit(RLIMIT_NOFILE, &before_);
    const rlimit none{0, before_.rlim_max};
    ::setrlimit(RLIMIT_NOFILE, &none);
  }
  ~NoDescriptors() { ::setrlimit(RLIMIT_NOFILE, &before_); }
  NoDescriptors(const NoDescriptors&) = delete;
  NoDescriptors& operator=(const NoDescriptors&) = delete;

 private:
  rlimit before_{};
};

TEST_F(MasterStoreTest, AFolderThatCannotBeReadIsNotAnEmptyOne) {
  ASSERT_TRUE(store_.save(dark_of(10)));
  MasterStore::Listed listed;
  std::string refused;
  {
    const NoDescriptors now;
    listed = store_.list(MasterKind::dark);
    if (const auto saved = store_.save(dark_of(11)); !saved) refused = saved.error().reason;
  }

  EXPECT_THAT(listed.masters, IsEmpty());
  ASSERT_THAT(listed.problems, SizeIs(1));
  EXPECT_THAT(listed.problems[0], HasSubstr("no dark is used: " + calibration_.string() + " cannot be read"));
  EXPECT_THAT(refused, HasSubstr("cannot be read"));
  EXPECT_EQ(newest(store_), 10) << "is still there, as generation 1";
  EXPECT_EQ(store_.save(dark_of(11))->master.generation, 2U);
}

TEST_F(MasterStoreTest, AFileInPlaceOfTheFolderIsAProblem) {
  ASSERT_TRUE(write_file_atomically(calibration_, "no folder"));
  EXPECT_THAT(store_.list(MasterKind::flat).problems, SizeIs(1));
  EXPECT_FALSE(store_.save(dark_of(10)));
}

TEST_F(MasterStoreTest, AFileThatTheDiskDoesNotGiveStays) {
  ASSERT_TRUE(store_.save(dark_of(10)));
  const auto unreadable = calibration_ / "dark_0002.master";
  std::filesystem::create_symlink("dark_0002.master", unreadable);  // ELOOP

  const auto saved = store_.save(dark_of(11)).value();

  EXPECT_EQ(saved.master.generation, 3U);
  ASSERT_THAT(saved.problems, SizeIs(1));
  EXPECT_THAT(saved.problems[0], HasSubstr("dark_0002.master cannot be read"));
  EXPECT_TRUE(std::filesystem::is_symlink(unreadable));
  EXPECT_THAT(store_.list(MasterKind::dark).problems, SizeIs(1));
}

TEST_F(MasterStoreTest, HasNothingWhereNothingWasMade) {
  const auto listed = store_.list(MasterKind::dark);
  EXPECT_THAT(listed.masters, IsEmpty());
  EXPECT_THAT(listed.problems, IsEmpty());
}

}  // namespace
}  // namespace srfs::image
