// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <barrier>
#include <filesystem>
#include <mutex>
#include <sstream>
#include <thread>

#include <arpa/inet.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <pwd.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/fd.hpp"
#include "base/private_file.hpp"
#include "suite/instance.hpp"
#include "suite/launcher.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::suite {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

mode_t mode_of(const std::filesystem::path& path) {
  struct stat status {};
  EXPECT_EQ(lstat(path.c_str(), &status), 0) << path;
  return status.st_mode & 07777U;
}

TEST(VarPaths, OfAFolderAreTheSameByWhateverPathItIsNamed) {
  const testing_support::TemporaryFolder folder;
  const std::filesystem::path real = std::filesystem::canonical(folder.path()) / "var";
  EXPECT_EQ(VarPaths::at(real / "").root, real) << "before the folder exists";
  std::filesystem::create_directory(real);
  std::filesystem::create_directory_symlink(real, folder.path() / "link");
  for (const std::filesystem::path& name :
       {real, real / "", folder.path() / "link", folder.path() / "link" / "", real / ".." / "var"}) {
    EXPECT_EQ(VarPaths::at(name).root, real) << name;
    EXPECT_EQ(VarPaths::at(name).memory(), VarPaths{real}.memory()) << name;
  }
}

TEST(RunFolder, AndItsLocksAreTheSuitesUsersAlone) {
  const testing_support::TemporaryFolder folder;
  const VarPaths var{folder.path() / "var"};
  ASSERT_TRUE(InstanceLock::take(var, "timing"));
  ASSERT_TRUE(RestartLock::take(var, "timing"));
  EXPECT_EQ(mode_of(var.run()), 0700U);
  EXPECT_EQ(mode_of(var.instance_lock("timing")), 0600U);
  EXPECT_EQ(mode_of(var.restart_lock("timing")), 0600U);
}

TEST(RunFolder, ALockIsNotTakenThroughALink) {
  const testing_support::TemporaryFolder folder;
  const VarPaths var{folder.path()};
  var.make_run_folder();
  std::filesystem::create_symlink(folder.path() / "victim", var.instance_lock("timing"));
  EXPECT_FALSE(InstanceLock::take(var, "timing"));
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "victim"));
}

/// What another local user can do, in a process of its own. @return whether it could
template <typename Attack>
bool another_user_can(const Attack& attack) {
  const pid_t child = fork();
  if (child == 0) {
    if (setgid(65534) != 0 || setuid(65534) != 0) _exit(1);
    _exit(attack() ? 0 : 1);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

bool can_make(const std::filesystem::path& path) {
  return mkdir(path.c_str(), 0777) == 0 || symlink("/etc/passwd", (path.string() + "_link").c_str()) == 0;
}

TEST(RunFolder, AnotherUserTakesNoNameOfTheSuiteBeforehandAndHoldsNoLockOfIt) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root";
  const testing_support::TemporaryFolder folder;
  ASSERT_EQ(chmod(folder.path().c_str(), 0755), 0);
  const VarPaths var{folder.path() / "var"};
  ASSERT_TRUE(another_user_can([] { return true; }));
  ASSERT_TRUE(runtime_folder(0));
  for (const auto& name : {var.memory(), *runtime_folder(0) / "domains", var.root, var.run()})
    EXPECT_FALSE(another_user_can([&] { return can_make(name); })) << name;
  ASSERT_TRUE(InstanceLock::take(var, "timing"));
  ASSERT_TRUE(RestartLock::take(var, "timing"));
  const auto domain = DomainLock::allocate(std::nullopt, 80, var.root);
  ASSERT_TRUE(domain) << domain.error();
  for (const auto& name : {var.instance_lock("timing"), var.restart_lock("timing"), var.starting_lock(),
                           *runtime_folder(0) / "domains" / std::to_string(domain->domain())})
    EXPECT_FALSE(another_user_can([&] { return open(name.c_str(), O_RDONLY | O_CREAT, 0666) >= 0; })) << name;
  std::filesystem::remove_all(var.memory());
}

TEST(RunFolder, OneThatOthersMayWriteToIsNotUsed) {
  const testing_support::TemporaryFolder folder;
  const VarPaths var{folder.path()};
  std::filesystem::create_directory(var.run());
  ASSERT_EQ(chmod(var.run().c_str(), 0777), 0);
  const auto lock = InstanceLock::take(var, "timing");
  ASSERT_FALSE(lock);
  EXPECT_THAT(lock.error(), HasSubstr("others may write to it"));
  // Another user may hold a lock there: the node is restarted nevertheless.
  const Fd taken(open(var.restart_lock("timing").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
  ASSERT_EQ(flock(taken.get(), LOCK_EX), 0);
  if (runtime_folder(geteuid())) {
    EXPECT_TRUE(RestartLock::take(var, "timing"));
  }
  std::filesystem::remove_all(var.memory());
}

TEST(Memory, LiesWhereTheSuiteFirstPutItAndALinkOfSomebodyElseLeadsNowhere) {
  const testing_support::TemporaryFolder folder;
  const VarPaths var{folder.path() / "var"};
  ASSERT_TRUE(var.make_run_folder());
  const auto memory = var.memory();
  std::error_code ec;
  if (memory != var.memory_link()) {
    EXPECT_EQ(std::filesystem::read_symlink(var.memory_link(), ec), memory);
  }
  std::filesystem::remove(var.memory_link());
  const auto victim = folder.path() / "victim";
  std::filesystem::create_directory(victim);
  std::filesystem::create_directory_symlink(victim, var.memory_link());
  if (runtime_folder(geteuid())) {
    EXPECT_EQ(var.memory(), memory);
  }
  EXPECT_FALSE(open_private(var.memory_link() / "ttc.heartbeat", O_RDWR | O_CREAT, var.owner()));
  ASSERT_TRUE(var.make_run_folder());
  EXPECT_TRUE(std::filesystem::exists(victim));
}

TEST(Memory, OfAUserWithoutARuntimeFolderLiesInVar) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root";
  ASSERT_FALSE(std::filesystem::exists("/run/user/65534")) << "user 65534 has a session here";
  const testing_support::TemporaryFolder folder;
  ASSERT_EQ(chown(folder.path().c_str(), 65534, 65534), 0);
  const VarPaths var{folder.path()};
  EXPECT_EQ(var.memory(), var.run() / "memory");
  ASSERT_TRUE(another_user_can([&] { return var.make_run_folder().has_value(); }));
  EXPECT_TRUE(another_user_can([&] {
    return open_private(var.memory() / "ttc.heartbeat", O_RDWR | O_CREAT, var.owner()).has_value();
  }));
  EXPECT_EQ(mode_of(var.memory()), 0700U);
  EXPECT_TRUE(open_private(var.memory() / "ttc.heartbeat", O_RDONLY, var.owner()))
      << "root reads that user's";
  std::filesystem::remove_all(var.memory());
  std::filesystem::create_directory_symlink("/run/user/65534/srfs/gone", var.memory_link());
  ASSERT_TRUE(another_user_can([&] { return var.make_run_folder().has_value(); }));
  EXPECT_TRUE(another_user_can([&] {
    return open_private(var.memory() / "ttc.heartbeat", O_RDWR | O_CREAT, var.owner()).has_value();
  })) << "the choice of a session that has ended is in its way";
}

TEST(Records, NameNoProcessThatTheirAuthorCouldNotSignal) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root";
  const testing_support::TemporaryFolder folder;
  const VarPaths var{folder.path()};
  EXPECT_TRUE(var.may_name(getpid()));
  ASSERT_EQ(chown(folder.path().c_str(), 65534, 65534), 0);
  EXPECT_FALSE(var.may_name(getpid())) << "user 65534 cannot have root kill a process of root's";
  EXPECT_FALSE(var.may_name(1));
  EXPECT_TRUE(another_user_can([&] { return var.may_name(getpid()); }));
}

TEST(DdsDomains, OfOtherUsersAreKnownByTheirPorts) {
  // Format of Linux 6.1. 0x1CE8 = 7400: domain 0; 0x45EC = 17900: domain 42; 0x45EB: last port of domain 41.
  std::istringstream udp_sockets(
      "   sl  local_address rem_address   st tx_queue rx_queue tr tm->when retrnsmt   uid  timeout inode\n"
      "  101: 00000000:1CE8 00000000:0000 07 00000000:00000000 00:00000000 00000000  1001        0 34127 2 0 "
      "0\n"
      "  102: 0100007F:45EC 00000000:0000 07 00000000:00000000 00:00000000 00000000     0        0 34128 2 0 "
      "0\n"
      "  103: 0100007F:45EB 00000000:0000 07 00000000:00000000 00:00000000 00000000  1001        0 34129 2 0 "
      "0\n"
      "  104: 0100007F:0035 00000000:0000 07 00000000:00000000 00:00000000 00000000  1001        0 34130 2 0 "
      "0\n"
      "  105: 0100007F:FFFF 00000000:0000 07 00000000:00000000 00:00000000 00000000  1001        0 34131 2 0 "
      "0\n"
      "nonsense\n");
  EXPECT_THAT(domains_of_other_users(udp_sockets, 0), ElementsAre(0, 41));
  udp_sockets.clear();
  udp_sockets.seekg(0);
  EXPECT_THAT(domains_of_other_users(udp_sockets, std::nullopt), ElementsAre(0, 41, 42));
}

std::filesystem::path domains() {
  const auto runtime = runtime_folder(geteuid());
  return runtime ? *runtime / "domains"
                 : std::filesystem::path(getpwuid(geteuid())->pw_dir) / ".cache/srfs/domains";
}

/// Domains that are free for a moment here must not be taken by the tests that run beside (dds_domain.hpp).
constexpr int apart = 90;

TEST(DdsDomains, OneThatAnotherUsersSuiteHasIsNotTakenAndAWantedOneIs) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root";
  const int free = DomainLock::allocate(std::nullopt, apart).value().domain();
  std::array<int, 2> pipe_ends{};
  ASSERT_EQ(pipe(pipe_ends.data()), 0);
  const pid_t child = fork();
  if (child == 0) {
    if (setgid(65534) != 0 || setuid(65534) != 0) _exit(1);
    const int socket = ::socket(AF_INET, SOCK_DGRAM, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(7400 + 250 * free + 10));
    const bool bound = bind(socket, reinterpret_cast<sockaddr*>(&address), sizeof address) == 0;
    [[maybe_unused]] const ssize_t told = write(pipe_ends[1], bound ? "y" : "n", 1);
    pause();
  }
  char bound = 'n';
  EXPECT_EQ(read(pipe_ends[0], &bound, 1), 1);
  EXPECT_EQ(bound, 'y');
  EXPECT_NE(DomainLock::allocate(std::nullopt, free).value().domain(), free);
  EXPECT_TRUE(DomainLock::allocate(free));
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  close(pipe_ends[0]);
  close(pipe_ends[1]);
}

TEST(DdsDomains, LocksLieInAFolderOfThisUserAlone) {
  const auto lock = DomainLock::allocate(std::nullopt, apart);
  ASSERT_TRUE(lock) << lock.error();
  const std::filesystem::path folder = domains();
  EXPECT_EQ(mode_of(folder), 0700U);
  EXPECT_EQ(mode_of(folder / std::to_string(lock->domain())), 0600U);
  EXPECT_THAT(DomainLock::allocate(lock->domain()).error(), HasSubstr("is in use by another running suite"));
}

TEST(DdsDomains, ADomainThatAnotherSuiteTookAfterAllNodesHadBeenKilledIsNotShared) {
  const int domain = DomainLock::allocate(std::nullopt, apart, "/ours").value().domain();  // not held
  {
    const auto ours = DomainLock::share(domain, "/ours");
    ASSERT_TRUE(ours) << ours.error();
    EXPECT_TRUE(DomainLock::share(domain, "/ours"));
    EXPECT_FALSE(DomainLock::share(domain, "/theirs"));
  }
  auto theirs = DomainLock::allocate(domain, apart, "/theirs");
  ASSERT_TRUE(theirs) << theirs.error();
  theirs->downgrade();
  EXPECT_TRUE(DomainLock::share(domain, "/theirs"));
  EXPECT_THAT(DomainLock::share(domain, "/ours").error(), HasSubstr("in use by another suite, /theirs"));
}

/// Creates a lock file in the state that killed nodes leave.
void leave_lock_file(int domain, const std::string& suite) {
  const std::string file = domains() / std::to_string(domain);
  const Fd fd(open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
  ASSERT_TRUE(fd);
  ASSERT_EQ(write(fd.get(), suite.data(), suite.size()), static_cast<ssize_t>(suite.size()));
}

TEST(DdsDomains, NodesThatStartAtOnceAfterAllHadBeenKilledShareTheirDomain) {
  const int domain = DomainLock::allocate(std::nullopt, apart, "/ours").value().domain();
  for (int round = 0; round < 50; ++round) {
    leave_lock_file(domain, round % 2 == 0 ? "/theirs" : "/ours");
    std::barrier together(4);
    std::mutex kept;
    std::vector<DomainLock> locks;
    std::vector<std::string> problems;
    const auto start = [&] {
      together.arrive_and_wait();
      auto lock = DomainLock::share(domain, "/ours");
      const std::scoped_lock held(kept);
      if (lock)
        locks.push_back(std::move(*lock));
      else
        problems.push_back(lock.error());
    };
    {
      std::vector<std::jthread> threads;
      for (int i = 0; i < 4; ++i) threads.emplace_back(start);
    }
    EXPECT_THAT(problems, IsEmpty());
    EXPECT_THAT(locks, SizeIs(4));
    EXPECT_FALSE(DomainLock::allocate(domain));
  }
}

}  // namespace
}  // namespace srfs::suite
