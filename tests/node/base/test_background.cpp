// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Threads of real processes that lower their priority, and the effect of a lender on them.

#include "base/background.hpp"

#include <algorithm>
#include <csignal>
#include <memory>

#include <gtest/gtest.h>
#include <poll.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/process.hpp"
#include "tests/signal_child.hpp"

namespace srfs {
namespace {

constexpr uid_t nobody = 65534;

/// A process that leads a new session, runs the given action and then sleeps.
class Sleeper {
 public:
  template <class Action>
  explicit Sleeper(Action&& action) {
    int ready[2];
    if (pipe(ready) != 0) return;
    pid_ = fork();
    if (pid_ == 0) {
      setsid();
      action();
      if (write(ready[1], "", 1) != 1) _exit(1);
      while (true) pause();
    }
    close(ready[1]);
    char octet = 0;
    ready_ = read(ready[0], &octet, 1) == 1;
    close(ready[0]);
  }
  ~Sleeper() {
    testing_support::signal_child(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  Sleeper(const Sleeper&) = delete;
  Sleeper& operator=(const Sleeper&) = delete;

  [[nodiscard]] bool is_ready() const { return ready_; }
  [[nodiscard]] pid_t pid() const { return pid_; }
  [[nodiscard]] int policy() const { return sched_getscheduler(pid_); }
  [[nodiscard]] int niceness() const { return getpriority(PRIO_PROCESS, static_cast<id_t>(pid_)); }

 private:
  pid_t pid_ = -1;
  bool ready_ = false;
};

constexpr rlim_t niceness_0 = 20;  ///< in the units of RLIMIT_NICE

bool may_raise_limits() {
  rlimit limit{};
  getrlimit(RLIMIT_NICE, &limit);
  const rlimit raised{limit.rlim_cur, std::max(limit.rlim_max, niceness_0)};
  return setrlimit(RLIMIT_NICE, &raised) == 0;
}

/// Drops all privileges for good.
void become_nobody(rlim_t limit) {
  const rlimit niceness{limit, limit};
  if (setrlimit(RLIMIT_NICE, &niceness) != 0) _exit(1);
  if (setresuid(nobody, nobody, nobody) != 0) _exit(1);
}

TEST(Background, IsSchedIdleWhereALenderCanTakeItBack) {
  if (geteuid() != 0 || !may_raise_limits()) GTEST_SKIP() << "needs another user and CAP_SYS_RESOURCE";
  const Sleeper sleeper([] {
    become_nobody(niceness_0);
    enter_background();
  });
  ASSERT_TRUE(sleeper.is_ready());
  EXPECT_EQ(sleeper.policy(), SCHED_IDLE);
  EXPECT_TRUE(is_behind_others(sleeper.pid()));
}

TEST(Background, IsANicenessWhereNobodyCouldTakeSchedIdleBack) {
  if (geteuid() != 0) GTEST_SKIP() << "needs another user";
  const Sleeper sleeper([] {
    become_nobody(0);
    enter_background();
  });
  ASSERT_TRUE(sleeper.is_ready());
  EXPECT_EQ(sleeper.policy(), SCHED_OTHER);
  EXPECT_EQ(sleeper.niceness(), background_niceness);
  EXPECT_TRUE(is_behind_others(sleeper.pid()));
}

TEST(CpuLoan, PutsAThreadAndItsSessionBesideOthersAndGivesBothBack) {
  if (geteuid() != 0) GTEST_SKIP() << "needs CAP_SYS_NICE";
  const Sleeper sleeper([] {
    enter_background();
    (void)set_session_niceness(background_niceness);
  });
  ASSERT_TRUE(sleeper.is_ready());
  const auto session = session_niceness(sleeper.pid());
  {
    CpuLoan loan(sleeper.pid());
    EXPECT_EQ(sleeper.policy(), SCHED_IDLE) << "nothing is lent yet";
    loan.lend();
    EXPECT_EQ(sleeper.policy(), SCHED_OTHER);
    EXPECT_EQ(sleeper.niceness(), 0);
    EXPECT_EQ(session_niceness(sleeper.pid()), session ? std::optional(0) : std::nullopt);
    EXPECT_FALSE(is_behind_others(sleeper.pid()));
  }
  EXPECT_EQ(sleeper.policy(), SCHED_IDLE);
  EXPECT_EQ(session_niceness(sleeper.pid()), session);
}

TEST(CpuLoan, LendsAgainToAThreadThatPutItselfBehindDuringTheLoan) {
  if (geteuid() != 0) GTEST_SKIP() << "needs CAP_SYS_NICE";
  const Sleeper sleeper([] { enter_background(); });
  ASSERT_TRUE(sleeper.is_ready());
  {
    CpuLoan loan(sleeper.pid());
    loan.lend();
    const sched_param none{};
    ASSERT_EQ(sched_setscheduler(sleeper.pid(), SCHED_IDLE, &none), 0);
    loan.lend();
    EXPECT_EQ(sleeper.policy(), SCHED_OTHER);
  }
  EXPECT_EQ(sleeper.policy(), SCHED_IDLE);
}

TEST(CpuLoan, OfAFavouredKindGoesBeforeTheOthers) {
  if (geteuid() != 0) GTEST_SKIP() << "needs CAP_SYS_NICE";
  const Sleeper sleeper([] {});
  ASSERT_TRUE(sleeper.is_ready());
  {
    CpuLoan loan(sleeper.pid(), -20);
    loan.lend();
    EXPECT_EQ(sleeper.niceness(), -20);
  }
  EXPECT_EQ(sleeper.niceness(), 0);
}

TEST(CpuLoan, ToAProcessThatHasEndedTouchesNobody) {
  CpuLoan loan(-1);
  loan.lend();
  auto sleeper = std::make_unique<Sleeper>([] { enter_background(); });
  ASSERT_TRUE(sleeper->is_ready());
  CpuLoan other(sleeper->pid());
  other.lend();
  sleeper.reset();
}

TEST(CpuLoan, LeavesARealTimeThreadAsItIs) {
  const Sleeper sleeper([] {
    sched_param priority{};
    priority.sched_priority = 1;
    sched_setscheduler(0, SCHED_FIFO, &priority);
  });
  ASSERT_TRUE(sleeper.is_ready());
  if (sleeper.policy() != SCHED_FIFO) GTEST_SKIP() << "needs a real-time priority";
  CpuLoan loan(sleeper.pid(), -20);
  loan.lend();
  EXPECT_EQ(sleeper.policy(), SCHED_FIFO);
  EXPECT_EQ(sleeper.niceness(), 0);
}

}  // namespace
}  // namespace srfs
