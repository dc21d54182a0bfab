// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/cpu_wait.hpp"

#include <atomic>
#include <thread>

#include <gtest/gtest.h>
#include <unistd.h>

namespace srfs {
namespace {

MonotonicTime at_ms(std::int64_t ms) {
  return MonotonicTime(milliseconds(1'000'000 + ms));
}
ThreadCpu cpu(std::int64_t ran_ms, std::int64_t waited_ms, std::uint64_t stints) {
  return {milliseconds(ran_ms), milliseconds(waited_ms), stints};
}

TEST(Schedstat, IsReadAsTheKernelWritesIt) {
  EXPECT_EQ(parse_schedstat("51234 3987176 17\n"), (ThreadCpu{nanoseconds(51234), nanoseconds(3987176), 17}));
  EXPECT_EQ(parse_schedstat(""), std::nullopt);
  EXPECT_EQ(parse_schedstat("51234 39"), std::nullopt);
  EXPECT_EQ(parse_schedstat("a b c"), std::nullopt);
}

TEST(CpuWait, IsWhatTheKernelAddsWhenAWaitHasEnded) {
  CpuWait wait;
  wait.on_reading(cpu(100, 1000, 5), false, at_ms(0));
  EXPECT_EQ(wait.total(), nanoseconds(0)) << "what was before is nobody's question";
  wait.on_reading(cpu(110, 1080, 6), false, at_ms(100));
  EXPECT_EQ(wait.total(), milliseconds(80));
}

TEST(CpuWait, GrowsWhileARunnableThreadGetsNoCpuAndCountsNothingTwice) {
  CpuWait wait;
  wait.on_reading(cpu(100, 0, 5), true, at_ms(0));
  wait.on_reading(cpu(100, 0, 5), true, at_ms(100));
  EXPECT_EQ(wait.total(), milliseconds(100));
  wait.on_reading(cpu(100, 0, 5), true, at_ms(2000));
  EXPECT_EQ(wait.total(), milliseconds(2000));
  // The thread runs at last: the kernel adds the whole wait, most of which is already counted.
  wait.on_reading(cpu(104, 2050, 6), false, at_ms(2100));
  EXPECT_EQ(wait.total(), milliseconds(2050));
}

TEST(CpuWait, CountsNothingTwiceWhenAThreadGoesToSleepBetweenItsNumbersAndItsState) {
  CpuWait wait;
  wait.on_reading(cpu(100, 0, 5), true, at_ms(0));
  wait.on_reading(cpu(100, 0, 5), true, at_ms(1000));
  wait.on_reading(cpu(100, 0, 5), false, at_ms(1100));  // ran and fell asleep after the numbers were read
  wait.on_reading(cpu(101, 1090, 6), false, at_ms(1200));
  EXPECT_EQ(wait.total(), milliseconds(1090));
}

TEST(CpuWait, CountsAWaitThatGoesOnFromTheEndOfWhatTheThreadRan) {
  CpuWait wait;
  wait.on_reading(cpu(100, 0, 5), false, at_ms(0));
  wait.on_reading(cpu(110, 40, 7), true, at_ms(2000));
  EXPECT_EQ(wait.total(), milliseconds(1990)) << "it may have waited whenever it did not run";
  wait.on_reading(cpu(110, 40, 7), true, at_ms(2500));
  EXPECT_EQ(wait.total(), milliseconds(2490));
  wait.on_reading(cpu(120, 2580, 8), false, at_ms(2600));
  EXPECT_EQ(wait.total(), milliseconds(2580)) << "and nothing twice";
}

TEST(CpuWait, LeavesOutATimeThatNobodyWatched) {
  CpuWait wait;
  wait.on_reading(cpu(100, 0, 5), true, at_ms(0));
  wait.on_reading(cpu(100, 0, 5), true, at_ms(100));
  wait.skip_to(cpu(900, 60'000, 700), at_ms(600'000));
  EXPECT_EQ(wait.total(), milliseconds(100));
  wait.on_reading(cpu(901, 60'030, 701), false, at_ms(600'100));
  EXPECT_EQ(wait.total(), milliseconds(130));
}

TEST(CpuWait, IsNoneOfAThreadThatSleepsBlocksOrIsStopped) {
  CpuWait wait;
  for (int i = 0; i < 50; ++i) wait.on_reading(cpu(100, 7, 5), false, at_ms(100 * i));
  EXPECT_EQ(wait.total(), nanoseconds(0));
}

TEST(CpuWait, IsNoneOfAThreadThatRunsInALoop) {
  CpuWait wait;
  for (int i = 0; i < 50; ++i) wait.on_reading(cpu(100 + 100 * i, 7, 5), true, at_ms(100 * i));
  EXPECT_EQ(wait.total(), nanoseconds(0));
}

TEST(CpuWait, TakesTwoReadingsWithinOneTickOfARunningThreadForNoWait) {
  CpuWait wait;
  wait.on_reading(cpu(100, 7, 5), true, at_ms(0));
  wait.on_reading(cpu(100, 7, 5), true, at_ms(4));
  wait.on_reading(cpu(104, 7, 5), true, at_ms(8));
  EXPECT_EQ(wait.total(), nanoseconds(0));
}

TEST(CpuHistory, LeavesOutWhatWasWaitedSinceATimeAndNeverMoreThanThatTime) {
  CpuHistory history;
  EXPECT_EQ(history.since(at_ms(0)).waited, nanoseconds(0));
  for (int i = 0; i <= 10; ++i)
    history.add(at_ms(100 * i), {milliseconds(50 * i), milliseconds(10 * i), milliseconds(90 * i)});
  EXPECT_EQ(history.since(at_ms(800)).waited, milliseconds(100));
  EXPECT_EQ(history.since(at_ms(800)).ran, milliseconds(10)) << "rounded down";
  EXPECT_EQ(history.since(at_ms(800)).any_waited, milliseconds(180));
  EXPECT_EQ(history.since(at_ms(990)).any_waited, milliseconds(10)) << "not more than 10 ms in 10 ms";
  EXPECT_EQ(history.since(at_ms(-500)).waited, milliseconds(500)) << "known from the first point on";
}

TEST(CpuHistory, RemembersLongTimesMoreRoughly) {
  CpuHistory history;
  for (int i = 0; i < 100'000; ++i)
    history.add(at_ms(100 * i), {milliseconds(50 * i), nanoseconds(0), milliseconds(50 * i)});
  EXPECT_EQ(history.since(at_ms(9'999'000)).waited, milliseconds(450)) << "the last seconds exactly";
  for (const std::int64_t s : {10, 60, 600, 6000}) {
    const double waited =
        static_cast<double>(history.since(at_ms(9'999'900 - 1000 * s)).waited.count()) / 1e9;
    EXPECT_GE(waited, 0.5 * static_cast<double>(s)) << "rounded up";
    EXPECT_LE(waited, static_cast<double>(s));
  }
}

TEST(StolenTime, IsThatOfTheCpuThatLostMost) {
  StolenTime stolen;
  EXPECT_EQ(stolen.on_reading(
                "cpu  9 9 9 9 9 9 9 30 0 0\ncpu0 1 1 1 1 1 1 1 10 0 0\ncpu1 1 1 1 1 1 1 1 20 0 0\nintr 1"),
            nanoseconds(0));
  EXPECT_EQ(stolen.on_reading(
                "cpu  9 9 9 9 9 9 9 38 0 0\ncpu0 1 1 1 1 1 1 1 13 0 0\ncpu1 1 1 1 1 1 1 1 25 0 0\nintr 1"),
            milliseconds(50));
  EXPECT_EQ(stolen.on_reading("cpu  9 9 9 9 9 9 9 39 0 0\ncpu0 1 1 1 1 1 1 1 14 0 0\nintr 1"),
            milliseconds(60))
      << "a CPU was taken out";
  EXPECT_EQ(stolen.on_reading("cpu  9 9 9 9 9 9 9 39 0 0\ncpu0 1 1 1 1 1 1 1 99"), milliseconds(60)) << "cut";
  EXPECT_EQ(stolen.on_reading("cpu0 1 1 1\n"), milliseconds(60)) << "a kernel that does not tell";
  EXPECT_EQ(stolen.on_reading(""), milliseconds(60));
}

TEST(StolenTime, KnowsCpusByTheirNumberWhenAnotherGoesOffline) {
  StolenTime stolen;
  (void)stolen.on_reading(
      "cpu0 1 1 1 1 1 1 1 10 0 0\ncpu1 1 1 1 1 1 1 1 20 0 0\ncpu2 1 1 1 1 1 1 1 900 0 0\n");
  EXPECT_EQ(stolen.on_reading("cpu0 1 1 1 1 1 1 1 10 0 0\ncpu2 1 1 1 1 1 1 1 900 0 0\n"), nanoseconds(0));
  EXPECT_EQ(
      stolen.on_reading("cpu0 1 1 1 1 1 1 1 10 0 0\ncpu1 1 1 1 1 1 1 1 20 0 0\ncpu2 1 1 1 1 1 1 1 901 0 0\n"),
      milliseconds(10))
      << "it is back";
  EXPECT_EQ(stolen.on_reading("cpu99999999 1 1 1 1 1 1 1 10 0 0\n"), milliseconds(10)) << "no such CPU";
}

TEST(Schedstat, OfAKernelThatWritesZerosIsNotCounted) {
  EXPECT_TRUE(is_counted({milliseconds(8), milliseconds(2), 12}));
  EXPECT_FALSE(is_counted({}));
}

/// Needs a separate process, because the code checks the kernel only once.
TEST(ThreadCpuFilesDeathTest, TheKernelIsKnownToCountAlsoWhenAThreadAsksThatHasJustBegun) {
  if (access("/proc/self/schedstat", R_OK) != 0) GTEST_SKIP() << "this kernel has no schedstat";
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto ask_from_a_new_thread = [] {
    bool counts = false;
    std::thread([&] { counts = ThreadCpuFiles::open_own().has_value(); }).join();
    _exit(counts ? 0 : 1);
  };
  EXPECT_EXIT(ask_from_a_new_thread(), testing::ExitedWithCode(0), "");
}

TEST(ThreadCpuFiles, TellARunningThreadFromOneThatHasEnded) {
  const auto own = ThreadCpuFiles::open_own();
  if (!own) GTEST_SKIP() << "this kernel has no schedstat";
  EXPECT_EQ(own->state(), 'R');
  const auto before = own->read();
  std::uint64_t sum = 0;
  while (own->read()->ran - before->ran < milliseconds(20)) sum = sum + 1;  // running, so its time grows
  EXPECT_GT(sum, 0U);

  std::optional<ThreadCpuFiles> others;
  std::thread thread([&] { others = ThreadCpuFiles::open_own(); });
  thread.join();
  ASSERT_TRUE(others);
  // The kernel lets join() return a little before the thread is gone from /proc.
  while (others->read()) std::this_thread::yield();
  EXPECT_EQ(others->read(), std::nullopt) << "whoever gets its number later is not read";
  EXPECT_EQ(others->state(), std::nullopt);
  EXPECT_EQ(ThreadCpuFiles::open(getpid(), 0x3FFFFFFF), std::nullopt);
}

}  // namespace
}  // namespace srfs
