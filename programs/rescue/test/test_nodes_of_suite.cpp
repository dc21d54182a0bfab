// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/rescue/nodes_of_suite.hpp"

#include <array>

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "tests/signal_child.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::rescue {
namespace {

/// A process with the command line of a node, which holds no lock. It lives until it is killed.
class LoadingNode {
 public:
  explicit LoadingNode(const std::filesystem::path& var) {
    std::array<int, 2> started{};
    EXPECT_EQ(pipe2(started.data(), O_CLOEXEC), 0);
    const Fd read_end(started[0]);
    Fd write_end(started[1]);
    pid_ = fork();
    if (pid_ == 0) {
      std::array<int, 2> endless{};
      if (pipe(endless.data()) != 0 || dup2(endless[0], STDIN_FILENO) < 0) _exit(1);
      execl("/bin/sh", "sh", "-c", "read x", "node", "--name", "ttc", "--deployment", "d.yaml", "--var",
            var.c_str(), nullptr);
      _exit(1);
    }
    write_end.reset();
    char none = 0;
    EXPECT_EQ(read(read_end.get(), &none, 1), 0) << "closed by exec";
  }
  LoadingNode(const LoadingNode&) = delete;
  LoadingNode& operator=(const LoadingNode&) = delete;
  ~LoadingNode() {
    if (pid_ < 0) return;
    testing_support::signal_child(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }
  [[nodiscard]] bool was_killed() {
    int status = 0;
    const bool ended = waitpid(pid_, &status, WNOHANG) == pid_;
    if (ended) pid_ = -1;
    return ended && WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL;
  }

 private:
  pid_t pid_ = -1;
};

TEST(NodesOfTheSuite, ANodeThatIsStillBeingLoadedIsEnded) {
  const testing_support::TemporaryFolder folder;
  std::filesystem::create_directories(folder.path() / "var/run");
  LoadingNode node(folder.path() / "var");
  LoadingNode of_another_suite(folder.path() / "other");

  EXPECT_TRUE(end_suite(folder.path() / "var"));

  EXPECT_TRUE(node.was_killed());
  EXPECT_FALSE(of_another_suite.was_killed());
  EXPECT_TRUE(std::filesystem::exists(folder.path() / "var/run/stopping")) << "no starter makes another one";
}

TEST(NodesOfTheSuite, OneThatRunsIsSeenWhereItsLockCannotBeWritten) {
  const testing_support::TemporaryFolder folder;
  const auto var = folder.path() / "var";
  std::filesystem::create_directories(var / "run");
  const auto file = var / "run/ttc.lock";
  const Fd node(open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  for (const auto& path : {folder.path(), var, var / "run", file})
    std::filesystem::permissions(path, std::filesystem::perms{path == file ? 0444U : 0755U});
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;
  ASSERT_EQ(fcntl(node.get(), F_SETLK, &lock), 0);

  const pid_t reader = fork();
  if (reader == 0) {
    constexpr uid_t nobody = 65534;  // root may write everything
    if (geteuid() == 0 && setuid(nobody) != 0) _exit(2);
    if (open(file.c_str(), O_RDWR | O_CLOEXEC) >= 0) _exit(3);
    _exit(suite_runs(var) ? 0 : 1);
  }
  int status = -1;
  ASSERT_EQ(waitpid(reader, &status, 0), reader);
  EXPECT_EQ(status, 0) << "1: not seen; 2, 3: the lock could be written";
}

}  // namespace
}  // namespace srfs::rescue
