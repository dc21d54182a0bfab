// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// HolderFence and kill_holder against real processes.

#include <sys/epoll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/action_queue.hpp"
#include "nodes/can_switcher/holder_fence.hpp"
#include "nodes/can_switcher/holder_kill.hpp"
#include "nodes/can_switcher/holder_record.hpp"
#include "ros/executor.hpp"
#include "tests/signal_child.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

using testing::HasSubstr;

/// A child process that only waits. The destructor ends and reaps it.
class Holder {
 public:
  Holder() : pid_(fork()) {
    if (pid_ == 0) {
      for (;;) pause();
    }
  }
  ~Holder() {
    if (!reaped_) testing_support::signal_child(pid_, SIGKILL);
    reap();
  }
  Holder(const Holder&) = delete;
  Holder& operator=(const Holder&) = delete;
  [[nodiscard]] pid_t pid() const { return pid_; }
  /// Reaps the child. @return the signal that ended it
  int reap() {
    if (!reaped_) waitpid(pid_, &status_, 0);
    reaped_ = true;
    return WIFSIGNALED(status_) ? WTERMSIG(status_) : 0;
  }
  /// The owner of the instance lock; nullopt once the process has ended, reaped or not.
  [[nodiscard]] std::optional<pid_t> lock_owner() const {
    siginfo_t info{};
    const bool ended =
        reaped_ || (waitid(P_PID, static_cast<id_t>(pid_), &info, WEXITED | WNOHANG | WNOWAIT) == 0 &&
                    info.si_pid == pid_);
    return ended ? std::nullopt : std::optional(pid_);
  }

 private:
  pid_t pid_;
  int status_ = 0;
  bool reaped_ = false;
};

/// The fence with the kernel's answers, as in CanSwitcherNode.
class HolderFenceTest : public testing::Test {
 protected:
  void fence(nanoseconds wait) {
    fence_.emplace(wait);
    run(fence_->fence("payload_eps", std::nullopt));
  }
  void run(FenceActions actions) {
    actions_.run(std::move(actions), [this](const FenceAction& action) {
      std::visit([this](const auto& a) { carry_out(a); }, action);
    });
  }
  void carry_out(const KillHolder& /*action*/) {
    watch_.reset();
    HolderKill kill = kill_holder(find_, kill_);
    pidfd_ = std::move(kill.pidfd);
    run(fence_->on_killed(kill.is_there, kill.problem));
  }
  void carry_out(const AwaitExit& action) {
    if (pidfd_)
      watch_ = executor_.add_fd(pidfd_.get(), EPOLLIN, [this](std::uint32_t) { run(fence_->on_exit()); });
    timer_ = executor_.add_timer(monotonic_now() + action.wait, nanoseconds(0),
                                 [this] { run(fence_->on_wait_over()); });
  }
  void carry_out(const HolderGone& /*action*/) {
    watch_.reset();
    timer_.reset();
    ++gone_;
  }
  void carry_out(const FenceUnproven& action) { unproven_.push_back(action.why); }
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + seconds(20));
  }

  ros::Executor executor_;
  std::function<std::optional<pid_t>()> find_ = [] { return std::nullopt; };
  std::function<int(int pidfd)> kill_ = send_sigkill;
  std::optional<HolderFence> fence_;
  ActionQueue<FenceAction> actions_;
  Fd pidfd_;
  ros::Executor::Handle watch_;
  ros::Timer timer_;
  int gone_ = 0;
  std::vector<std::string> unproven_;
};

TEST_F(HolderFenceTest, KillsTheHolderAndSaysGoneWhenItHasEnded) {
  Holder holder;
  find_ = [&] { return holder.lock_owner(); };
  fence(seconds(10));
  ASSERT_TRUE(wait([&] { return gone_ == 1; }));
  EXPECT_FALSE(holder.lock_owner().has_value());
  EXPECT_EQ(holder.reap(), SIGKILL);
  EXPECT_TRUE(unproven_.empty());
}

TEST_F(HolderFenceTest, SaysGoneOnlyWhenTheHolderThatCouldNotBeKilledIsGone) {
  Holder holder;
  find_ = [&] { return holder.lock_owner(); };
  bool may_kill = false;
  kill_ = [&](int pidfd) { return may_kill ? send_sigkill(pidfd) : EPERM; };

  fence(milliseconds(5));
  ASSERT_TRUE(wait([&] { return unproven_.size() >= 3; }));
  EXPECT_EQ(gone_, 0) << "it lives and may write";
  EXPECT_THAT(unproven_.back(), HasSubstr("cannot kill"));

  may_kill = true;
  ASSERT_TRUE(wait([&] { return gone_ == 1; }));
  EXPECT_EQ(holder.reap(), SIGKILL);
}

TEST_F(HolderFenceTest, SeesAHolderThatEndsByItselfAfterTheKillFailed) {
  Holder holder;
  find_ = [&] { return holder.lock_owner(); };
  kill_ = [](int) { return EPERM; };
  fence(seconds(30));
  EXPECT_EQ(gone_, 0);

  testing_support::signal_child(holder.pid(), SIGTERM);
  ASSERT_TRUE(wait([&] { return gone_ == 1; }));
}

TEST_F(HolderFenceTest, NeverKillsAStrangerThatGotTheNumber) {
  Holder stranger;
  int asked = 0;
  // The holder ends between the two look-ups, and its pid now belongs to another process.
  find_ = [&]() -> std::optional<pid_t> {
    return asked++ == 0 ? std::optional(stranger.pid()) : std::nullopt;
  };
  fence(seconds(10));
  EXPECT_EQ(gone_, 1);
  EXPECT_TRUE(stranger.lock_owner().has_value());
}

class HolderRecordTest : public testing::Test {
 protected:
  const testing_support::TemporaryFolder temporary_;
  const std::filesystem::path file_ = temporary_.path() / "holder";
};

TEST_F(HolderRecordTest, OutlivesTheProcessThatWasKilled) {
  const pid_t writer = fork();
  if (writer == 0) {
    auto record = HolderRecord::open(file_);
    if (record) record->write(HolderRecord::Holder{2, 0xFFFFFFFF});
    raise(SIGKILL);
  }
  int status = 0;
  waitpid(writer, &status, 0);
  ASSERT_TRUE(WIFSIGNALED(status));

  auto record = HolderRecord::open(file_);
  ASSERT_TRUE(record) << record.error();
  EXPECT_EQ(record->read(), (HolderRecord::Holder{2, 0xFFFFFFFF}));
  record->write(std::nullopt);
  EXPECT_EQ(HolderRecord::open(file_)->read(), std::nullopt);
}

TEST_F(HolderRecordTest, ANewOneSaysThatTheBusIsFree) {
  EXPECT_EQ(HolderRecord::open(file_)->read(), std::nullopt);
}

TEST_F(HolderRecordTest, SaysWhyItCannotBeOpened) {
  const auto record = HolderRecord::open(file_ / "missing" / "folder" / "file");
  ASSERT_FALSE(record);
  EXPECT_THAT(record.error(), HasSubstr("missing"));
}

}  // namespace
}  // namespace srfs
