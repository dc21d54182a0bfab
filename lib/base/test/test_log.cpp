// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The log output when there are too many messages, and when no process reads it.

#include <cstdlib>
#include <string>
#include <vector>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/log.hpp"
#include "base/log_limit.hpp"
#include "base/log_output.hpp"

namespace srfs::log {
namespace {

using testing::ElementsAre;
using testing::EndsWith;
using testing::HasSubstr;

constexpr Site here{"a.cpp", 1};
constexpr Site there{"b.cpp", 2};

MonotonicTime at(milliseconds t) {
  return MonotonicTime(seconds(1000) + t);
}

int written_of(RateLimit& limit, Site site, int lines, MonotonicTime now) {
  int written = 0;
  for (int i = 0; i < lines; ++i) written += limit.on_line(site, now).write ? 1 : 0;
  return written;
}

TEST(LogRateLimit, LetsABurstThroughAndThenOneASecond) {
  RateLimit limit;
  EXPECT_EQ(written_of(limit, here, 100, at(milliseconds(0))), 10);
  EXPECT_EQ(written_of(limit, here, 100, at(milliseconds(999))), 0);
  EXPECT_EQ(written_of(limit, here, 100, at(milliseconds(1000))), 1);
  EXPECT_EQ(limit.held_back(), 90U + 100U + 99U);
}

TEST(LogRateLimit, TellsWithTheNextLineHowManyWereHeldBack) {
  RateLimit limit;
  written_of(limit, here, 30, at(milliseconds(0)));
  const auto verdict = limit.on_line(here, at(milliseconds(1000)));
  EXPECT_TRUE(verdict.write);
  EXPECT_EQ(verdict.held_back, 20U);
  EXPECT_EQ(limit.on_line(here, at(milliseconds(2000))).held_back, 0U);
}

TEST(LogRateLimit, TellsOfASiteThatBecameQuietWhenItWouldBeOpenAgain) {
  RateLimit limit;
  written_of(limit, here, 12, at(milliseconds(0)));
  EXPECT_FALSE(limit.take_due(at(milliseconds(500))));
  const auto due = limit.take_due(at(milliseconds(1000)));
  ASSERT_TRUE(due);
  EXPECT_EQ(due->site, here);
  EXPECT_EQ(due->held_back, 2U);
  EXPECT_FALSE(limit.take_due(at(milliseconds(9000))));
}

TEST(LogRateLimit, OneSiteDoesNotSilenceAnother) {
  RateLimit limit;
  written_of(limit, here, 1000, at(milliseconds(0)));
  EXPECT_TRUE(limit.on_line(there, at(milliseconds(0))).write);
}

TEST(LogRateLimit, AllSitesTogetherAreBoundedToo) {
  RateLimit limit;
  int written = 0;
  for (std::uint32_t site = 0; site < 1000; ++site)
    written += written_of(limit, {"c.cpp", site}, 5, at(milliseconds(0)));
  EXPECT_EQ(written, RateLimit::all_burst);
  EXPECT_EQ(limit.held_back(), 5000U - RateLimit::all_burst);
}

TEST(LogRateLimit, MoreSitesThanItRemembersLoseNoCount) {
  RateLimit limit;
  std::uint64_t told = 0;
  for (std::uint32_t site = 0; site < 5000; ++site)
    written_of(limit, {"c.cpp", site}, 20, at(milliseconds(0)));
  for (int s = 1; s < 300; ++s) {
    while (const auto due = limit.take_due(at(seconds(s)))) told += due->held_back;
  }
  EXPECT_EQ(told + limit.forgotten(), limit.held_back());
}

struct Pipe {
  Fd read_end;
  Fd write_end;
  Pipe() {
    int ends[2] = {-1, -1};
    EXPECT_EQ(pipe2(ends, O_CLOEXEC), 0);
    read_end = Fd(ends[0]);
    write_end = Fd(ends[1]);
    EXPECT_EQ(fcntl(read_end.get(), F_SETFL, O_NONBLOCK), 0);
  }
  std::string drain() const {
    std::string all;
    char chunk[4096];
    ssize_t n = 0;
    while ((n = ::read(read_end.get(), chunk, sizeof chunk)) > 0)
      all.append(chunk, static_cast<std::size_t>(n));
    return all;
  }
};

// An alarm ends the test program if a write blocks after all.
TEST(LogOutput, AFullPipeLosesLinesInsteadOfBlockingAndTakesThemAgainWhenRead) {
  alarm(30);
  const Pipe pipe;
  Output output(pipe.write_end.get());
  const std::string line = std::string(199, 'x') + "\n";
  int taken = 0;
  while (output.write(line)) ++taken;
  EXPECT_GT(taken, 100);
  EXPECT_FALSE(output.write(line));
  EXPECT_EQ(output.lost(), 2U);
  EXPECT_EQ(fcntl(pipe.write_end.get(), F_GETFL) & O_NONBLOCK, 0) << "others share the descriptor";

  EXPECT_EQ(pipe.drain().size(), static_cast<std::size_t>(taken) * line.size()) << "whole lines only";
  EXPECT_TRUE(output.write(line));
  alarm(0);
}

TEST(LogOutput, AFullSocketLosesLinesAndNeverJoinsTwo) {
  alarm(30);
  int ends[2] = {-1, -1};
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends), 0);
  const Fd reader(ends[0]);
  const Fd writer(ends[1]);
  Output output(writer.get());
  while (output.write("a line\n")) {
  }
  EXPECT_GE(output.lost(), 1U);
  ASSERT_EQ(fcntl(reader.get(), F_SETFL, O_NONBLOCK), 0);
  std::string all;
  char chunk[4096];
  ssize_t n = 0;
  while ((n = ::read(reader.get(), chunk, sizeof chunk)) > 0) all.append(chunk, static_cast<std::size_t>(n));
  EXPECT_TRUE(output.write("the next\n"));
  n = ::read(reader.get(), chunk, sizeof chunk);
  all.append(chunk, static_cast<std::size_t>(n));
  EXPECT_THAT(all, EndsWith("\nthe next\n"));
  alarm(0);
}

TEST(LogOutput, ADescriptorThatIsClosedLosesEverything) {
  Output output(-1);
  EXPECT_FALSE(output.write("x\n"));
  EXPECT_EQ(output.lost(), 1U);
}

TEST(LogOutput, KnowsTheJournalByTheNameSystemdGivesIts) {
  const Pipe pipe;
  struct stat info {};
  ASSERT_EQ(fstat(pipe.write_end.get(), &info), 0);
  setenv("JOURNAL_STREAM", fmt::format("{}:{}", info.st_dev, info.st_ino).c_str(), 1);
  EXPECT_TRUE(Output(pipe.write_end.get()).is_journal());
  setenv("JOURNAL_STREAM", "1:2", 1);
  EXPECT_FALSE(Output(pipe.write_end.get()).is_journal());
  unsetenv("JOURNAL_STREAM");
  EXPECT_FALSE(Output(pipe.write_end.get()).is_journal());
}

/// Redirects the program's stderr into a pipe during the test.
class LogLines : public testing::Test {
 protected:
  void SetUp() override {
    kept_ = Fd(dup(STDERR_FILENO));
    ASSERT_GE(dup2(pipe_.write_end.get(), STDERR_FILENO), 0);
    set_sink([this](const Record& r) {
      sunk_.emplace_back(r.text);
      line_ = r.where.line();
    });
  }
  void TearDown() override {
    set_sink({});
    set_level(Severity::info);
    dup2(kept_.get(), STDERR_FILENO);
    unsetenv("JOURNAL_STREAM");
  }
  Pipe pipe_;
  Fd kept_;
  std::vector<std::string> sunk_;
  std::uint32_t line_ = 0;
};

TEST_F(LogLines, CarryTimeSeverityNameAndTextAndGoToTheSinkWithTheirPlace) {
  set_name("probe");
  const std::uint32_t line = __LINE__ + 1;
  warn("{} of {}", 3, "four");
  EXPECT_THAT(pipe_.drain(), testing::MatchesRegex("20..-..-..T..:..:......Z WARN  .probe. 3 of four\n"));
  EXPECT_THAT(sunk_, ElementsAre("3 of four"));
  EXPECT_EQ(line_, line);
}

TEST_F(LogLines, StartWithTheSyslogLevelWhenTheJournalReadsThem) {
  struct stat info {};
  ASSERT_EQ(fstat(pipe_.write_end.get(), &info), 0);
  setenv("JOURNAL_STREAM", fmt::format("{}:{}", info.st_dev, info.st_ino).c_str(), 1);
  set_name("probe");
  error("no bus");
  EXPECT_EQ(pipe_.drain(), "<3>[probe] no bus\n");
}

TEST_F(LogLines, BelowTheLevelAreNotWrittenAndFatalAlwaysIs) {
  debug("hidden");
  set_level(Severity::fatal);
  error("hidden too");
  fatal("seen");
  set_level(Severity::debug);
  debug("seen too");
  EXPECT_THAT(sunk_, ElementsAre("seen", "seen too"));
}

TEST_F(LogLines, AreSuppressedPerCallSiteAndTheirNumberIsTold) {
  const std::uint64_t before = losses().held_back;
  for (int i = 0; i < 25; ++i) info("again {}", i);
  EXPECT_EQ(sunk_.size(), 10U);
  EXPECT_EQ(losses().held_back - before, 15U);
  info("another place speaks");
  EXPECT_EQ(sunk_.back(), "another place speaks");
}

TEST_F(LogLines, AreCutAtTheirLongest) {
  info("{}", std::string(5000, 'y'));
  ASSERT_EQ(sunk_.size(), 1U);
  EXPECT_EQ(sunk_[0].size(), longest_text);
  EXPECT_THAT(pipe_.drain(), EndsWith("yyy\n"));
}

TEST_F(LogLines, LostOnesAreCountedAndToldWhenStderrTakesThemAgain) {
  alarm(30);
  const std::string filler(4096, '.');
  ASSERT_EQ(fcntl(pipe_.write_end.get(), F_SETFL, O_NONBLOCK), 0);
  while (::write(pipe_.write_end.get(), filler.data(), filler.size()) > 0) {
  }
  ASSERT_EQ(fcntl(pipe_.write_end.get(), F_SETFL, 0), 0);
  const std::uint64_t before = losses().lost;
  info("nobody reads this");
  EXPECT_EQ(losses().lost, before + 1);
  EXPECT_THAT(sunk_, ElementsAre("nobody reads this")) << "the sink is another way out";

  pipe_.drain();
  info("somebody reads again");
  EXPECT_THAT(pipe_.drain(),
              testing::AllOf(HasSubstr("1 log lines lost"), HasSubstr("somebody reads again")));
  alarm(0);
}

TEST(LogSeverity, HasTheNamesOfRos2) {
  for (const auto s : {Severity::debug, Severity::info, Severity::warn, Severity::error, Severity::fatal})
    EXPECT_EQ(severity_of(to_text(s)), s);
  EXPECT_FALSE(severity_of("loud"));
}

}  // namespace
}  // namespace srfs::log
