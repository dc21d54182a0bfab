// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Real processes in a ring: a process that dies or hangs is restarted, and no other process is touched.

#include <array>
#include <csignal>
#include <cstdlib>
#include <functional>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "ros/lifecycle.hpp"
#include "suite/command_keys.hpp"
#include "suite/launcher.hpp"
#include "suite/ring/heartbeat_page.hpp"
#include "suite/ring/membership.hpp"
#include "tests/build_kind.hpp"
#include "tests/dds_domain.hpp"

namespace srfs::suite {
namespace {

using testing_support::sanitized;

constexpr seconds patience{60};
const std::array<std::string, 3> names{"a", "b", "c"};

class LivenessRingTest : public testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (std::filesystem::temp_directory_path() / "srfs_ring_XXXXXX").string();
    var_.root = mkdtemp(pattern.data());
    std::string text =
        fmt::format("deployment: ring_test\nring: {{period_ms: {}, worker_deadline_ms: 2000}}\nnodes:\n",
                    sanitized ? 200 : 50);
    for (const auto& name : names)
      text += fmt::format("  - {{name: {}, executable: {}/tests/ring_probe, memory_limit_mib: {}}}\n", name,
                          SRFS_BINARY_DIR, sanitized ? 0 : 1024);
    ASSERT_TRUE(write_file_atomically(var_.root / "d.yaml", text));
    ASSERT_TRUE(
        write_file_atomically(var_.domain_file(), fmt::format("{}\n", testing_support::own_domain())));
    deployment_ = std::make_unique<Deployment>(Deployment::load(var_.root / "d.yaml"));
    ASSERT_TRUE(write_file_atomically(var_.environment_file(), environment_for_nodes()));
  }
  void TearDown() override {
    for (const auto& name : names) EXPECT_FALSE(says(name, "WARNING: ThreadSanitizer"));
    if (HasFailure()) {
      for (const auto& name : names)
        std::fprintf(stderr, "---- %s\n%s\n", name.c_str(), read_file(var_.log(name)).value_or("").c_str());
    }
    ASSERT_TRUE(write_file_atomically(var_.stopping_flag(), ""));
    EXPECT_TRUE(wait([this] {
      bool gone = true;
      for (const auto& name : names) {
        if (find_instance(var_, name)) {
          gone = false;
          signal(name, SIGKILL);
        }
      }
      return gone;
    }));
    std::error_code ec;
    forget_command_keys(var_);
    std::filesystem::remove_all(var_.memory(), ec);
    std::filesystem::remove_all(var_.root, ec);
  }
  static bool wait(const std::function<bool()>& condition) {
    const MonotonicTime end = monotonic_now() + patience;
    while (!condition()) {
      if (monotonic_now() > end) return false;
      usleep(5000);
    }
    return true;
  }
  void start(const std::string& name) {
    ASSERT_TRUE(launch({*deployment_, var_, suite_bin_folder(), "test"}, *deployment_->find(name)));
  }
  void start_all() {
    for (const auto& name : names) start(name);
    ASSERT_TRUE(wait([this] { return all_are_up(); }));
  }
  /// Sends the signal through a pidfd, and only while the process holds its lock.
  void signal(const std::string& name, int number) const {
    const auto instance = find_instance(var_, name);
    if (!instance) return;
    const Fd process(static_cast<int>(syscall(SYS_pidfd_open, instance->pid, 0)));
    const auto again = find_instance(var_, name);
    if (process && again && again->pid == instance->pid)
      syscall(SYS_pidfd_send_signal, process.get(), number, nullptr, 0);
  }
  [[nodiscard]] bool says(const std::string& name, const std::string& text) const {
    return read_file(var_.log(name)).value_or("").find(text) != std::string::npos;
  }
  [[nodiscard]] bool somebody_says(const std::string& text) const {
    return std::any_of(names.begin(), names.end(), [&](const auto& name) { return says(name, text); });
  }
  /// Hangs one thread of a process for good, selected by name.
  static void hang(pid_t pid, const std::string& thread) {
    for (const auto& task : std::filesystem::directory_iterator(fmt::format("/proc/{}/task", pid))) {
      if (read_file(task.path() / "comm").value_or("") != thread + "\n") continue;
      syscall(SYS_tgkill, pid, std::atoi(task.path().filename().c_str()), SIGUSR2);
      return;
    }
  }
  [[nodiscard]] pid_t pid_of(const std::string& name) const {
    const auto instance = find_instance(var_, name);
    return instance ? instance->pid : 0;
  }
  [[nodiscard]] std::uint64_t turns_of(const std::string& name) const {
    const auto page = HeartbeatPage::read(var_, name);
    return page && page->pid == pid_of(name) ? page->turns : 0;
  }
  [[nodiscard]] bool is_up(const std::string& name) const {
    const auto page = HeartbeatPage::read(var_, name);
    return page && page->pid != 0 && page->pid == pid_of(name) && page->turns > 0 &&
           page->state == static_cast<std::uint32_t>(ros::State::active);
  }
  [[nodiscard]] bool all_are_up() const {
    return std::all_of(names.begin(), names.end(), [this](const auto& name) { return is_up(name); });
  }
  [[nodiscard]] std::array<pid_t, 3> pids() const { return {pid_of("a"), pid_of("b"), pid_of("c")}; }
  /// Waits until all nodes have made @p turns more turns, which takes several rounds of checks.
  bool all_turn(std::uint64_t turns) {
    std::array<std::uint64_t, 3> begin{};
    for (std::size_t i = 0; i < names.size(); ++i) begin[i] = turns_of(names[i]);
    return wait([&] {
      for (std::size_t i = 0; i < names.size(); ++i) {
        if (turns_of(names[i]) < begin[i] + turns) return false;
      }
      return true;
    });
  }

  VarPaths var_;
  std::unique_ptr<Deployment> deployment_;
};

TEST_F(LivenessRingTest, RaisesAKilledNode) {
  start_all();
  const auto before = pids();
  signal("b", SIGKILL);
  ASSERT_TRUE(wait([&] { return is_up("b") && pid_of("b") != before[1]; }));
  EXPECT_EQ(pid_of("a"), before[0]);
  EXPECT_EQ(pid_of("c"), before[2]);
}

TEST_F(LivenessRingTest, RestartsAStoppedNodeAndALoopingOne) {
  start_all();
  ASSERT_TRUE(all_turn(50));
  for (const int number : {SIGSTOP, SIGUSR1}) {
    const pid_t before = pid_of("c");
    signal("c", number);
    ASSERT_TRUE(wait([&] { return is_up("c") && pid_of("c") != before; })) << number;
    ASSERT_TRUE(all_turn(50));
  }
}

TEST_F(LivenessRingTest, RestartsANodeWhoseWorkerHangsAndOneWhoseRestarterHangsBeforeItIsNeeded) {
  start_all();
  for (const std::string thread : {"probe", "ring"}) {
    pid_t victim = 0;
    ASSERT_TRUE(wait([&] {
      if (is_up("b") && pid_of("b") != victim) hang(victim = pid_of("b"), thread);
      return somebody_says(fmt::format("worker '{}' busy for", thread));
    })) << thread;
    ASSERT_TRUE(wait([&] { return is_up("b") && pid_of("b") != victim; })) << thread;
  }
}

TEST_F(LivenessRingTest, RestartsANodeThatComesNearItsMemoryCapBeforeTheKernelRefusesIt) {
  if (sanitized) GTEST_SKIP() << "a sanitizer takes more memory than any cap";
  start_all();
  pid_t victim = 0;
  ASSERT_TRUE(wait([&] {
    if (is_up("c") && pid_of("c") != victim) {
      victim = pid_of("c");
      signal("c", SIGHUP);
    }
    return somebody_says("c is too large");
  }));
  ASSERT_TRUE(wait([&] { return is_up("c") && pid_of("c") != victim; }));
}

TEST_F(LivenessRingTest, IsRaisedWholeByTheOneThatLives) {
  start("c");
  ASSERT_TRUE(wait([this] { return all_are_up(); }));
}

TEST_F(LivenessRingTest, DoesNotMindBeingStoppedWhole) {
  start_all();
  ASSERT_TRUE(all_turn(50));
  const auto before = pids();
  for (int i = 0; i < 5; ++i) {
    for (const auto& name : names) signal(name, SIGSTOP);
    usleep(300'000);  // longer than three misses; the kernel guarantees the minimum
    for (const auto& name : names) signal(name, SIGCONT);
    ASSERT_TRUE(all_turn(20));
  }
  EXPECT_EQ(pids(), before);
}

TEST_F(LivenessRingTest, FollowsAMembershipThatIsReplaced) {
  start_all();
  const auto before = pids();
  ASSERT_TRUE(write_membership(var_, {2, {"a", "c"}}));
  ASSERT_TRUE(
      wait([this] { return says("a", "generation 2, 2 members") && says("c", "generation 2, 2 members"); }));
  signal("b", SIGKILL);
  signal("c", SIGKILL);
  ASSERT_TRUE(wait([&] { return is_up("c") && pid_of("c") != before[2]; }));
  EXPECT_EQ(pid_of("b"), 0) << "no member, nobody's to raise";
}

TEST_F(LivenessRingTest, SaysHowItEnded) {
  ASSERT_TRUE(write_membership(var_, {1, {"b"}}));  // no node restarts "a"
  start("a");
  ASSERT_TRUE(wait([this] { return is_up("a"); }));
  signal("a", SIGTERM);
  ASSERT_TRUE(wait([this] { return pid_of("a") == 0; }));
  // The lock becomes free before the page records the end.
  ASSERT_TRUE(wait([this] {
    const auto page = HeartbeatPage::read(var_, "a");
    return page && page->end == EndKind::exit && page->end_value == 0;
  }));
}

}  // namespace
}  // namespace srfs::suite
