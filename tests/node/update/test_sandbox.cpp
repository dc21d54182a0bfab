// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Really confined processes. Each test runs twice: with namespaces and with the minimum confinement. Tests
// that need root are skipped for other users.

#include <fcntl.h>
#include <linux/keyctl.h>
#include <netinet/in.h>
#include <sched.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>
#include <thread>

#include <gtest/gtest.h>

#include "base/file.hpp"
#include "base/process.hpp"
#include "tests/build_kind.hpp"
#include "tests/temporary_folder.hpp"
#include "update/control_group.hpp"
#include "update/sandbox.hpp"

namespace srfs::update {
namespace {

namespace fs = std::filesystem;

constexpr uid_t user_of_tests = 64043;

/// Processes of the sandbox' user anywhere on this computer.
int processes_of_user() {
  int count = 0;
  std::error_code ec;
  for (const auto& entry : fs::directory_iterator("/proc", ec)) {
    struct stat status {};
    const pid_t pid = std::atoi(entry.path().filename().c_str());
    if (pid == 0 || stat(entry.path().c_str(), &status) != 0 || status.st_uid != user_of_tests) continue;
    // A zombie only waits for its parent.
    if (process_state(pid).value_or('Z') != 'Z') ++count;
  }
  return count;
}

bool control_groups_left() {
  for (const char* folder : {"/sys/fs/cgroup", "/sys/fs/cgroup/memory", "/sys/fs/cgroup/pids"}) {
    std::error_code ec;
    for (const auto& entry : fs::directory_iterator(folder, ec))
      if (entry.path().filename().string().starts_with("srfs_lane." + std::to_string(getpid()) + "."))
        return true;
  }
  return false;
}

class SandboxTest : public testing::TestWithParam<bool> {
 protected:
  SandboxTest() {
    confinement_.namespaces = GetParam();
    confinement_.user = confinement_.group = user_of_tests;
    confinement_.limits.wall = seconds(20);
    confinement_.limits.cpu = seconds(10);
    confinement_.limits.work_octets = 4U << 20;
    confinement_.limits.memory_octets = 256U << 20;
    confinement_.limits.files = 512;
    confinement_.limits.lowest_priority = false;  // the machine may be busy
    // Without a separate file-system view the confined user needs access to this path.
    fs::permissions(folder_.path(), fs::perms(0755));
  }

  Result<Ended, SandboxFailure> try_run(const std::function<int()>& program) {
    const auto work = WorkFolder::make(folder_.path() / "work", confinement_);
    EXPECT_TRUE(work) << work.error();
    return run_confined(confinement_, *work, program,
                        {.output = [this](std::string_view text) { output_ += text; },
                         .log = [this](std::string_view text) { output_ += text; },
                         .cancel_fd = cancel_fd_});
  }
  Ended run(const std::function<int()>& program) {
    const auto ended = try_run(program);
    EXPECT_TRUE(ended) << ended.error().message;
    EXPECT_EQ(processes_of_user(), 0);
    EXPECT_FALSE(control_groups_left());
    EXPECT_FALSE(fs::exists(folder_.path() / "work"));
    return ended ? *ended : Ended{};
  }
  static bool in_force(const Ended& ended, Layer layer) {
    return (ended.layers.in_force & set_of({layer})).any();
  }

  testing_support::TemporaryFolder folder_;
  Confinement confinement_;
  std::string output_;
  int cancel_fd_ = -1;
};

TEST_P(SandboxTest, TellsExitCodeSignalAndOutput) {
  EXPECT_EQ(run([] { return printf("hello\n") > 0 ? 7 : 1; }).exit_code, 7);
  EXPECT_EQ(output_, "hello\n");
  EXPECT_EQ(run([] { return raise(SIGSEGV); }).signal, SIGSEGV);
}

TEST_P(SandboxTest, RunsAnotherProgramInAnEmptyEnvironment) {
  setenv("SECRET", "x", 1);
  const fs::path work = folder_.path() / "work";
  EXPECT_EQ(run([&] { return execute({"/bin/sh", "-c", "pwd; set"}, work); }).exit_code, 0);
  EXPECT_TRUE(output_.starts_with(work.string() + "\n")) << output_;
  EXPECT_EQ(output_.find("SECRET"), std::string::npos);
  EXPECT_EQ(run([&] { return execute({"/no/such"}, work); }).exit_code, 127);
}

TEST_P(SandboxTest, AsRootAllLayersOfItsKindAreInForce) {
  if (geteuid() != 0) GTEST_SKIP() << "not root";
  const Ended ended = run([] { return 0; });
  for (const Layer layer : {Layer::user, Layer::system_calls, Layer::limits})
    EXPECT_TRUE(in_force(ended, layer)) << to_text(layer);
  EXPECT_EQ(in_force(ended, Layer::priority), confinement_.limits.lowest_priority);
  if (!GetParam()) {
    for (const Layer layer : {Layer::processes, Layer::network, Layer::ipc, Layer::quota})
      EXPECT_FALSE(in_force(ended, layer));
    EXPECT_GE(ended.layers.failures.size(), 4U);
  }
}

TEST_P(SandboxTest, WithoutARequiredLayerNothingIsRun) {
  if (GetParam()) GTEST_SKIP() << "they are there";
  confinement_.required = set_of({Layer::processes, Layer::limits});
  const auto ended = try_run([] { return 0; });
  ASSERT_FALSE(ended);
  EXPECT_EQ(ended.error().message, "required but not available: processes");
}

TEST_P(SandboxTest, AnEndlessLoopEndsWithTheTimeOrTheCpu) {
  const auto endless = [] {
    while (true) {
      (void)getppid();
    }
    return 0;
  };
  confinement_.limits.wall = seconds(1);
  EXPECT_EQ(run(endless).stop, Ended::Stop::wall_time);
  confinement_.limits.wall = seconds(60);
  confinement_.limits.cpu = seconds(1);
  const Ended ended = run(endless);
  EXPECT_EQ(ended.signal, SIGXCPU);
  EXPECT_GE(ended.cpu_s, 0.5);  // the limit counts in ticks, this value is exact
}

TEST_P(SandboxTest, AnAllocationBombGetsNoFurtherThanItsLimit) {
  if (testing_support::sanitized) GTEST_SKIP() << "sanitizers map more than any limit";
  confinement_.limits.memory_octets = 64U << 20;
  const Ended ended = run([] {
    for (int i = 0; i < 1024; ++i) {
      void* const block = mmap(nullptr, 1U << 20, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
      if (block == MAP_FAILED) return 5;
      memset(block, 1, 1U << 20);
    }
    return 0;
  });
  EXPECT_TRUE(ended.exit_code == 5 || ended.signal == SIGKILL);
  EXPECT_LT(ended.peak_octets, 128U << 20);
}

TEST_P(SandboxTest, AForkBombIsHeldAndNothingOfItIsLeft) {
  if (geteuid() != 0) GTEST_SKIP() << "not root";
  confinement_.limits.wall = seconds(2);
  confinement_.limits.processes = 16;
  const Ended ended = run([] {
    while (geteuid() == user_of_tests) {
      if (fork() == 0) setsid();
    }
    return 0;
  });
  // On a busy machine the memory of refused processes is freed so late that the memory limit ends the bomb
  // first.
  const bool by_memory = ended.stop == Ended::Stop::none && ended.signal == SIGKILL && ended.out_of_memory;
  EXPECT_TRUE(ended.stop == Ended::Stop::wall_time || by_memory) << "signal " << ended.signal;
  if (in_force(ended, Layer::process_count)) {
    EXPECT_TRUE(ended.too_many_processes);
  }
}

TEST_P(SandboxTest, WhatItLeavesBehindEndsWithIt) {
  if (geteuid() != 0) GTEST_SKIP() << "not root";
  const Ended ended = run([] {
    for (int i = 0; i < 3; ++i) {
      if (fork() != 0) continue;
      setsid();
      if (fork() != 0) _exit(0);
      while (true) pause();
    }
    return 0;
  });
  EXPECT_EQ(ended.exit_code, 0);
}

TEST_P(SandboxTest, ItWritesNowhereButInItsFolder) {
  const std::string outside = folder_.path() / "outside";
  const Ended ended = run([&] {
    const int flags = O_WRONLY | O_CREAT | O_CLOEXEC;
    if (open("mine", flags, 0644) < 0) return 1;
    for (const std::string& path :
         {outside, std::string("/etc/srfs_test"), std::string("/usr/srfs_test"), std::string("/srfs_test"),
          std::string("/var/tmp/srfs_test"), std::string("/dev/srfs_test")})
      if (open(path.c_str(), flags, 0644) >= 0) return 2;
    return chmod("/usr", 0777) == 0 ? 3 : 0;
  });
  if (in_force(ended, Layer::files)) {
    EXPECT_EQ(ended.exit_code, 0);
  }
}

TEST_P(SandboxTest, ItReadsNeitherKeysNorShadow) {
  const fs::path key = folder_.path() / "var/keys/link";
  ASSERT_TRUE(write_file_atomically(key, "secret"));  // readable by every user
  const Ended ended = run([&] {
    for (const std::string& path : {key.string(), std::string("/etc/shadow"), std::string("/root/.profile")})
      if (open(path.c_str(), O_RDONLY) >= 0) return 1;
    return 0;
  });
  if (in_force(ended, Layer::files)) {
    EXPECT_EQ(ended.exit_code, 0);
  }
}

TEST_P(SandboxTest, ItHasNoSocketsAndNoRareSystemCalls) {
  const Ended ended = run([] {
    for (const int family : {AF_INET, AF_INET6, AF_UNIX, AF_NETLINK, AF_PACKET, AF_CAN})
      if (socket(family, SOCK_DGRAM, 0) >= 0 || errno != EACCES) return 1;
    if (ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) == 0) return 2;
    if (mount("none", "/", "tmpfs", 0, nullptr) == 0 || unshare(CLONE_NEWUSER) == 0) return 3;
    if (syscall(SYS_keyctl, KEYCTL_GET_KEYRING_ID, -3, 0) >= 0 || syscall(SYS_bpf, 0, nullptr, 0) >= 0)
      return 4;
    if (syscall(SYS_clone, CLONE_NEWUSER | SIGCHLD, nullptr, nullptr, nullptr, nullptr) >= 0) return 5;
    return 0;
  });
  EXPECT_EQ(ended.exit_code, 0);
}

#if defined(__x86_64__)
TEST_P(SandboxTest, ACallOfAnotherArchitectureKillsIt) {
  constexpr long x32 = 0x4000'0000;
  EXPECT_EQ(run([] { return syscall(x32 | SYS_getpid) > 0 ? 1 : 2; }).signal, SIGSYS);
  const Ended ended = run([] {
    long result = 20;  // getpid of i386
    asm volatile("int $0x80" : "+a"(result) : : "memory");
    return result > 0 ? 1 : 2;
  });
  // SIGSEGV: this kernel has no i386.
  EXPECT_TRUE(ended.signal == SIGSYS || ended.signal == SIGSEGV) << ended.signal;
}
#endif

TEST_P(SandboxTest, ItsLoopbackIsItsOwn) {
  confinement_.network = true;
  const Ended ended = run([] {
    const int receiver = socket(AF_INET, SOCK_DGRAM, 0);
    sockaddr_in address{
        .sin_family = AF_INET, .sin_port = 0, .sin_addr = {.s_addr = htonl(INADDR_LOOPBACK)}, .sin_zero = {}};
    socklen_t size = sizeof address;
    if (receiver < 0 || bind(receiver, reinterpret_cast<sockaddr*>(&address), size) != 0) return 1;
    getsockname(receiver, reinterpret_cast<sockaddr*>(&address), &size);
    if (sendto(receiver, "x", 1, 0, reinterpret_cast<sockaddr*>(&address), size) != 1) return 2;
    char octet = 0;
    return recv(receiver, &octet, 1, 0) == 1 ? 0 : 3;
  });
  EXPECT_EQ(ended.exit_code, 0);
  if (!in_force(ended, Layer::network)) return;
  const Ended far = run([] {
    const int sender = socket(AF_INET, SOCK_DGRAM, 0);
    const sockaddr_in far_away{.sin_family = AF_INET,
                               .sin_port = htons(9),
                               .sin_addr = {.s_addr = htonl(0xc0000201)},
                               .sin_zero = {}};
    return sendto(sender, "x", 1, 0, reinterpret_cast<const sockaddr*>(&far_away), sizeof far_away) < 0 ? 0
                                                                                                        : 1;
  });
  EXPECT_EQ(far.exit_code, 0);
}

TEST_P(SandboxTest, ItReachesNoSocketOfTheSuite) {
  const std::string path = folder_.path() / "suite";
  const Fd listening(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof address.sun_path - 1);
  ASSERT_EQ(bind(listening.get(), reinterpret_cast<sockaddr*>(&address), sizeof address), 0);
  ASSERT_EQ(listen(listening.get(), 4), 0);
  chmod(path.c_str(), 0777);
  confinement_.network = true;
  const Ended ended = run([&] {
    const int s = socket(AF_UNIX, SOCK_STREAM, 0);
    return s >= 0 && connect(s, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 ? 1 : 0;
  });
  EXPECT_EQ(ended.exit_code, 0);
}

TEST_P(SandboxTest, ItCanKillNobodyElse) {
  if (geteuid() != 0) GTEST_SKIP() << "not root";
  const Ended ended = run([] {
    // Signal 0 only tests the permission, so the test is harmless if the confinement fails.
    for (int pid = 1; pid < 70000; ++pid)
      if (pid != getpid() && kill(pid, 0) == 0) return 1;
    return 0;
  });
  EXPECT_EQ(ended.exit_code, 0);
}

TEST_P(SandboxTest, ItsFolderTakesNoMoreThanTheQuota) {
  const Ended files = run([] {
    for (int i = 0; i < 1'000'000; ++i) close(open(std::to_string(i).c_str(), O_WRONLY | O_CREAT, 0644));
    while (true) pause();
    return 0;
  });
  EXPECT_EQ(files.stop, Ended::Stop::quota);

  const Ended octets = run([] {
    const std::string block(1U << 16, 'x');
    const int file = open("big", O_WRONLY | O_CREAT, 0644);
    while (write(file, block.data(), block.size()) > 0) {
    }
    while (true) pause();
    return 0;
  });
  EXPECT_EQ(octets.stop, Ended::Stop::quota);

  confinement_.limits.file_octets = 1U << 20;
  const Ended file = run([] {
    const std::string block(1U << 16, 'x');
    const int big = open("big", O_WRONLY | O_CREAT, 0644);
    for (int i = 0; i < 32; ++i) (void)!write(big, block.data(), block.size());
    return 0;
  });
  EXPECT_EQ(file.signal, SIGXFSZ);
}

TEST_P(SandboxTest, FoldersNestedWithoutEndAreRemoved) {
  const Ended ended = run([] {
    for (int i = 0; i < 1'000'000; ++i)
      if (mkdir("d", 0755) != 0 || chdir("d") != 0) break;
    while (true) pause();
    return 0;
  });
  EXPECT_EQ(ended.stop, Ended::Stop::quota);
}

TEST_P(SandboxTest, ItLeavesNoCoreAndInheritsNothing) {
  const Fd inherited(open("/dev/null", O_RDWR));  // not close-on-exec
  const Ended ended = run([] {
    for (int fd = 3; fd < 1024; ++fd)
      if (fcntl(fd, F_GETFD) >= 0) return 1;
    const pid_t child = fork();
    if (child == 0) abort();
    int status = 0;
    waitpid(child, &status, 0);
    return WIFSIGNALED(status) && !WCOREDUMP(status) ? 0 : 2;
  });
  EXPECT_EQ(ended.exit_code, 0);
}

TEST_P(SandboxTest, ItStaysAtTheLowestPriority) {
  confinement_.limits.lowest_priority = true;
  const Ended ended = run([] {
    if (sched_getscheduler(0) != SCHED_IDLE || getpriority(PRIO_PROCESS, 0) != 19) return 1;
    char session[64] = {};
    const Fd group(open("/proc/self/autogroup", O_RDONLY | O_CLOEXEC));
    if (group && read(group.get(), session, sizeof session - 1) > 0 && strstr(session, "nice 19") == nullptr)
      return 3;
    const sched_param normal{};
    return sched_setscheduler(0, SCHED_OTHER, &normal) == 0 || setpriority(PRIO_PROCESS, 0, 0) == 0 ? 2 : 0;
  });
  if (geteuid() == 0) {
    EXPECT_EQ(ended.exit_code, 0);
  }
}

TEST_P(SandboxTest, ItEndsWhenItIsCancelled) {
  const Fd cancel(eventfd(1, EFD_CLOEXEC));
  cancel_fd_ = cancel.get();
  EXPECT_EQ(run([] { return pause(); }).stop, Ended::Stop::cancelled);
}

TEST_P(SandboxTest, ItEndsWhenItsCallerIsKilled) {
  if (geteuid() != 0) GTEST_SKIP() << "not root";
  int begun[2];
  ASSERT_EQ(pipe2(begun, O_CLOEXEC), 0);
  ASSERT_EQ(prctl(PR_SET_CHILD_SUBREAPER, 1), 0);
  const pid_t caller = fork();
  if (caller == 0) {
    const auto work = WorkFolder::make(folder_.path() / "work", confinement_);
    (void)run_confined(
        confinement_, *work,
        [] {
          for (int i = 0; i < 3; ++i)
            if (fork() == 0) setsid();
          printf("begun\n");
          fflush(stdout);
          return pause();
        },
        {.output = [&](std::string_view) { (void)!write(begun[1], "x", 1); }, .log = {}, .cancel_fd = -1});
    _exit(0);
  }
  char octet = 0;
  EXPECT_EQ(read(begun[0], &octet, 1), 1);
  kill(caller, SIGKILL);
  // What is left of it comes to this process, its keeper last: that one kills as the tests' user.
  const MonotonicTime deadline = monotonic_now() + seconds(10);
  pid_t ended = 0;
  while ((ended = waitpid(-1, nullptr, WNOHANG)) >= 0 && monotonic_now() < deadline)
    std::this_thread::yield();
  EXPECT_EQ(ended, -1) << "still there";
  EXPECT_EQ(processes_of_user(), 0);
  prctl(PR_SET_CHILD_SUBREAPER, 0);
  ControlGroup::remove_abandoned();
}

TEST_P(SandboxTest, WhatItLeftIsTakenOnlyAsAnOrdinaryFile) {
  const auto work = WorkFolder::make(folder_.path() / "work", confinement_);
  ASSERT_TRUE(work);
  ASSERT_FALSE(work->put("in/text", "given"));
  const auto ended = run_confined(confinement_, *work,
                                  [] {
                                    (void)!symlink("/etc/passwd", "link");
                                    (void)mkfifo("fifo", 0644);
                                    std::ofstream("file") << std::ifstream("in/text").rdbuf();
                                    return 0;
                                  },
                                  {});
  ASSERT_TRUE(ended);
  EXPECT_FALSE(work->take("link", 100));
  EXPECT_FALSE(work->take("fifo", 100));
  EXPECT_FALSE(work->take("file", 4));
  const auto file = work->take("file", 5);
  ASSERT_TRUE(file);
  char text[5];
  EXPECT_EQ(read(file->get(), text, 5), 5);
  EXPECT_EQ(std::string(text, 5), "given");
}

INSTANTIATE_TEST_SUITE_P(Each, SandboxTest, testing::Bool(), [](const auto& kind) {
  return std::string(kind.param ? "WithNamespaces" : "OnTheFloor");
});

}  // namespace
}  // namespace srfs::update
