// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// A node runs in the same environment, whichever process started it.

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <sstream>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/time.hpp"
#include "suite/launcher.hpp"
#include "tests/signal_child.hpp"
#include "tests/var_folder.hpp"

namespace srfs::suite {
namespace {

/// Properties that a process inherits from its starter, by name.
using Setting = std::map<std::string, std::string>;

std::string text_of(const std::filesystem::path& path) {
  return read_file(path).value_or("unreadable");
}

/// Field of /proc/PID/stat, numbered from 1 as in proc(5).
std::string stat_field(const std::string& stat, int number) {
  std::istringstream in(stat.substr(stat.rfind(')') + 2));
  std::string field;
  for (int i = 3; i <= number; ++i) in >> field;
  return field;
}

/// sched_runtime of sched_getattr(2), in ns.
std::string turn_of(pid_t pid) {
  std::array<std::uint64_t, 6> attributes{};
  EXPECT_EQ(syscall(SYS_sched_getattr, pid, attributes.data(), sizeof attributes, 0), 0);
  return std::to_string(attributes[3]);
}

Setting setting_of(pid_t pid) {
  const std::filesystem::path proc = "/proc/" + std::to_string(pid);
  Setting s;
  for (const char* file : {"limits", "environ", "oom_score_adj", "timerslack_ns", "personality"})
    s[file] = text_of(proc / file);
  s["cwd"] = std::filesystem::read_symlink(proc / "cwd").string();
  std::istringstream status(text_of(proc / "status"));
  for (std::string line; std::getline(status, line);) {
    const std::string key = line.substr(0, line.find(':'));
    for (const char* wanted : {"Umask", "Uid", "Gid", "Groups", "SigBlk", "SigIgn", "SigCgt", "CapEff",
                               "NoNewPrivs", "Cpus_allowed_list", "Mems_allowed_list", "THP_enabled"}) {
      if (key == wanted) s[key] = line;
    }
  }
  const std::string stat = text_of(proc / "stat");
  s["nice"] = stat_field(stat, 19);
  const std::string session = text_of(proc / "autogroup");  // "/autogroup-12 nice 10"
  s["nice of its session"] = session.empty() ? "" : session.substr(session.find("nice"));
  s["rt priority"] = stat_field(stat, 40);
  s["policy"] = stat_field(stat, 41);
  s["turn"] = turn_of(pid);
  s["leads its session"] = stat_field(stat, 6) == std::to_string(pid) ? "yes" : "no";
  s["terminal"] = stat_field(stat, 7);
  s["io priority"] = std::to_string(syscall(SYS_ioprio_get, 1, pid));
  for (const auto& fd : std::filesystem::directory_iterator(proc / "fd"))
    s["fd " + fd.path().filename().string()] = std::filesystem::read_symlink(fd.path()).string();
  // Mask out the signals that the probe blocks itself: whether they show depends on whether it waits for
  // them.
  constexpr unsigned long own = (1UL << (SIGUSR1 - 1)) | (1UL << (SIGTERM - 1));
  s["SigBlk"] = std::to_string(std::stoul(s["SigBlk"].substr(8), nullptr, 16) & ~own);
  return s;
}

class Launching : public testing::Test {
 protected:
  void SetUp() override {
    const std::string probe = SRFS_BINARY_DIR "/bin/launch_probe";
    ASSERT_TRUE(write_file_atomically(folder_ / "d.yaml",
                                      "deployment: t\nnodes:\n"
                                      "  - { name: plain, executable: " +
                                          probe +
                                          " }\n"
                                          "  - { name: urgent, executable: " +
                                          probe +
                                          ", oom_score_adj: 100,\n"
                                          "      scheduling: { policy: fifo, priority: 20, cpus: [0] } }\n"
                                          "  - { name: humble, executable: " +
                                          probe +
                                          ", memory_limit_mib: 128, oom_score_adj: 300,\n"
                                          "      scheduling: { policy: batch, nice: 10 } }\n"));
    plan_ = Deployment::load(folder_ / "d.yaml");
  }
  void TearDown() override {
    for (const NodeEntry& node : plan_.nodes) end(node.name);
    std::filesystem::remove_all(var().memory());
  }
  [[nodiscard]] LaunchRequest request() const { return {plan_, var(), "/nowhere", "up"}; }
  [[nodiscard]] VarPaths var() const { return VarPaths{folder_ / "var"}; }

  /// Waits until the probe has reported that it runs.
  [[nodiscard]] pid_t running(const std::string& node) const {
    const MonotonicTime deadline = monotonic_now() + seconds(20);
    while (monotonic_now() < deadline) {
      const auto instance = find_instance(var(), node);
      if (instance && instance->incarnation == 1) return instance->pid;
      poll(nullptr, 0, 2);
    }
    ADD_FAILURE() << node << " did not come up";
    return -1;
  }
  void end(const std::string& node) const {
    const auto instance = find_instance(var(), node);
    if (!instance) return;
    testing_support::signal_child(instance->pid, SIGTERM);
    const MonotonicTime deadline = monotonic_now() + seconds(20);
    while (find_instance(var(), node) && monotonic_now() < deadline) poll(nullptr, 0, 2);
  }
  Setting started_by_this_process(const std::string& node) {
    const auto pid = launch(request(), *plan_.find(node));
    EXPECT_TRUE(pid) << pid.error();
    const Setting s = setting_of(running(node));
    end(node);
    return s;
  }
  /// Starts @p node from a process that has first applied @p odd to itself.
  Setting started_by(const std::function<void()>& odd, const std::string& node) {
    const pid_t child = fork();
    if (child == 0) {
      odd();
      _exit(launch(request(), *plan_.find(node)) ? 0 : 1);
    }
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
    const Setting s = setting_of(running(node));
    end(node);
    return s;
  }
  /// Starts @p node from the running probe @p starter.
  Setting started_by_node(const std::string& starter, const std::string& node) {
    const auto pid = launch(request(), *plan_.find(starter));
    EXPECT_TRUE(pid) << pid.error();
    const pid_t by = running(starter);
    EXPECT_TRUE(write_file_atomically(var().run() / "start_next", node));
    testing_support::signal_child(by, SIGUSR1);
    const Setting s = setting_of(running(node));
    end(node);
    end(starter);
    return s;
  }

  const testing_support::VarFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  Deployment plan_;
};

void expect_same(const Setting& expected, const Setting& got, const std::string& what) {
  for (const auto& [key, value] : expected) {
    const auto found = got.find(key);
    EXPECT_EQ(found == got.end() ? "missing" : found->second, value) << what << ": " << key;
  }
  for (const auto& [key, value] : got)
    EXPECT_TRUE(expected.contains(key)) << what << ": " << key << " is " << value;
}

/// Whether this process has CAP_SYS_RESOURCE; without it no process can raise a lowered hard limit again.
bool may_raise_hard_limits() {
  const pid_t child = fork();
  if (child == 0) {
    const rlimit low{1000, 1000};
    const rlimit open{1000, RLIM_INFINITY};
    _exit(setrlimit(RLIMIT_CPU, &low) == 0 && setrlimit(RLIMIT_CPU, &open) == 0 ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return status == 0;
}

void lower_limit(__rlimit_resource resource, rlim_t value, bool hard_too) {
  rlimit now{};
  getrlimit(resource, &now);
  const rlimit lowered{value, hard_too ? value : now.rlim_max};
  setrlimit(resource, &lowered);
}

TEST_F(Launching, GivesTheSameSettingWhateverTheStarterDidToItself) {
  const bool hard = may_raise_hard_limits();
  const auto odd = [hard] {
    lower_limit(RLIMIT_NOFILE, 200, hard);
    lower_limit(RLIMIT_STACK, 1 << 20, hard);
    lower_limit(RLIMIT_DATA, 1 << 30, hard);
    lower_limit(RLIMIT_FSIZE, 1 << 28, hard);
    lower_limit(RLIMIT_CPU, 1000, hard);
    lower_limit(RLIMIT_MEMLOCK, 1 << 16, hard);
    umask(077);
    setenv("FOO", "bar", 1);
    setenv("PATH", "/odd", 1);
    setenv("LD_PRELOAD", "", 1);
    if (chdir("/tmp") != 0) _exit(2);
    for (const int s : {SIGUSR1, SIGTERM, SIGINT, SIGHUP, SIGCHLD}) signal(s, SIG_IGN);
    sigset_t set;
    sigfillset(&set);
    sigprocmask(SIG_BLOCK, &set, nullptr);
    cpu_set_t one;
    CPU_ZERO(&one);
    CPU_SET(0, &one);
    sched_setaffinity(0, sizeof one, &one);
    prctl(PR_SET_TIMERSLACK, 1'000'000'000, 0, 0, 0);
    prctl(PR_SET_THP_DISABLE, 1, 0, 0, 0);
    (void)open("/dev/zero", O_RDONLY);  // not close-on-exec
    if (geteuid() != 0) return;         // only a privileged process can undo the rest
    setpriority(PRIO_PROCESS, 0, 7);
    syscall(SYS_ioprio_set, 1, 0, (3 << 13) | 4);  // idle class
    const sched_param none{};
    sched_setscheduler(0, SCHED_BATCH | SCHED_RESET_ON_FORK, &none);
    if (FILE* f = fopen("/proc/self/oom_score_adj", "w")) {
      fputs("555", f);
      fclose(f);
    }
  };
  for (const NodeEntry& node : plan_.nodes) {
    const Setting expected = started_by_this_process(node.name);
    expect_same(expected, started_by(odd, node.name), node.name + " by an odd starter");
  }
}

TEST_F(Launching, GivesTheSameSettingWhicheverNodeStartsTheOther) {
  for (const NodeEntry& node : plan_.nodes) {
    const Setting expected = started_by_this_process(node.name);
    for (const NodeEntry& starter : plan_.nodes) {
      if (starter.name == node.name) continue;
      expect_same(expected, started_by_node(starter.name, node.name), node.name + " by " + starter.name);
    }
  }
}

TEST_F(Launching, SetsWhatTheDeploymentSays) {
  const Setting plain = started_by_this_process("plain");
  EXPECT_EQ(plain.at("policy"), std::to_string(SCHED_OTHER));
  EXPECT_EQ(plain.at("cwd"), "/");
  EXPECT_THAT(plain.at("Umask"), testing::EndsWith("0022"));
  EXPECT_EQ(plain.at("leads its session"), "yes");
  EXPECT_EQ(plain.at("fd 0"), "/dev/null");
  EXPECT_THAT(plain.at("limits"), testing::ContainsRegex("Max data size +unlimited"));

  const Setting humble = started_by_this_process("humble");
  EXPECT_EQ(humble.at("policy"), std::to_string(SCHED_BATCH));
  EXPECT_EQ(humble.at("nice"), "10");
  EXPECT_THAT(humble.at("nice of its session"), testing::AnyOf("nice -10\n", "nice 10\n", ""))
      << "that of a start, its own without the permission, nothing where sessions are no groups";
  EXPECT_EQ(humble.at("oom_score_adj"), "300\n");
  EXPECT_THAT(humble.at("limits"), testing::ContainsRegex("Max data size +134217728"));
  EXPECT_THAT(humble.at("limits"), testing::ContainsRegex("Max realtime timeout +unlimited"));

  const Setting urgent = started_by_this_process("urgent");
  EXPECT_THAT(urgent.at("Cpus_allowed_list"), testing::EndsWith("\t0"));
  EXPECT_THAT(urgent.at("limits"), testing::ContainsRegex("Max realtime timeout +30000000"));
}

TEST_F(Launching, TakesTheTestToolsVariablesFromTheSuiteNotFromTheStarter) {
  ASSERT_TRUE(write_file_atomically(var().environment_file(),
                                    "SRFS_MISSION_DIR=/somewhere\nEVIL=1\nLD_PRELOAD=/x.so\n"
                                    "LD_LIBRARY_PATH=/written_by_a_node\n"));
  setenv("LD_LIBRARY_PATH", "/starter", 1);
  const std::string environment = started_by_this_process("plain").at("environ");
  unsetenv("LD_LIBRARY_PATH");
  EXPECT_THAT(environment, testing::HasSubstr("SRFS_MISSION_DIR=/somewhere"));
  EXPECT_THAT(environment, testing::Not(testing::HasSubstr("EVIL")));
  EXPECT_THAT(environment, testing::Not(testing::HasSubstr("PRELOAD")));
  EXPECT_THAT(environment, testing::Not(testing::HasSubstr("LD_LIBRARY_PATH")));
}

TEST_F(Launching, RunsANodeAsTheUserTheDeploymentNames) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root";
  plan_.nodes[0].user = "nobody";
  // VAR belongs to the nodes' user; root makes what it makes there for that user.
  std::filesystem::create_directories(var().root);
  ASSERT_EQ(chmod(folder_.c_str(), 0755), 0);
  ASSERT_EQ(chown(var().root.c_str(), 65534, 65534), 0);
  const Setting s = started_by_this_process("plain");
  EXPECT_THAT(s.at("Uid"), testing::ContainsRegex("65534\t65534\t65534\t65534"));
  EXPECT_THAT(s.at("CapEff"), testing::EndsWith("0000000000000000"));
}

TEST_F(Launching, SaysWhyAUserCannotBe) {
  plan_.nodes[0].user = "no_such_user";
  const auto started = launch(request(), plan_.nodes[0]);
  ASSERT_FALSE(started);
  EXPECT_EQ(started.error(), "there is no user 'no_such_user'");
}

}  // namespace
}  // namespace srfs::suite
