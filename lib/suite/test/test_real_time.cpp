// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <sched.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "suite/real_time.hpp"
#include "tests/build_kind.hpp"

namespace srfs::suite {
namespace {

using testing::HasSubstr;

long kib_of(const std::string& key) {
  std::ifstream status("/proc/self/status");
  for (std::string word; status >> word;) {
    long kib = 0;
    if (word == key && status >> kib) return kib;
  }
  return -1;
}

/// Runs @p work in a separate process, so that its locks and limits end with it.
template <class Work>
int exit_code_of(const Work& work) {
  const pid_t child = fork();
  if (child == 0) _exit(work());
  int status = 0;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(RefusalToLock, ALimitIsRefusedWithTheCommandThatMendsItUnlessACapabilityMakesUpForIt) {
  EXPECT_EQ(refusal_to_lock(false, RLIM_INFINITY, "sat"), std::nullopt);
  EXPECT_EQ(refusal_to_lock(true, 0, "sat"), std::nullopt);
  const auto refusal = refusal_to_lock(false, 8U << 20, "sat");
  ASSERT_TRUE(refusal);
  EXPECT_THAT(*refusal, HasSubstr("user sat may lock 8192 KiB"));
  EXPECT_THAT(*refusal, HasSubstr("echo 'sat - memlock unlimited' >> /etc/security/limits.d/60-srfs.conf"));
}

TEST(LockedMemory, HoldsWhatIsLoadedOrSaysWhyNotAndHoldsNothing) {
  if (testing_support::sanitized) GTEST_SKIP() << "sanitizers answer mlockall without doing it";
  EXPECT_EQ(exit_code_of([] {
              const auto locked = lock_memory();
              const long held = kib_of("VmLck:");
              return locked ? (held > 1024 ? 0 : 1) : (!locked.error().empty() && held == 0 ? 0 : 2);
            }),
            0);
}

TEST(LockedMemory, StacksOfLaterThreadsCostWhatTheyUse) {
  if (testing_support::sanitized) GTEST_SKIP() << "sanitizers answer mlockall without doing it";
  EXPECT_EQ(exit_code_of([] {
              if (!lock_memory()) return 0;  // no permission here
              const long before = kib_of("VmRSS:");
              constexpr std::size_t octets = 64U << 20;
              const auto stack = std::make_unique_for_overwrite<char[]>(octets);  // mapped like a stack
              const_cast<volatile char*>(stack.get())[0] = 1;
              return kib_of("VmRSS:") - before < 1024 ? 0 : 1;
            }),
            0);
}

TEST(TouchedStack, IsGivenBeforeItIsNeeded) {
  if (testing_support::emulated) GTEST_SKIP() << "the kernel sees the emulator's stack";
  EXPECT_EQ(exit_code_of([] {
              const long before = kib_of("VmStk:");
              touch_stack(2U << 20);
              return kib_of("VmStk:") - before >= 1024 ? 0 : 1;
            }),
            0);
}

TEST(TouchedStack, IsNeverMoreThanHalfOfWhatTheLimitAllows) {
  EXPECT_EQ(exit_code_of([] {
              const rlimit narrow{1U << 20, 1U << 20};
              if (setrlimit(RLIMIT_STACK, &narrow) != 0) return 1;
              touch_stack(64U << 20);
              return 0;
            }),
            0);
}

/// Uses CPU time without a pause, for so long.
void compute(milliseconds how_long) {
  const auto begun = std::clock();
  while (std::clock() - begun < how_long.count() * CLOCKS_PER_SEC / 1000) {
  }
}

TEST(RealTimeBound, LeavesAProcessAloneWhoseLauncherSetNone) {
  EXPECT_EQ(exit_code_of([] {
              rlimit limit{};
              getrlimit(RLIMIT_RTTIME, &limit);
              limit.rlim_cur = limit.rlim_max;
              if (setrlimit(RLIMIT_RTTIME, &limit) != 0 || limit.rlim_max != RLIM_INFINITY) return 0;
              bound_real_time(real_time_at_work);
              getrlimit(RLIMIT_RTTIME, &limit);
              return limit.rlim_cur == RLIM_INFINITY ? 0 : 1;
            }),
            0);
}

TEST(RealTimeBound, EndsAThreadThatNeverPausesAndCountsNothingFromBefore) {
  const auto computes_at_work = [](milliseconds how_long) {
    rlimit limit{};
    getrlimit(RLIMIT_RTTIME, &limit);
    limit.rlim_cur = std::min<rlim_t>(30'000'000, limit.rlim_max);  // the launcher's limit
    const sched_param priority{.sched_priority = 1};
    if (setrlimit(RLIMIT_RTTIME, &limit) != 0 || sched_setscheduler(0, SCHED_FIFO, &priority) != 0) _exit(7);
    compute(milliseconds(800));  // as when reading the dictionary
    bound_real_time(real_time_at_work);
    compute(how_long);
    return 0;
  };
  const int well = exit_code_of([&] { return computes_at_work(milliseconds(50)); });
  if (well == 7) GTEST_SKIP() << "no permission for SCHED_FIFO";
  EXPECT_EQ(well, 0);
  EXPECT_EQ(exit_code_of([&] { return computes_at_work(milliseconds(2000)); }), -1) << "not ended";
}

TEST(MissingScheduling, IsNamedOneByOne) {
  EXPECT_EQ(exit_code_of([] {
              Scheduling wanted;
              if (nice(1) == -1) return 1;  // nice value at least 1 from here on
              wanted.nice = getpriority(PRIO_PROCESS, 0);
              if (!missing_of(wanted).empty()) return 2;
              wanted.nice -= 1;
              wanted.cpus = {1023};
              const auto missing = missing_of(wanted);
              if (missing.size() != 2) return 3;
              return missing[0].starts_with("nice") && missing[1] == "CPU set" ? 0 : 4;
            }),
            0);
}

}  // namespace
}  // namespace srfs::suite
