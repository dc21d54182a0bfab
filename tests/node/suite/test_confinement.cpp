// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// What a confined process attempts is attempted: by a child of this process that has taken on a node's
// confinement.

#include <csignal>
#include <cstdlib>
#include <fstream>
#include <thread>

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/capability.h>
#include <netinet/in.h>
#include <poll.h>
#include <sched.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/timex.h>
#include <sys/uio.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/private_file.hpp"
#include "suite/command_keys.hpp"
#include "suite/confinement.hpp"
#include "suite/launcher.hpp"
#include "suite/node_versions.hpp"
#include "suite/starter.hpp"
#include "tests/signal_child.hpp"
#include "tests/var_folder.hpp"

namespace srfs::suite {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using What = RestartOutcome::What;

const std::string bin = SRFS_BINARY_DIR "/bin";

bool wait_until(const std::function<bool()>& condition) {
  const MonotonicTime deadline = monotonic_now() + seconds(30);
  while (!condition()) {
    if (monotonic_now() > deadline) return false;
    poll(nullptr, 0, 2);
  }
  return true;
}

class Confining : public testing::Test {
 protected:
  void SetUp() override {
    const std::string probe = bin + "/launch_probe";
    ASSERT_TRUE(write_file_atomically(folder_ / "d.yaml",
                                      "deployment: t\nring: { period_ms: 100 }\nnodes:\n"
                                      "  - { name: timing, executable: timing_node }\n"
                                      "  - { name: can_switcher, executable: can_switcher_node }\n"
                                      "  - { name: ttc, executable: ttc_node }\n"
                                      "  - { name: eps, executable: " +
                                          probe +
                                          " }\n"
                                          "  - { name: thermal, executable: " +
                                          probe +
                                          " }\n"
                                          "  - { name: maintenance, executable: maintenance_node }\n"));
    plan_ = Deployment::load(folder_ / "d.yaml");
    std::filesystem::create_directories(var_.root);
    ASSERT_TRUE(var_.make_run_folder());
    (void)open_private(var_.memory() / "thermal.deaths", O_RDWR | O_CREAT);
    for (const char* file :
         {"keys/tc.key", "golden/copy_of_tc.key", "state/eps/own", "state/thermal/journal", "versions/eps/x"})
      ASSERT_TRUE(write_file_atomically(var_.root / file, "secret"));
    std::ofstream(var_.restart_lock("thermal"));
  }
  void TearDown() override {
    for (const NodeEntry& node : plan_.nodes) {
      if (const auto process = open_instance(var_, node.name)) {
        process->signal(SIGKILL);
        (void)process->wait_for_exit(seconds(20));
      }
    }
    EXPECT_TRUE(wait_until([&] { return starters().empty(); })) << "a starter outlives its node";
    forget_command_keys(var_);
    std::filesystem::remove_all(var_.memory());
  }
  /// Whether @p attempt succeeds in a process that has the confinement of @p node.
  bool can(const std::string& node, std::uint32_t version, const std::function<bool()>& attempt) {
    const NodeEntry& entry = *plan_.find(node);
    const Confinement confinement =
        Confinement::make({plan_, var_, entry, bin + "/launch_probe", bin}, trust_in(plan_, entry, version));
    EXPECT_THAT(confinement.missing(), IsEmpty());
    const pid_t child = fork();
    if (child == 0) {
      if (confinement.enter() != nullptr) _exit(2);
      _exit(attempt() ? 0 : 1);
    }
    int status = 0;
    waitpid(child, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) < 2) << "status " << status;
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }
  bool foreign_can(const std::function<bool()>& attempt) { return can("eps", 1, attempt); }
  bool own_can(const std::function<bool()>& attempt) { return can("eps", 0, attempt); }
  static std::function<bool()> opening(const std::filesystem::path& file, int flags) {
    return [=] { return open(file.c_str(), flags | O_CLOEXEC, 0600) >= 0; };
  }
  /// Command lines of the starters of this VAR.
  [[nodiscard]] std::vector<std::string> starters() const {
    std::vector<std::string> found;
    std::error_code ec;
    for (const auto& entry : std::filesystem::directory_iterator("/proc", ec)) {
      const std::string line = read_file(entry.path() / "cmdline", 65536).value_or("");
      const bool is_one =
          line.find("srfs-starter") != std::string::npos || line.find("serve-starter") != std::string::npos;
      if (is_one && line.find(var_.root.string()) != std::string::npos) found.push_back(line);
    }
    return found;
  }
  [[nodiscard]] RealPrivileges privileges_of(pid_t pid) const {
    return privileges_from(read_file("/proc/" + std::to_string(pid) + "/status", 65536).value_or(""));
  }

  const testing_support::VarFolder temporary_;
  const std::filesystem::path folder_ = std::filesystem::canonical(temporary_.path());
  const VarPaths var_{folder_ / "var"};
  Deployment plan_;
};

TEST_F(Confining, AForeignNodeReadsNoKeysAndNothingOfOthers) {
  EXPECT_FALSE(foreign_can(opening(var_.root / "keys/tc.key", O_RDONLY)));
  EXPECT_FALSE(foreign_can(opening(var_.root / "state/thermal/journal", O_RDONLY)));
  EXPECT_FALSE(foreign_can(opening("/etc/shadow", O_RDONLY)));
  EXPECT_FALSE(foreign_can(opening("/proc/" + std::to_string(getpid()) + "/mem", O_RDONLY)));
  EXPECT_FALSE(foreign_can(opening("/proc/" + std::to_string(getpid()) + "/environ", O_RDONLY)));
  EXPECT_TRUE(foreign_can(opening(folder_ / "d.yaml", O_RDONLY)));
  EXPECT_TRUE(foreign_can(opening(var_.root / "state/eps/own", O_RDWR)));
}

TEST_F(Confining, AForeignNodeWritesItsOwnStateAlone) {
  EXPECT_TRUE(foreign_can(opening(var_.root / "state/eps/new", O_RDWR | O_CREAT)));
  EXPECT_TRUE(
      foreign_can([this] { return write_file_atomically(var_.root / "state/eps/own", "x").has_value(); }));
  for (const std::filesystem::path& file :
       {var_.root / "state/thermal/journal", var_.root / "state/thermal/new", var_.root / "versions/eps/x",
        var_.root / "new", var_.stopping_flag(), var_.memory() / "thermal.deaths",
        var_.memory() / "ttc.stand_in", folder_ / "new", std::filesystem::path("/tmp/srfs_confinement_new"),
        std::filesystem::path("/etc/srfs_new")})
    EXPECT_FALSE(foreign_can(opening(file, O_RDWR | O_CREAT))) << file;
  EXPECT_FALSE(foreign_can([this] {
    return rename((var_.root / "state/thermal/journal").c_str(), (var_.root / "state/eps/own").c_str()) == 0;
  }));
  EXPECT_FALSE(foreign_can([this] { return unlink((var_.root / "state/thermal/journal").c_str()) == 0; }));
}

TEST_F(Confining, AForeignNodeTracesSignalsAndLocksNothing) {
  const pid_t other = getpid();
  EXPECT_FALSE(foreign_can([=] { return ptrace(PTRACE_ATTACH, other, nullptr, nullptr) == 0; }));
  EXPECT_FALSE(foreign_can([=] { return kill(other, 0) == 0; }));
  EXPECT_FALSE(foreign_can([=] { return syscall(SYS_tgkill, other, other, 0) == 0; }));
  EXPECT_FALSE(foreign_can([=] { return syscall(SYS_tkill, other, 0) == 0; }));
  EXPECT_FALSE(foreign_can([=] {
    const long process = syscall(SYS_pidfd_open, other, 0);
    return process >= 0 && syscall(SYS_pidfd_send_signal, process, 0, nullptr, 0) == 0;
  }));
  EXPECT_FALSE(foreign_can([=] {
    char octet = 0;
    iovec local{&octet, 1};
    iovec remote{&octet, 1};
    return process_vm_readv(other, &local, 1, &remote, 1, 0) == 1;
  }));
  EXPECT_FALSE(foreign_can([this] {
    return flock(open(var_.restart_lock("thermal").c_str(), O_RDONLY | O_CLOEXEC), LOCK_EX | LOCK_NB) == 0;
  }));
  EXPECT_TRUE(foreign_can([] { return kill(getpid(), 0) == 0; })) << "itself";
}

TEST_F(Confining, AForeignNodeHasNoSignalSentByTheKernel) {
  const pid_t other = getpid();
  const auto on_pipe = [](int command, int value) {
    return [=] {
      int ends[2] = {-1, -1};
      return pipe2(ends, O_CLOEXEC) == 0 && fcntl(ends[0], command, value) == 0;
    };
  };
  EXPECT_FALSE(foreign_can(on_pipe(F_SETOWN, other)));
  EXPECT_FALSE(foreign_can(on_pipe(F_SETSIG, SIGKILL)));
  EXPECT_FALSE(foreign_can([=] {
    int ends[2] = {-1, -1};
    const f_owner_ex owner{F_OWNER_PID, other};
    return pipe2(ends, O_CLOEXEC) == 0 && fcntl(ends[0], F_SETOWN_EX, &owner) == 0;
  }));
  EXPECT_FALSE(foreign_can([=] {
    int owner = other;
    const int udp = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    return ioctl(udp, FIOSETOWN, &owner) == 0 || ioctl(udp, SIOCSPGRP, &owner) == 0;
  }));
}

TEST_F(Confining, AForeignNodeHoldsNobodyWhoOpensAFile) {
  std::ofstream(var_.root / "state/eps/own") << "text";
  EXPECT_FALSE(foreign_can([this] {
    const int fd = open((var_.root / "state/eps/own").c_str(), O_RDONLY | O_CLOEXEC);
    return fcntl(fd, F_SETLEASE, F_RDLCK) == 0;
  }));
}

TEST_F(Confining, AForeignNodeThatKeepsADeadNodeFromItsLockIsKilledWhenThatIsStarted) {
  std::ofstream(var_.instance_lock("thermal"));
  const auto locks = [this](int command, int flags) {
    const int fd = open(var_.instance_lock("thermal").c_str(), flags | O_CLOEXEC);
    struct flock shared {};
    shared.l_type = F_RDLCK;
    return fd >= 0 && fcntl(fd, command, &shared) == 0;
  };
  EXPECT_FALSE(foreign_can([=] { return locks(F_OFD_SETLK, O_RDONLY); })) << "nobody's, by F_GETLK";
  EXPECT_FALSE(foreign_can([=] { return locks(F_SETLK, O_RDWR); }));
  const Confinement confinement =
      Confinement::make({plan_, var_, *plan_.find("eps"), bin + "/launch_probe", bin}, Trust::foreign);
  const pid_t pretender = fork();
  if (pretender == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (confinement.enter() != nullptr || !locks(F_SETLK, O_RDONLY)) _exit(2);
    while (true) pause();
  }
  ASSERT_TRUE(wait_until([&] {
    struct flock lock {};
    lock.l_type = F_WRLCK;
    const Fd fd(open(var_.instance_lock("thermal").c_str(), O_RDONLY | O_CLOEXEC));
    return fcntl(fd.get(), F_GETLK, &lock) == 0 && lock.l_pid == pretender;
  }));
  EXPECT_FALSE(find_instance(var_, "thermal")) << "no node has a shared lock";

  const auto pid = launch({plan_, var_, bin, "up"}, *plan_.find("thermal"));
  ASSERT_TRUE(pid) << pid.error();
  EXPECT_EQ(find_instance(var_, "thermal")->pid, *pid);
  int status = 0;
  waitpid(pretender, &status, 0);
  EXPECT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) << status;
}

TEST_F(Confining, AForeignNodeHasNoMemoryBesideItsLimit) {
  const auto mapping = [](int flags) {
    return [=] { return mmap(nullptr, 4096, PROT_READ | PROT_WRITE, flags, -1, 0) != MAP_FAILED; };
  };
  EXPECT_FALSE(foreign_can(mapping(MAP_SHARED | MAP_ANONYMOUS)));
  EXPECT_FALSE(foreign_can(mapping(MAP_SHARED_VALIDATE | MAP_ANONYMOUS)));
  EXPECT_FALSE(foreign_can(mapping(MAP_PRIVATE | MAP_ANONYMOUS | MAP_GROWSDOWN)));
  EXPECT_FALSE(foreign_can([] { return memfd_create("x", MFD_CLOEXEC) >= 0; }));
  EXPECT_FALSE(foreign_can(opening("/dev/zero", O_RDONLY)));
  EXPECT_TRUE(foreign_can(mapping(MAP_PRIVATE | MAP_ANONYMOUS)));
}

TEST_F(Confining, AForeignNodeChangesNobodysPriorityButItsOwn) {
  const pid_t other = getpid();
  const sched_param none{};
  cpu_set_t one{};
  CPU_SET(0, &one);
  constexpr int io_of_a_process = 1;
  constexpr int idle_io = 3 << 13;
  EXPECT_FALSE(foreign_can([=] { return setpriority(PRIO_PROCESS, other, 19) == 0; }));
  EXPECT_FALSE(foreign_can([=] { return setpriority(PRIO_PGRP, 0, 19) == 0; })) << "all of its group";
  EXPECT_FALSE(foreign_can([=] { return sched_setscheduler(other, SCHED_IDLE, &none) == 0; }));
  EXPECT_FALSE(foreign_can([=] { return sched_setaffinity(other, sizeof one, &one) == 0; }));
  EXPECT_FALSE(foreign_can([=] { return syscall(SYS_ioprio_set, io_of_a_process, other, idle_io) == 0; }));
  EXPECT_TRUE(foreign_can([=] { return setpriority(PRIO_PROCESS, 0, 19) == 0; }));
  EXPECT_TRUE(foreign_can([=] { return syscall(SYS_ioprio_set, io_of_a_process, 0, idle_io) == 0; }));
}

TEST_F(Confining, AForeignNodeHasNoCapabilitiesStartsNothingAndChangesNothingOfTheMachine) {
  EXPECT_TRUE(foreign_can([] {
    const auto real = privileges_from(read_file("/proc/self/status", 65536).value_or(""));
    return real.capabilities == 0 && real.no_new_privileges && real.filtered;
  }));
  EXPECT_FALSE(foreign_can([] {
    const pid_t child = fork();
    if (child == 0) _exit(0);
    return child > 0;
  }));
  EXPECT_FALSE(foreign_can([] { return unshare(CLONE_NEWUSER) == 0; }));
  EXPECT_FALSE(foreign_can([] { return mount("none", "/mnt", "tmpfs", 0, nullptr) == 0; }));
  EXPECT_FALSE(foreign_can([] {
    const timespec now{};
    return clock_settime(CLOCK_REALTIME, &now) == 0;
  }));
  EXPECT_FALSE(foreign_can([] { return setuid(65534) == 0 && geteuid() == 0; }));
}

TEST_F(Confining, AForeignNodeStillHasThreadsAndSockets) {
  EXPECT_TRUE(foreign_can([] {
    bool ran = false;
    std::thread([&] { ran = true; }).join();
    return ran;
  }));
  EXPECT_TRUE(foreign_can([] { return socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0) >= 0; }));
}

TEST_F(Confining, AForeignNodeReachesNoServiceOfTheMachineOnHardware) {
  const auto local_socket = [] { return socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0) >= 0; };
  EXPECT_FALSE(foreign_can(local_socket));
  EXPECT_FALSE(foreign_can([] {
    constexpr unsigned long unused_half = 1UL << 32U;  // the kernel takes it for AF_UNIX
    return syscall(SYS_socket, unused_half | AF_UNIX, SOCK_STREAM, 0) >= 0;
  }));
  EXPECT_TRUE(own_can(local_socket));
  plan_.devices["can"] = "sim:run/can_hub.sock";
  EXPECT_TRUE(foreign_can(local_socket)) << "simulated devices are such sockets";
}

TEST_F(Confining, AForeignNodeOpensTheTerminalsOfItsDevicesAlone) {
  const auto make_terminal = [](std::string& name) {
    Fd master(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC));
    if (!master || grantpt(master.get()) != 0 || unlockpt(master.get()) != 0) return Fd();
    name = ptsname(master.get());
    return master;
  };
  std::string own;
  std::string other;
  const Fd first = make_terminal(own);
  const Fd second = make_terminal(other);
  ASSERT_TRUE(first && second);
  std::filesystem::create_symlink(own, var_.run() / "gps_tty");
  plan_.devices["gps_serial"] = "serial:run/gps_tty";
  EXPECT_TRUE(foreign_can(opening(var_.run() / "gps_tty", O_RDWR | O_NOCTTY)));
  EXPECT_FALSE(foreign_can(opening(other, O_RDWR | O_NOCTTY)));
}

TEST_F(Confining, AForeignPayloadHasItsMarkInMemoryAlone) {
  EXPECT_TRUE(foreign_can(
      [this] { return open_private(var_.memory() / "eps_ids_lost", O_WRONLY | O_CREAT).has_value(); }));
  EXPECT_TRUE(foreign_can(
      [this] { return open_private(var_.memory() / "eps_ids_lost", O_WRONLY | O_TRUNC).has_value(); }));
  EXPECT_FALSE(foreign_can(opening(var_.memory() / "thermal_ids_lost", O_WRONLY | O_CREAT)));
}

TEST_F(Confining, InstalledNodesChangeNoPrograms) {
  EXPECT_FALSE(own_can(opening(var_.root / "versions/eps/x", O_RDWR)));
  EXPECT_TRUE(own_can(opening(var_.root / "versions/eps/x", O_RDONLY)));
  std::filesystem::remove_all(var_.root / "versions");
  EXPECT_TRUE(own_can(opening(var_.root / "versions", O_RDONLY | O_DIRECTORY))) << "of those that come later";
}

TEST_F(Confining, OfTheInstalledNodesTtcAloneReadsKeys) {
  const auto read_key = opening(var_.root / "keys/tc.key", O_RDONLY);
  EXPECT_FALSE(own_can(read_key));
  EXPECT_FALSE(can("timing", 0, read_key));
  EXPECT_TRUE(can("ttc", 0, read_key));
  EXPECT_TRUE(can("ttc", 1, read_key)) << "an uplinked ttc has to command, too";
  EXPECT_FALSE(own_can(opening(var_.root / "golden/copy_of_tc.key", O_RDONLY)));
  EXPECT_TRUE(own_can(opening(var_.root / "state/thermal/journal", O_RDWR)));
  EXPECT_TRUE(own_can(opening(var_.root / "state/eps/new", O_RDWR | O_CREAT)));
  for (const char* file : {"/etc/srfs_new", "/usr/srfs_new", "/tmp/srfs_confinement_new"})
    EXPECT_FALSE(own_can(opening(file, O_RDWR | O_CREAT))) << file;
  EXPECT_FALSE(own_can([] { return ptrace(PTRACE_ATTACH, getppid(), nullptr, nullptr) == 0; }));
  EXPECT_FALSE(own_can([] { return unshare(CLONE_NEWNS) == 0; }));
}

TEST_F(Confining, ANodeReadsNoKeyOfOrdersButItsOwnAndTtcAll) {
  const CommandKey eps = command_key(var_, "eps").value();
  const CommandKey thermal = command_key(var_, "thermal").value();
  const CommandKey suite = suite_command_key(var_).value();
  const ros::SealKey seal = suite_seal_key(var_).value();
  const auto finds = [this](const std::string& node, const CommandKey& key) {
    return [=, this] { return command_key(var_, node) == Result<CommandKey, std::string>(key); };
  };
  const auto commands = [=, this] {
    return suite_command_key(var_) == Result<CommandKey, std::string>(suite);
  };
  for (const std::uint32_t version : {0U, 1U}) {
    EXPECT_TRUE(can("eps", version, finds("eps", eps))) << version;
    EXPECT_FALSE(can("eps", version, finds("thermal", thermal))) << version;
    EXPECT_FALSE(can("eps", version, commands)) << version;
    EXPECT_EQ(can("eps", version, [=, this] { return find_seal_key(var_) == std::optional(seal); }),
              version == 0)
        << "an uplinked node";
    EXPECT_TRUE(can("ttc", version, commands)) << version;
  }
}

TEST_F(Confining, AnUplinkedNodeSealsByItsOwnKeyAndCannotFindAnother) {
  const ros::SealKey suite = suite_seal_key(var_).value();
  for (const char* node : {"eps", "thermal"}) ASSERT_TRUE(hand_out_seal_key(var_, node, true));
  const auto seals_by = [this](const std::string& node, const ros::SealKeys& keys) {
    return [=, this] { return seal_keys(var_, node) == Result<ros::SealKeys, std::string>(keys); };
  };
  const auto limited = [&](const std::string& node) {
    return ros::SealKeys{ros::limited_seal_key(suite, node), node, ros::seal_key_among_limited(suite)};
  };
  EXPECT_TRUE(can("eps", 1, seals_by("eps", limited("eps"))));
  EXPECT_FALSE(can("eps", 1, seals_by("thermal", limited("thermal"))));
  EXPECT_TRUE(can("eps", 0, seals_by("eps", ros::SealKeys{suite})));
  EXPECT_TRUE(can("ttc", 1, seals_by("ttc", ros::SealKeys{suite}))) << "the others must believe it";
  // What it cannot read it does not replace either.
  EXPECT_FALSE(can("eps", 1, [this] { return suite_seal_key(var_).has_value(); }));
  EXPECT_EQ(suite_seal_key(var_).value(), suite);
}

TEST_F(Confining, RootsNodesHaveTheCapabilitiesOfTheirWorkAlone) {
  if (geteuid() != 0) GTEST_SKIP() << "needs root";
  std::ifstream most("/proc/sys/net/core/rmem_max");
  long octets = 0;
  most >> octets;
  rlimit niceness{};
  getrlimit(RLIMIT_NICE, &niceness);
  constexpr rlim_t of_flight = 28;
  const auto own = privileges_from(read_file("/proc/self/status", 65536).value_or("")).capabilities;
  const bool may_raise = niceness.rlim_max >= of_flight || (own >> CAP_SYS_RESOURCE & 1U) != 0;
  const std::uint64_t of_machine =
      (octets < (4L << 20) ? 1ULL << CAP_NET_ADMIN : 0) | (may_raise ? 0 : own & 1ULL << CAP_SYS_NICE);
  const auto has = [](std::uint64_t wanted) {
    return [=] {
      return privileges_from(read_file("/proc/self/status", 65536).value_or("")).capabilities == wanted;
    };
  };
  EXPECT_TRUE(can("eps", 0, has(of_machine)));
  EXPECT_TRUE(can("timing", 0, has(1ULL << CAP_SYS_TIME | of_machine)));
  EXPECT_TRUE(can("can_switcher", 0, has(1ULL << CAP_NET_ADMIN | of_machine)));
  plan_.nodes.front().user = "nobody";
  EXPECT_TRUE(can("can_switcher", 0, has(1ULL << CAP_NET_ADMIN | 1ULL << CAP_KILL | of_machine)));
  plan_.nodes.front().user.clear();
  EXPECT_TRUE(can("timing", 0, [] {
    timex change{};
    change.modes = ADJ_SETOFFSET | ADJ_NANO;  // by nothing
    return adjtimex(&change) >= 0;
  }));
  EXPECT_FALSE(can("eps", 0, [] {
    timex change{};
    change.modes = ADJ_SETOFFSET | ADJ_NANO;
    return adjtimex(&change) >= 0;
  }));
}

TEST_F(Confining, TrustFollowsFromDeploymentAndVersion) {
  EXPECT_EQ(trust_in(plan_, *plan_.find("eps"), 0), Trust::own);
  EXPECT_EQ(trust_in(plan_, *plan_.find("eps"), 3), Trust::foreign);
  EXPECT_EQ(trust_in(plan_, *plan_.find("ttc"), 3), Trust::own);
  EXPECT_EQ(trust_in(plan_, *plan_.find("maintenance"), 0), Trust::whole);
  NodeEntry added = *plan_.find("eps");
  added.added = true;
  EXPECT_EQ(trust_in(plan_, added, 1), Trust::foreign);
}

TEST_F(Confining, AnUplinkedProgramIsConfinedBeforeItsFirstInstruction) {
  const auto stored =
      change_versions(var_, "eps", [&](update::VersionStore& store) -> Result<void, std::string> {
        const auto number = store.add(bin + "/launch_probe", "a test", system_utc_now());
        if (!number) return Err(std::string("not added"));
        return store.use(*number, std::chrono::hours(1), "");
      });
  ASSERT_TRUE(stored) << stored.error();
  const auto pid = launch({plan_, var_, bin, "up"}, *plan_.find("eps"));
  ASSERT_TRUE(pid) << pid.error();
  const RealPrivileges real = privileges_of(*pid);
  EXPECT_EQ(real.capabilities, 0U);
  EXPECT_TRUE(real.no_new_privileges);
  EXPECT_TRUE(real.filtered);
  for (const auto resource : {RLIMIT_DATA, RLIMIT_STACK, RLIMIT_FSIZE, RLIMIT_RTPRIO, RLIMIT_NICE}) {
    rlimit bound{};
    ASSERT_EQ(prlimit(*pid, resource, nullptr, &bound), 0);
    EXPECT_NE(bound.rlim_max, RLIM_INFINITY) << resource;
    EXPECT_EQ(bound.rlim_cur, bound.rlim_max) << "limit " << resource << " can be raised";
  }
}

TEST_F(Confining, EachNodeHasAStarterThatEndsWithIt) {
  const auto pid = launch({plan_, var_, bin, "up"}, *plan_.find("eps"));
  ASSERT_TRUE(pid) << pid.error();
  EXPECT_TRUE(privileges_of(*pid).filtered);
  ASSERT_TRUE(wait_until([&] { return starters().size() == 1; }));
  EXPECT_THAT(starters().front(), HasSubstr("own"));
  testing_support::signal_child(*pid, SIGKILL);
  EXPECT_TRUE(wait_until([&] { return starters().empty(); }));
}

/// The starter itself, in a thread: what the node asks through the socket is carried out.
class Starting : public Confining {
 protected:
  void serve(Trust trust) {
    int ends[2];
    ASSERT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends), 0);
    client_.emplace(Fd(ends[0]));
    setenv("SRFS_BIN_FOLDER", bin.c_str(), 1);
    server_ = std::thread([this, trust, end = ends[1]] {
      EXPECT_EQ(serve_starter(Fd(end), folder_ / "d.yaml", var_, "eps", trust), 0);
    });
  }
  void TearDown() override {
    client_.reset();
    if (server_.joinable()) server_.join();
    Confining::TearDown();
  }
  static Accusation accusation(FaultClass fault, pid_t pid = 0) {
    Accusation a;
    a.subject = "thermal";
    a.fault = fault;
    a.pid = pid;
    a.first_evidence = a.decided = monotonic_now();
    return a;
  }
  std::optional<StarterClient> client_;
  std::thread server_;
};

TEST_F(Starting, RestartsANodeThatIsGoneOnce) {
  serve(Trust::own);
  const auto first = client_->restart(accusation(FaultClass::absent));
  ASSERT_TRUE(first) << first.error();
  EXPECT_EQ(first->what, What::restarted) << first->reason;
  const auto running = find_instance(var_, "thermal");
  ASSERT_TRUE(running);
  EXPECT_EQ(running->pid, first->pid);
  EXPECT_TRUE(privileges_of(running->pid).filtered) << "confined like one that srfs up starts";
  const auto second = client_->restart(accusation(FaultClass::absent));
  ASSERT_TRUE(second);
  EXPECT_NE(second->what, What::restarted);
  EXPECT_EQ(find_instance(var_, "thermal")->pid, running->pid);
}

TEST_F(Starting, KillsNothingOnAForeignNodesWord) {
  serve(Trust::foreign);
  const auto started = client_->restart(accusation(FaultClass::absent));
  ASSERT_TRUE(started) << started.error();
  ASSERT_EQ(started->what, What::restarted) << started->reason;
  for (const FaultClass fault :
       {FaultClass::deaf, FaultClass::wrong_answer, FaultClass::not_checking, FaultClass::not_working,
        FaultClass::worker_frozen, FaultClass::start_overdue, FaultClass::too_large, FaultClass::cpu_hog,
        FaultClass::limit_violation}) {
    const auto outcome = client_->restart(accusation(fault, started->pid));
    ASSERT_TRUE(outcome) << outcome.error();
    EXPECT_EQ(outcome->what, What::not_believed) << to_text(fault);
  }
  EXPECT_EQ(find_instance(var_, "thermal")->pid, started->pid);
}

TEST_F(Starting, AForeignNodesSilentAccusationNeedsAHeartbeatThatStandsStill) {
  const milliseconds bound{300};
  const MonotonicTime since{seconds(50)};
  Accusation a = accusation(FaultClass::silent, 7);
  a.decided = MonotonicTime(seconds(1'000'000));  // a lie: later than every turn
  EXPECT_THAT(doubt_of_foreign(a, std::nullopt, bound), HasSubstr("no heartbeat page"));
  EXPECT_THAT(doubt_of_foreign(a, StillPage{8, since, bound}, bound), HasSubstr("no heartbeat page"))
      << "another process'";
  EXPECT_THAT(doubt_of_foreign(a, StillPage{7, since, bound - milliseconds(1)}, bound),
              HasSubstr("not seen standing still for 300 ms"));
  EXPECT_THAT(doubt_of_foreign(a, StillPage{7, since, bound}, bound), IsEmpty());
  EXPECT_EQ(a.decided, since);
}

TEST_F(Starting, AForeignNodesWordOnAProcessWithoutAPageIsNotBelieved) {
  serve(Trust::foreign);
  const auto started = client_->restart(accusation(FaultClass::absent));
  ASSERT_TRUE(started) << started.error();
  ASSERT_EQ(started->what, What::restarted) << started->reason;
  const auto outcome = client_->restart(accusation(FaultClass::silent, started->pid));
  ASSERT_TRUE(outcome) << outcome.error();
  EXPECT_EQ(outcome->what, What::not_believed);
  EXPECT_EQ(find_instance(var_, "thermal")->pid, started->pid);
}

TEST_F(Starting, WhatWasAskedBeforeTheNodesEndIsNotDoneAfterIt) {
  int ends[2];
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends), 0);
  {
    StarterClient node{Fd(ends[0]), milliseconds(20)};
    (void)node.restart(accusation(FaultClass::absent));  // nobody serves yet
  }
  EXPECT_EQ(serve_starter(Fd(ends[1]), folder_ / "d.yaml", var_, "eps", Trust::own), 0);
  EXPECT_FALSE(find_instance(var_, "thermal"));
}

TEST_F(Starting, AStarterThatDoesNotAnswerTwiceCountsAsGone) {
  int ends[2];
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends), 0);
  const Fd silent(ends[1]);
  StarterClient client{Fd(ends[0]), milliseconds(20)};
  const auto first = client.restart(accusation(FaultClass::absent));
  ASSERT_TRUE(first);
  EXPECT_EQ(first->what, What::under_way);
  EXPECT_FALSE(client.restart(accusation(FaultClass::absent)));
  EXPECT_FALSE(client.has_answered());
}

/// srfs-starter as the launcher makes it, with a program that may fail.
TEST_F(Starting, AStarterThatFailsIsReportedAndAnotherIsStartedForTheNextRequest) {
  int ends[2];
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends), 0);
  StarterClient client{Fd(ends[0])};
  const std::string waiting = bin + "/srfs-starter";
  const std::string starting = bin + "/srfs";
  const std::string deployment = (folder_ / "d.yaml").string();
  setenv("SRFS_BIN_FOLDER", bin.c_str(), 1);
  const std::string right = *read_file(deployment, 65536);
  ASSERT_TRUE(write_file_atomically(deployment, "nodes: ["));
  const pid_t child = fork();
  if (child == 0) {
    if (dup2(ends[1], starter_fd) < 0 || fcntl(starter_fd, F_SETFD, 0) != 0) _exit(3);
    execl(waiting.c_str(), waiting.c_str(), starting.c_str(), deployment.c_str(), var_.root.c_str(), "eps",
          "own", nullptr);
    _exit(3);
  }
  close(ends[1]);
  const auto failed = client.restart(accusation(FaultClass::absent));
  ASSERT_TRUE(failed) << failed.error();
  EXPECT_EQ(failed->what, What::cannot_start);
  EXPECT_FALSE(client.has_answered());
  ASSERT_TRUE(write_file_atomically(deployment, right));
  const auto again = client.restart(accusation(FaultClass::absent));
  ASSERT_TRUE(again) << again.error();
  EXPECT_EQ(again->what, What::restarted) << again->reason;
  client = StarterClient{Fd()};  // the node's end
  int status = -1;
  EXPECT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
}

TEST_F(Starting, ANodeWhoseStarterIsGoneIsTold) {
  int ends[2];
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends), 0);
  close(ends[1]);
  StarterClient lonely{Fd(ends[0])};
  const auto outcome = lonely.restart(accusation(FaultClass::absent));
  ASSERT_FALSE(outcome);
  EXPECT_THAT(outcome.error(), HasSubstr("starter is gone"));
  serve(Trust::own);
}

}  // namespace
}  // namespace srfs::suite
