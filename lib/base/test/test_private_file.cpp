// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <fstream>
#include <functional>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/private_file.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

using testing::HasSubstr;

constexpr uid_t somebody_else = 65534;

/// Runs @p act as another user.
void as_somebody_else(const std::function<bool()>& act) {
  const pid_t child = fork();
  if (child == 0) _exit(setgid(somebody_else) == 0 && setuid(somebody_else) == 0 && act() ? 0 : 1);
  int status = 0;
  waitpid(child, &status, 0);
  ASSERT_EQ(status, 0);
}

mode_t mode_of(const std::filesystem::path& path) {
  struct stat status {};
  EXPECT_EQ(lstat(path.c_str(), &status), 0) << path;
  return status.st_mode & 07777U;
}

class PrivateFile : public testing::Test {
 protected:
  void SetUp() override {
    // Like /tmp and /dev/shm: every user may create files there.
    std::filesystem::create_directory(shared_);
    ASSERT_EQ(chmod(temporary_.path().c_str(), 0755), 0);
    ASSERT_EQ(chmod(shared_.c_str(), 01777), 0);
  }
  const testing_support::TemporaryFolder temporary_;
  const std::filesystem::path shared_ = temporary_.path() / "shared";
  const std::filesystem::path folder_ = shared_ / "srfs";
  const std::filesystem::path file_ = folder_ / "file";
};

TEST_F(PrivateFile, IsItsUsersAloneWhateverTheUmask) {
  const mode_t before = umask(0);
  const auto fd = open_private(file_, O_RDWR | O_CREAT);
  umask(before);
  ASSERT_TRUE(fd) << fd.error().message;
  EXPECT_EQ(mode_of(folder_), 0700U);
  EXPECT_EQ(mode_of(file_), 0600U);
  ASSERT_EQ(write(fd->get(), "text", 4), 4);
  EXPECT_EQ(read_private(file_, 4).value(), "text");
  EXPECT_FALSE(read_private(file_, 3));
}

TEST_F(PrivateFile, AFolderThatOthersMayReadIsTakenFromThemAndOneTheyMayWriteToIsNotUsed) {
  std::filesystem::create_directory(folder_);
  ASSERT_EQ(chmod(folder_.c_str(), 0755), 0);
  EXPECT_TRUE(open_private(file_, O_RDWR | O_CREAT));
  EXPECT_EQ(mode_of(folder_), 0700U);

  ASSERT_EQ(chmod(folder_.c_str(), 0777), 0);
  const auto open_to_all = open_private(file_, O_RDWR);
  ASSERT_FALSE(open_to_all);
  EXPECT_THAT(open_to_all.error().message,
              HasSubstr("others may write to it (mode 0777), so it is not used"));
}

TEST_F(PrivateFile, DoesNotFollowALinkInThePlaceOfItsFolderOrItself) {
  const auto elsewhere = temporary_.path() / "elsewhere";
  std::filesystem::create_directory(elsewhere);
  std::filesystem::create_directory_symlink(elsewhere, folder_);
  auto refused = open_private(file_, O_RDWR | O_CREAT);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().message, folder_.string() + ": is a symbolic link, so it is not used");
  EXPECT_TRUE(std::filesystem::is_empty(elsewhere));

  std::filesystem::remove(folder_);
  std::filesystem::create_directory(folder_);
  std::ofstream(elsewhere / "victim") << "intact";
  std::filesystem::create_symlink(elsewhere / "victim", file_);
  refused = open_private(file_, O_RDWR | O_CREAT | O_TRUNC);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().message, file_.string() + ": is a symbolic link, so it is not used");
  EXPECT_EQ(read_file(elsewhere / "victim").value(), "intact");
}

TEST_F(PrivateFile, IsARegularFile) {
  ASSERT_TRUE(open_private_folder(folder_, true));
  ASSERT_EQ(mkfifo(file_.c_str(), 0600), 0);
  const auto refused = open_private(file_, O_RDONLY);  // must not wait for a writer
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().message, file_.string() + ": is not a regular file, so it is not used");
}

TEST_F(PrivateFile, AFolderThatSomebodyElseMadeFirstIsNotUsed) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root";
  as_somebody_else([&] { return mkdir(folder_.c_str(), 0700) == 0; });
  const auto refused = open_private(file_, O_RDWR | O_CREAT);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().message, folder_.string() + ": belongs to user 65534, so it is not used");
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(PrivateFile, RootTakesTheFolderOfTheUserItIsToldAndLeavesNothingOfItsOwnThere) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root";
  as_somebody_else([&] { return open_private(file_, O_RDWR | O_CREAT).has_value(); });
  EXPECT_TRUE(read_private(file_, 10, somebody_else));
  EXPECT_FALSE(read_private(file_, 10, somebody_else - 1));
  ASSERT_TRUE(open_private(folder_ / "more", O_RDWR | O_CREAT, somebody_else));
  as_somebody_else([&] { return open_private(folder_ / "more", O_RDWR).has_value(); });
}

TEST_F(PrivateFile, ALockIsForNobodyElse) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root";
  const auto lock = shared_ / "node.lock";
  std::ofstream(lock) << "an older version's";
  ASSERT_EQ(chmod(lock.c_str(), 0666), 0);
  ASSERT_TRUE(open_lock_file(lock));
  EXPECT_EQ(mode_of(lock), 0600U);
  as_somebody_else([&] { return open(lock.c_str(), O_RDONLY | O_CLOEXEC) < 0 && errno == EACCES; });

  std::filesystem::create_symlink(lock, shared_ / "link.lock");
  EXPECT_FALSE(open_lock_file(shared_ / "link.lock"));
}

TEST_F(PrivateFile, AnAtomicWriteFollowsNoLinkThatWaitsUnderItsTemporaryName) {
  const auto victim = temporary_.path() / "victim";
  std::ofstream(victim) << "intact";
  std::filesystem::create_symlink(victim, shared_ / ("out." + std::to_string(getpid()) + ".tmp"));
  ASSERT_TRUE(write_file_atomically(shared_ / "out", "new"));
  EXPECT_EQ(read_file(victim).value(), "intact");
  EXPECT_EQ(read_file(shared_ / "out").value(), "new");
}

}  // namespace
}  // namespace srfs
