// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// HolderFence against real processes.

#include <sys/epoll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "nodes/can_switcher/holder_fence.hpp"
#include "nodes/can_switcher/holder_record.hpp"
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

class HolderFenceTest : public testing::Test {
 protected:
  HolderFence::Hooks hooks() {
    HolderFence::Hooks h;
    h.find = [this](const std::string&) { return find_(); };
    h.watch = [this](int fd, std::function<void()> readable) {
      return executor_.add_fd(fd, EPOLLIN, [f = std::move(readable)](std::uint32_t) { f(); });
    };
    h.after = [this](nanoseconds delay, std::function<void()> due) {
      return executor_.add_timer(monotonic_now() + delay, nanoseconds(0), std::move(due));
    };
    return h;
  }
  void fence(HolderFence& fence) {
    fence.fence("payload_eps", {.gone = [this] { ++gone_; },
                                .unproven = [this](const std::string& why) { unproven_.push_back(why); }});
  }
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + seconds(20));
  }

  ros::Executor executor_;
  std::function<std::optional<pid_t>()> find_ = [] { return std::nullopt; };
  int gone_ = 0;
  std::vector<std::string> unproven_;
};

TEST_F(HolderFenceTest, SaysGoneAtOnceWhenNoSuchProcessRuns) {
  HolderFence holder_fence(hooks(), seconds(10));
  fence(holder_fence);
  EXPECT_EQ(gone_, 1);
  EXPECT_FALSE(holder_fence.busy());
}

TEST_F(HolderFenceTest, KillsTheHolderAndSaysGoneWhenItHasEnded) {
  Holder holder;
  find_ = [&] { return holder.lock_owner(); };
  HolderFence holder_fence(hooks(), seconds(10));
  fence(holder_fence);
  ASSERT_TRUE(wait([&] { return gone_ == 1; }));
  EXPECT_FALSE(holder.lock_owner().has_value());
  EXPECT_EQ(holder.reap(), SIGKILL);
  EXPECT_TRUE(unproven_.empty());
}

TEST_F(HolderFenceTest, SaysGoneOnlyWhenTheHolderThatCouldNotBeKilledIsGone) {
  Holder holder;
  find_ = [&] { return holder.lock_owner(); };
  HolderFence::Hooks refused = hooks();
  bool may_kill = false;
  refused.kill = [&](int pidfd) { return may_kill ? HolderFence::send_sigkill(pidfd) : EPERM; };
  HolderFence holder_fence(std::move(refused), milliseconds(5));

  fence(holder_fence);
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
  HolderFence::Hooks refused = hooks();
  refused.kill = [](int) { return EPERM; };
  HolderFence holder_fence(std::move(refused), seconds(30));
  fence(holder_fence);
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
  HolderFence holder_fence(hooks(), seconds(10));
  fence(holder_fence);
  EXPECT_EQ(gone_, 1);
  EXPECT_TRUE(stranger.lock_owner().has_value());
}

TEST(HolderIdentity, ASuccessorIsInnocentEvenBeforeItHasSaidItsNumber) {
  EXPECT_TRUE(is_holder(7, 7));
  EXPECT_TRUE(is_holder(6, 7));
  EXPECT_FALSE(is_holder(8, 7));
  EXPECT_FALSE(is_holder(0, 7));
  EXPECT_TRUE(is_holder(7, std::nullopt));
  EXPECT_TRUE(is_holder(0, std::nullopt));
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
  const auto record = HolderRecord::open(file_ / "missing" / "file");
  ASSERT_FALSE(record);
  EXPECT_THAT(record.error(), HasSubstr("missing"));
}

}  // namespace
}  // namespace srfs
