// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/child_process.hpp"

#include <csignal>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include "tests/build_kind.hpp"

namespace srfs {
namespace {

constexpr auto deadline = seconds(20);

std::string all_output(const ChildProcess& child) {
  std::string text;
  while (true) {
    pollfd entry{child.output(), POLLIN, 0};
    if (poll(&entry, 1, static_cast<int>(milliseconds(deadline).count())) <= 0) return text + " (no end)";
    char buffer[256];
    const ssize_t n = read(child.output(), buffer, sizeof buffer);
    if (n <= 0) return text;
    text.append(buffer, static_cast<std::size_t>(n));
  }
}

TEST(ChildProcessTest, what_it_writes_and_how_it_ends_comes_back) {
  auto child = ChildProcess::start({"/bin/sh", "-c", "echo out; echo err >&2; exit 3"});
  ASSERT_TRUE(child) << child.error();
  EXPECT_EQ(all_output(*child), "out\nerr\n");
  ASSERT_TRUE(child->process().wait_for_exit(deadline));
  const auto end = child->take_end();
  ASSERT_TRUE(end);
  EXPECT_EQ(end->exit_code, 3);
  EXPECT_EQ(to_text(*end), "exit code 3");
  EXPECT_EQ(child->take_end()->exit_code, 3);  // a second call gives the same end
}

TEST(ChildProcessTest, a_signal_is_told_by_its_name) {
  auto child = ChildProcess::start({"/bin/sh", "-c", "kill -SEGV $$"});
  ASSERT_TRUE(child);
  ASSERT_TRUE(child->process().wait_for_exit(deadline));
  EXPECT_EQ(to_text(*child->take_end()), "signal 11 (SIGSEGV)");
}

TEST(ChildProcessTest, a_program_that_is_not_there_is_an_error_that_names_it) {
  if (testing_support::emulated)
    GTEST_SKIP() << "QEMU's vfork is a fork: posix_spawn does not hear of the failure";
  const auto child = ChildProcess::start({"/nowhere/program"});
  ASSERT_FALSE(child);
  EXPECT_THAT(child.error(), testing::HasSubstr("/nowhere/program"));
}

TEST(ChildProcessTest, the_end_of_its_handle_is_the_end_of_the_process) {
  std::optional<Process> process;
  {
    const auto child = ChildProcess::start({"/bin/sleep", "1000"});
    ASSERT_TRUE(child);
    EXPECT_FALSE(child->process().wait_for_exit(milliseconds(0)));
    process = Process::open(child->process().pid());
    ASSERT_TRUE(process);
  }
  EXPECT_TRUE(process->wait_for_exit(milliseconds(0)));
}

TEST(ChildProcessTest, blocked_signals_are_not_inherited) {
  sigset_t blocked;
  sigset_t before;
  sigemptyset(&blocked);
  sigaddset(&blocked, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &blocked, &before);
  auto child = ChildProcess::start({"/bin/sleep", "1000"});
  pthread_sigmask(SIG_SETMASK, &before, nullptr);
  ASSERT_TRUE(child);
  EXPECT_EQ(child->process().signal(SIGTERM), 0);
  ASSERT_TRUE(child->process().wait_for_exit(deadline));
  EXPECT_EQ(child->take_end()->signal, SIGTERM);
}

}  // namespace
}  // namespace srfs
