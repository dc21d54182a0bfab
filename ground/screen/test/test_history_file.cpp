// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/screen/history_file.hpp"

#include <fstream>
#include <thread>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>

#include "base/fd.hpp"
#include "ground/screen/line_editor.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::ground::screen {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class History : public ::testing::Test {
 protected:
  testing_support::TemporaryFolder folder_;
  std::filesystem::path file_ = folder_.path() / "console_history";
  HistoryFile history_{file_};
};

TEST_F(History, HasTheLinesOfAllConsolesInTheirOrder) {
  const HistoryFile other(file_);
  EXPECT_THAT(history_.lines().value(), ElementsAre());
  ASSERT_TRUE(history_.add("ping"));
  ASSERT_TRUE(other.add("stats"));
  EXPECT_THAT(history_.add("clcw").value(), ElementsAre("ping", "stats", "clcw"));
  EXPECT_THAT(other.add("files").value(), ElementsAre("ping", "stats", "clcw", "files"));
  EXPECT_THAT(HistoryFile(file_).lines().value(), ElementsAre("ping", "stats", "clcw", "files"));
}

TEST_F(History, LosesNoLineOfConsolesThatAddAtTheSameTime) {
  constexpr int lines = 20;
  const auto add = [this](const std::string& console) {
    const HistoryFile own(file_);
    for (int i = 0; i < lines; ++i) ASSERT_TRUE(own.add(console + std::to_string(i)));
  };
  std::thread first([&add] { add("a"); });
  std::thread second([&add] { add("b"); });
  first.join();
  second.join();

  const auto all = history_.lines().value();
  EXPECT_EQ(all.size(), 2U * lines);
  for (const std::string console : {"a", "b"}) {
    std::vector<std::string> own;
    for (const auto& line : all)
      if (line.starts_with(console)) own.push_back(line);
    for (int i = 0; i < lines; ++i)
      EXPECT_EQ(own.at(static_cast<std::size_t>(i)), console + std::to_string(i));
  }
}

TEST_F(History, HasNoBlankLinesAndNoLineTwiceInARow) {
  for (const char* line : {"ping", "", "  ", "ping", "stats", "ping"}) ASSERT_TRUE(history_.add(line));
  EXPECT_THAT(history_.lines().value(), ElementsAre("ping", "stats", "ping"));
}

TEST_F(History, ForgetsTheOldestLines) {
  for (std::size_t i = 0; i < LineEditor::history_max; ++i)
    std::ofstream(file_, std::ios::app) << "line " << i << "\n";
  const auto lines = history_.add("newest").value();
  EXPECT_EQ(lines.size(), LineEditor::history_max);
  EXPECT_EQ(lines.front(), "line 1");
  EXPECT_EQ(lines.back(), "newest");

  for (int i = 0; i < 200; ++i)
    std::ofstream(file_, std::ios::app)
        << std::string(4 * LineEditor::line_max, static_cast<char>('a' + i % 26)) << "\n";
  ASSERT_TRUE(history_.add("newest"));
  EXPECT_LE(std::filesystem::file_size(file_), HistoryFile::octets_max);
  EXPECT_EQ(history_.lines().value().back(), "newest");
}

TEST_F(History, OfAConsoleThatIsStoppedIsNotWaitedForLong) {
  const Fd held(::open((file_.string() + ".lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  ASSERT_EQ(::flock(held.get(), LOCK_EX), 0);
  const auto added = history_.add("ping");
  ASSERT_FALSE(added);
  EXPECT_THAT(added.error(), HasSubstr("another console holds it"));
}

}  // namespace
}  // namespace srfs::ground::screen
