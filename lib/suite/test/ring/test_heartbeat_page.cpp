// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <fstream>

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "suite/ring/heartbeat_page.hpp"

namespace srfs::suite {
namespace {

class HeartbeatPageTest : public testing::Test {
 protected:
  HeartbeatPageTest() { std::filesystem::create_directories(var_.root); }
  ~HeartbeatPageTest() override {
    std::filesystem::remove_all(var_.memory());
    std::filesystem::remove_all(var_.root);
  }
  VarPaths var_{std::filesystem::temp_directory_path() / ("srfs_heartbeat_" + std::to_string(getpid()))};
};

TEST_F(HeartbeatPageTest, TellsOthersWhoRunsAndWhenItsLastTurnWas) {
  EXPECT_FALSE(HeartbeatPage::read(var_, "eps"));
  auto page = HeartbeatPage::create(var_, "eps", 7);
  ASSERT_TRUE(page) << page.error();
  page->beat(MonotonicTime(seconds(3)));
  page->beat(MonotonicTime(seconds(4)));
  const auto reading = HeartbeatPage::read(var_, "eps");
  ASSERT_TRUE(reading);
  EXPECT_EQ(reading->pid, getpid());
  EXPECT_EQ(reading->incarnation, 7U);
  EXPECT_EQ(reading->last_turn, MonotonicTime(seconds(4)));
  EXPECT_EQ(reading->turns, 2U);
  EXPECT_EQ(reading->end, EndKind::running);
}

TEST_F(HeartbeatPageTest, KeepsTheLastWordsOfAProcessUntilItsSuccessorBegins) {
  const pid_t child = fork();
  if (child == 0) {
    auto page = HeartbeatPage::create(var_, "eps", 1);
    if (page) page->end(EndKind::signal, 11);
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  const auto last = HeartbeatPage::read(var_, "eps");
  ASSERT_TRUE(last);
  EXPECT_EQ(last->pid, child);
  EXPECT_EQ(last->end, EndKind::signal);
  EXPECT_EQ(last->end_value, 11U);
  ASSERT_TRUE(HeartbeatPage::create(var_, "eps", 2));
  EXPECT_EQ(HeartbeatPage::read(var_, "eps")->end, EndKind::running);
}

TEST_F(HeartbeatPageTest, AFileThatIsNoPageIsNotReadAndIsReplaced) {
  ASSERT_TRUE(HeartbeatPage::create(var_, "adcs", 1));  // creates the folder
  std::ofstream(var_.memory() / "eps.heartbeat") << "short";
  EXPECT_FALSE(HeartbeatPage::read(var_, "eps"));
  EXPECT_TRUE(HeartbeatPage::create(var_, "eps", 1));
  EXPECT_TRUE(HeartbeatPage::read(var_, "eps"));
}

TEST_F(HeartbeatPageTest, IsNotMadeInAFolderThatSomebodyElseMadeFirstNorReadFromThere) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root";
  ASSERT_TRUE(HeartbeatPage::create(var_, "eps", 1));
  ASSERT_EQ(chown(var_.memory().c_str(), 65534, 65534), 0);
  EXPECT_FALSE(HeartbeatPage::read(var_, "eps"));
  const auto page = HeartbeatPage::create(var_, "eps", 2);
  ASSERT_FALSE(page);
  EXPECT_EQ(page.error(), var_.memory().string() + ": belongs to user 65534, so it is not used");
}

TEST_F(HeartbeatPageTest, TwoDeploymentsDoNotShareAPageAndTwoNamesOfOneFolderDo) {
  const VarPaths other{var_.root.string() + "_b"};
  EXPECT_NE(var_.memory(), other.memory());
  EXPECT_EQ(var_.memory(), VarPaths{var_.root / "x" / ".."}.memory());
}

}  // namespace
}  // namespace srfs::suite
