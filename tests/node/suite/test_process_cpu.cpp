// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// CPU readings of a real process: this one, with threads that compute, sleep and wait.

#include "suite/ring/process_cpu.hpp"

#include <atomic>
#include <csignal>
#include <thread>
#include <vector>

#include <gtest/gtest.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

namespace srfs::suite {
namespace {

class Threads {
 public:
  explicit Threads(int count) {
    for (int i = 0; i < count; ++i) {
      threads_.emplace_back([this] {
        while (!end_) {
        }
      });
    }
  }
  ~Threads() {
    end_ = true;
    for (std::thread& thread : threads_) thread.join();
  }
  Threads(const Threads&) = delete;
  Threads& operator=(const Threads&) = delete;

 private:
  std::atomic<bool> end_{false};
  std::vector<std::thread> threads_;
};

TEST(ProcessCpu, CountsThreadsThatComputeAllTheTimeHoweverLittleOfTheCpuTheyGet) {
  auto process = ProcessCpu::open(getpid());
  if (!process) GTEST_SKIP() << "this kernel has no schedstat";
  EXPECT_EQ(process->count_busy_threads(monotonic_now()), 0U);
  const Threads busy(static_cast<int>(2 * std::thread::hardware_concurrency()));
  const MonotonicTime give_up = monotonic_now() + seconds(60);
  std::size_t counted = 0;
  while (counted < 2 * std::thread::hardware_concurrency() && monotonic_now() < give_up) {
    poll(nullptr, 0, 300);
    counted = process->count_busy_threads(monotonic_now());
  }
  EXPECT_EQ(counted, 2 * std::thread::hardware_concurrency()) << "this thread sleeps";
}

TEST(ProcessCpu, CountsNobodyWhoSleepsAndIsEmptyOnceTheProcessHasEnded) {
  const pid_t child = fork();
  if (child == 0) {
    while (true) pause();
  }
  auto process = ProcessCpu::open(child);
  ASSERT_TRUE(process);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(process->count_busy_threads(monotonic_now()), 0U);
  EXPECT_TRUE(process->read(true, monotonic_now()));
  EXPECT_FALSE(process->is_runnable() && process->read(false, monotonic_now())->ran > seconds(1));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  EXPECT_FALSE(process->read(false, monotonic_now())) << "nor is whoever gets its number next";
  EXPECT_FALSE(ProcessCpu::open(child));
}

}  // namespace
}  // namespace srfs::suite
