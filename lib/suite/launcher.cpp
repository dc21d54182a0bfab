// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/launcher.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string_view>
#include <vector>

#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <grp.h>
#include <linux/close_range.h>
#include <poll.h>
#include <pwd.h>
#include <sched.h>
#include <sys/file.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/background.hpp"
#include "base/file.hpp"
#include "base/log.hpp"
#include "base/private_file.hpp"
#include "base/process.hpp"
#include "base/time.hpp"
#include "suite/added_nodes.hpp"
#include "suite/command_keys.hpp"
#include "suite/confinement.hpp"
#include "suite/node_versions.hpp"
#include "suite/real_time.hpp"
#include "suite/ring/fault_ledger.hpp"
#include "suite/ring/node_record.hpp"
#include "suite/starter.hpp"
#include "suite/state_files.hpp"

namespace srfs::suite {
namespace {

constexpr off_t largest_log = 4 << 20;
constexpr rlim_t open_files = 1024;
constexpr rlim_t most_open_files = 4096;
constexpr rlim_t stack_octets = 8U << 20;
constexpr rlim_t foreign_file_octets = 128U << 20;  // of one file
constexpr rlim_t foreign_memory_octets = 1U << 30;  // where the deployment names no limit
constexpr rlim_t locked_octets = 64U << 20;
constexpr unsigned long timer_slack_ns = 50'000;  // the kernel's own default
constexpr milliseconds longest_exec{1000};
constexpr milliseconds longest_wait_for_cpu{2000};
constexpr milliseconds longest_wait_for_instance{1000};
constexpr milliseconds longest_end_of_a_pretender{200};
constexpr milliseconds longest_wait_for_lock{3000};
constexpr milliseconds longest_wait_for_end{1000};
constexpr const char* no_golden = "an added node has no golden version";
constexpr seconds longest_stand_in{6};
const std::filesystem::path control_groups = "/sys/fs/cgroup";

/// The owner that a process shall have.
struct Owner {
  uid_t uid;
  gid_t gid;
  std::vector<gid_t> groups;
};

/// The node's own starter (starter.hpp); without a program: it has none.
struct Starter {
  std::vector<std::string> arguments;
  std::vector<char*> argv;
  std::vector<std::string> environment;
  std::vector<char*> envp;
  Fd ours, nodes;  ///< the two ends
};

/// What the child needs, made before fork: between fork and exec nothing may allocate.
struct Preparation {
  std::string executable;
  std::vector<std::string> arguments;
  std::vector<char*> argv;
  std::vector<std::string> environment;
  std::vector<char*> envp;
  std::string oom_score_adj;
  std::optional<Owner> owner;
  Fd control_group;  ///< its list of processes, opened; none: it stays where its starter is
  Confinement confinement;
  Starter starter;
  Fd log;
  Fd null;
};

/// What the grandchild reports through the pipe when something before or at exec failed.
struct Failure {
  int error;
  char step[24];
};

/// Test tools only: sanitizer settings and the place of the mission dictionary of a build tree. Programs know
/// their libraries themselves.
constexpr std::array passed_on{"ASAN_OPTIONS", "UBSAN_OPTIONS", "TSAN_OPTIONS", "LSAN_OPTIONS",
                               "SRFS_MISSION_DIR"};

/// Tells a program in a slot where the golden ones are.
constexpr const char* bin_folder_variable = "SRFS_BIN_FOLDER";

bool is_passed_on(std::string_view line) {
  return std::any_of(passed_on.begin(), passed_on.end(), [&](const char* name) {
    return line.starts_with(name) && line.substr(std::strlen(name)).starts_with('=');
  });
}

/// @param lines  NAME=VALUE each; of these only what is passed on
std::vector<std::string> absolute_environment(const std::string& lines) {
  std::vector<std::string> env{"PATH=/usr/local/bin:/usr/bin:/bin", "LANG=C.UTF-8", "TZ=UTC", "HOME=/"};
  for (std::size_t at = 0; at < lines.size();) {
    const std::size_t end = std::min(lines.find('\n', at), lines.size());
    const std::string line = lines.substr(at, end - at);
    if (is_passed_on(line)) env.push_back(line);
    at = end + 1;
  }
  return env;
}

/// Of a process that is not confined: nothing of a file that confined ones may write.
std::vector<std::string> trusted_environment(const std::filesystem::path& bin_folder) {
  auto env = absolute_environment(environment_for_nodes());
  env.push_back(fmt::format("{}={}", bin_folder_variable, std::filesystem::absolute(bin_folder).string()));
  return env;
}

/// Of a node's process.
std::vector<std::string> environment_of(const LaunchRequest& request, Trust trust) {
  if (trust == Trust::whole) return trusted_environment(request.bin_folder);
  constexpr std::size_t largest = 16384;
  auto env = absolute_environment(
      read_file(request.var.environment_file(), largest).value_or(environment_for_nodes()));
  env.push_back(
      fmt::format("{}={}", bin_folder_variable, std::filesystem::absolute(request.bin_folder).string()));
  return env;
}

/// The owner of the node's process; nullopt: as this process.
Result<std::optional<Owner>, std::string> owner_of(const NodeEntry& node) {
  if (node.user.empty()) return std::optional<Owner>();
  const passwd* entry = getpwnam(node.user.c_str());
  if (entry == nullptr) return Err(fmt::format("there is no user '{}'", node.user));
  if (geteuid() != 0) {
    if (entry->pw_uid == geteuid()) return std::optional<Owner>();
    return Err(fmt::format("only root can start a node as user '{}'", node.user));
  }
  Owner owner{entry->pw_uid, entry->pw_gid, std::vector<gid_t>(64)};
  int count = static_cast<int>(owner.groups.size());
  if (getgrouplist(node.user.c_str(), owner.gid, owner.groups.data(), &count) < 0)
    return Err(fmt::format("user '{}' is in more than {} groups", node.user, owner.groups.size()));
  owner.groups.resize(static_cast<std::size_t>(count));
  return std::optional(owner);
}

std::filesystem::path golden_program(const LaunchRequest& request, const NodeEntry& node) {
  const std::filesystem::path program = node.executable;
  return program.is_absolute() ? program : request.bin_folder / program;
}

/// A program in a slot does not lie where its libraries are: it gets those that this process has.
void add_own_libraries(std::vector<std::string>& environment) {
  Dl_info self{};
  if (dladdr(reinterpret_cast<const void*>(&suite_bin_folder), &self) == 0 || self.dli_fname == nullptr)
    return;
  const std::string folder = std::filesystem::absolute(self.dli_fname).parent_path().string();
  environment.push_back("LD_LIBRARY_PATH=" + folder);
}

/// A node that is confined cannot start others itself: it gets a starter, where it may have to start one.
void prepare_confinement(Preparation& p, const LaunchRequest& request, const NodeEntry& node,
                         const std::filesystem::path& program, std::uint32_t version) {
  const auto bin_folder = std::filesystem::absolute(request.bin_folder);
  const auto waiting = bin_folder / "srfs-starter";
  const auto starting = bin_folder / "srfs";
  const Trust trust = trust_in(request.deployment, node, version);
  const bool has_starter = access(waiting.c_str(), X_OK) == 0 && access(starting.c_str(), X_OK) == 0;
  if (!has_starter && trust != Trust::foreign) {
    if (request.deployment.ring.enabled && trust == Trust::own)
      log::warn("{}: {} is missing, so the node keeps its starter's privileges", node.name, waiting.string());
    return;
  }
  p.confinement = Confinement::make({request.deployment, request.var, node, program, bin_folder}, trust);
  if (!p.confinement.missing().empty())
    log::warn("{} is confined without {}", node.name, p.confinement.missing());
  if (!has_starter || trust == Trust::whole || !request.deployment.ring.enabled) return;
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends) != 0) return;
  p.starter = {{waiting.string(), starting.string(), request.deployment.file.string(),
                std::filesystem::absolute(request.var.root).string(), node.name, to_text(trust)},
               {},
               trusted_environment(bin_folder),
               {},
               Fd(ends[0]),
               Fd(ends[1])};
  for (auto& a : p.starter.arguments) p.starter.argv.push_back(a.data());
  for (auto& e : p.starter.environment) p.starter.envp.push_back(e.data());
  p.starter.argv.push_back(nullptr);
  p.starter.envp.push_back(nullptr);
  p.environment.push_back(fmt::format("{}={}", starter_variable, starter_fd));
}

Result<Preparation, std::string> prepare(const LaunchRequest& request, const NodeEntry& node,
                                         const std::filesystem::path& program, std::uint32_t version) {
  const bool in_slot = version != update::golden;
  Preparation p;
  p.executable = program.string();
  if (access(p.executable.c_str(), X_OK) != 0)
    return Err(fmt::format("{}: {}", p.executable, errno_text(errno)));
  p.arguments = {p.executable,
                 "--name",
                 node.name,
                 "--deployment",
                 request.deployment.file.string(),
                 "--var",
                 std::filesystem::absolute(request.var.root).string()};
  p.environment = environment_of(request, trust_in(request.deployment, node, version));
  if (in_slot) add_own_libraries(p.environment);
  auto owner = owner_of(node);
  if (!owner) return Err(owner.error());
  p.owner = std::move(*owner);
  prepare_confinement(p, request, node, program, version);
  for (auto& a : p.arguments) p.argv.push_back(a.data());
  for (auto& e : p.environment) p.envp.push_back(e.data());
  p.argv.push_back(nullptr);
  p.envp.push_back(nullptr);
  p.oom_score_adj = std::to_string(node.oom_score_adj);
  if (!node.control_group.empty()) {
    const auto members = control_groups / node.control_group / "cgroup.procs";
    p.control_group = Fd(open(members.c_str(), O_WRONLY | O_CLOEXEC));
  }

  const auto log = request.var.log(node.name);
  std::error_code ec;
  std::filesystem::create_directories(log.parent_path(), ec);
  if (std::filesystem::exists(log, ec) &&
      std::filesystem::file_size(log, ec) > static_cast<std::uintmax_t>(largest_log)) {
    std::filesystem::rename(log, log.string() + ".1", ec);
  }
  p.log = Fd(open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_NOFOLLOW | O_CLOEXEC, 0644));
  // A full or lost disk costs the log, not the node.
  if (!p.log) p.log = Fd(open("/dev/null", O_WRONLY | O_CLOEXEC));
  p.null = Fd(open("/dev/null", O_RDONLY | O_CLOEXEC));
  return p;
}

// From here to exec only async-signal-safe calls.

/// The hard limit is opened as far as the system permits: a node that starts another must not bind it.
void limit(__rlimit_resource resource, rlim_t soft, rlim_t hard = RLIM_INFINITY) {
  const rlimit open{soft, hard};
  if (setrlimit(resource, &open) == 0) return;
  rlimit now{};
  getrlimit(resource, &now);
  const rlimit wanted{std::min(soft, now.rlim_max), now.rlim_max};
  setrlimit(resource, &wanted);
}

void set_limits(const NodeEntry& node) {
  for (const auto resource : {RLIMIT_AS, RLIMIT_CPU, RLIMIT_FSIZE, RLIMIT_LOCKS, RLIMIT_NPROC, RLIMIT_RSS})
    limit(resource, RLIM_INFINITY);
  limit(RLIMIT_CORE, 0);
  limit(RLIMIT_DATA,
        node.memory_limit_mib > 0 ? static_cast<rlim_t>(node.memory_limit_mib) << 20 : RLIM_INFINITY);
  limit(RLIMIT_MEMLOCK, node.memory.lock ? RLIM_INFINITY : locked_octets);
  limit(RLIMIT_MSGQUEUE, 819200);
  limit(RLIMIT_NICE, 40, 40);
  limit(RLIMIT_NOFILE, open_files, most_open_files);
  limit(RLIMIT_RTPRIO, 99, 99);
  constexpr auto start_us = static_cast<rlim_t>(microseconds(real_time_in_transition).count());
  limit(RLIMIT_RTTIME, node.scheduling.policy == SchedulingPolicy::fifo ? start_us : RLIM_INFINITY);
  limit(RLIMIT_SIGPENDING, 4096);
  limit(RLIMIT_STACK, stack_octets);
}

/// A foreign node raises no limit that the suite gave it.
void bind_limits(const NodeEntry& node) {
  constexpr int niceness_0 = 20;  // as RLIMIT_NICE counts
  const auto fix = [](__rlimit_resource resource, rlim_t value) { limit(resource, value, value); };
  fix(RLIMIT_FSIZE, foreign_file_octets);
  const Scheduling& s = node.scheduling;
  fix(RLIMIT_RTPRIO, s.policy == SchedulingPolicy::fifo ? static_cast<rlim_t>(s.priority) : 0);
  fix(RLIMIT_NICE, static_cast<rlim_t>(niceness_0 - (s.nice == 0 ? flight_niceness : s.nice)));
  if (node.memory_limit_mib == 0) fix(RLIMIT_DATA, foreign_memory_octets);
  for (const auto resource : {RLIMIT_CORE, RLIMIT_DATA, RLIMIT_MEMLOCK, RLIMIT_MSGQUEUE, RLIMIT_NOFILE,
                              RLIMIT_SIGPENDING, RLIMIT_STACK}) {
    rlimit now{};
    if (getrlimit(resource, &now) == 0) fix(resource, now.rlim_cur);
  }
}

// Missing permission for any of these leaves the node running normally; it says so once itself.
void set_scheduling(const Scheduling& s) {
  cpu_set_t cpus;
  CPU_ZERO(&cpus);
  if (s.cpus.empty()) {
    for (int cpu = 0; cpu < CPU_SETSIZE; ++cpu) CPU_SET(static_cast<unsigned>(cpu), &cpus);
  } else {
    for (const int cpu : s.cpus) CPU_SET(static_cast<unsigned>(cpu), &cpus);
  }
  sched_setaffinity(0, sizeof cpus, &cpus);
  setpriority(PRIO_PROCESS, 0, s.nice);
  if (set_session_niceness(starting_niceness) != 0) set_session_niceness(s.nice);
  sched_param parameter{};
  parameter.sched_priority = s.priority;
  static constexpr std::array policies{SCHED_OTHER, SCHED_FIFO, SCHED_BATCH, SCHED_IDLE};
  sched_setscheduler(0, policies[static_cast<std::size_t>(s.policy)], &parameter);
  syscall(SYS_ioprio_set, io_priority_of_one, 0, io_priority_by_niceness);
  set_turn(shortest_turn);
  prctl(PR_SET_TIMERSLACK, timer_slack_ns, 0, 0, 0);
  prctl(PR_SET_THP_DISABLE, 0, 0, 0, 0);
  syscall(SYS_set_mempolicy, 0, nullptr, 0);  // MPOL_DEFAULT
}

/// @param capabilities  those of root that Confinement then chooses from are kept
bool become(const Owner& owner, bool capabilities) {
  if (capabilities) prctl(PR_SET_KEEPCAPS, 1, 0, 0, 0);
  return setgroups(owner.groups.size(), owner.groups.data()) == 0 &&
         setresgid(owner.gid, owner.gid, owner.gid) == 0 && setresuid(owner.uid, owner.uid, owner.uid) == 0;
}

/// In a process of its own that init adopts. It has the privileges that the node is about to lose.
void start_starter(const Preparation& p) {
  if (!p.starter.ours) return;
  const pid_t middle = fork();
  if (middle != 0) {
    if (middle > 0) waitpid(middle, nullptr, 0);
    return;
  }
  if (fork() != 0) _exit(0);
  if (dup2(p.starter.ours.get(), starter_fd) < 0) _exit(127);
  fcntl(starter_fd, F_SETFD, 0);  // dup2 leaves it on a descriptor that is there already
  syscall(SYS_close_range, static_cast<unsigned>(starter_fd) + 1U, ~0U, 0U);
  execve(p.starter.argv[0], p.starter.argv.data(), p.starter.envp.data());
  _exit(127);
}

void write_oom_score(const std::string& value) {
  const int fd = open("/proc/self/oom_score_adj", O_WRONLY | O_CLOEXEC);
  if (fd < 0) return;
  [[maybe_unused]] const ssize_t ignored = write(fd, value.data(), value.size());
  close(fd);
}

void enter_control_group(int members) {
  if (members < 0) return;
  constexpr std::string_view oneself = "0";
  [[maybe_unused]] const ssize_t ignored = write(members, oneself.data(), oneself.size());
}

[[noreturn]] void report_and_exit(int pipe_fd, const char* step) {
  Failure failure{errno, {}};
  strncpy(failure.step, step, sizeof failure.step - 1);
  [[maybe_unused]] const ssize_t ignored = write(pipe_fd, &failure, sizeof failure);
  _exit(127);
}

[[noreturn]] void become_node(const Preparation& p, const NodeEntry& node, int pipe_fd) {
  setsid();
  umask(022);
  if (chdir("/") != 0) report_and_exit(pipe_fd, "chdir");
  for (int s = 1; s < NSIG; ++s) signal(s, SIG_DFL);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);
  if (dup2(p.null.get(), STDIN_FILENO) < 0 || dup2(p.log.get(), STDOUT_FILENO) < 0 ||
      dup2(p.log.get(), STDERR_FILENO) < 0) {
    report_and_exit(pipe_fd, "dup2");
  }
  enter_control_group(p.control_group.get());
  set_limits(node);
  set_scheduling(node.scheduling);
  write_oom_score(p.oom_score_adj);
  start_starter(p);
  if (p.confinement.trust() == Trust::foreign) bind_limits(node);
  const bool is_confined = p.confinement.trust() != Trust::whole;
  if (p.owner && !become(*p.owner, is_confined)) report_and_exit(pipe_fd, "user");
  syscall(SYS_close_range, 3U, ~0U, CLOSE_RANGE_CLOEXEC);
  if (const char* failed = p.confinement.enter()) report_and_exit(pipe_fd, failed);
  // The one descriptor that stays; the pipe to the starter of this node must not be in its place.
  if (p.starter.nodes) {
    if (pipe_fd == starter_fd) pipe_fd = fcntl(pipe_fd, F_DUPFD_CLOEXEC, starter_fd + 1);
    if (dup2(p.starter.nodes.get(), starter_fd) < 0) report_and_exit(pipe_fd, "dup2");
    fcntl(starter_fd, F_SETFD, 0);
  }
  execve(p.executable.c_str(), p.argv.data(), p.envp.data());
  report_and_exit(pipe_fd, "exec");
}

/// What the starter writes into the pipe: the pid (the middle process), and a Failure (the node's process) or
/// the end of file (exec closed it). The order of the two is not fixed.
struct StartReport {
  char buffer[sizeof(pid_t) + sizeof(Failure)] = {};
  std::size_t used = 0;
  bool complete = false;

  void read_until(MonotonicTime deadline, int fd) {
    while (used < sizeof buffer) {
      pollfd entry{fd, POLLIN, 0};
      const auto left = std::chrono::ceil<milliseconds>(deadline - monotonic_now());
      const int ready = poll(&entry, 1, static_cast<int>(std::max(left, milliseconds(0)).count()));
      if (ready < 0 && errno == EINTR) continue;
      if (ready <= 0) return;
      const ssize_t n = read(fd, buffer + used, sizeof buffer - used);
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) break;
      used += static_cast<std::size_t>(n);
    }
    complete = true;
  }
  [[nodiscard]] pid_t lone_pid() const {
    pid_t pid = 0;
    if (used == sizeof pid) std::memcpy(&pid, buffer, sizeof pid);
    return pid;
  }
  [[nodiscard]] Failure failure() const {
    Failure failure{};
    // The failure is the part that is not a lone pid; both orders put its step text where it can be read.
    for (const std::size_t offset : {std::size_t{0}, sizeof(pid_t)}) {
      std::memcpy(&failure, buffer + offset, sizeof failure);
      failure.step[sizeof failure.step - 1] = '\0';
      if (std::strcmp(failure.step, "exec") == 0 || std::strcmp(failure.step, "chdir") == 0 ||
          std::strcmp(failure.step, "dup2") == 0 || std::strcmp(failure.step, "user") == 0 ||
          std::strcmp(failure.step, "no new privs") == 0 || std::strcmp(failure.step, "landlock") == 0 ||
          std::strcmp(failure.step, "seccomp") == 0)
        break;
    }
    return failure;
  }
};

/// @return the node's process, or why it did not start
Result<Process, std::string> spawn(const Preparation& p, const NodeEntry& node) {
  int pipe_ends[2];
  if (pipe2(pipe_ends, O_CLOEXEC) != 0) return Err("pipe: " + errno_text(errno));
  const Fd read_end(pipe_ends[0]);
  Fd write_end(pipe_ends[1]);
  const pid_t middle = fork();
  if (middle < 0) return Err("fork: " + errno_text(errno));
  if (middle == 0) {
    const pid_t child = fork();  // the middle process ends at once, so that init adopts the node
    if (child == 0) become_node(p, node, write_end.get());
    [[maybe_unused]] const ssize_t ignored = write(write_end.get(), &child, sizeof child);
    _exit(0);
  }
  write_end.reset();
  int status = 0;
  while (waitpid(middle, &status, 0) < 0 && errno == EINTR) {
  }
  StartReport report;
  const MonotonicTime begin = monotonic_now();
  do {
    report.read_until(monotonic_now() + longest_exec, read_end.get());
    // On a busy machine it may wait for a CPU, with the node's own niceness already.
  } while (!report.complete && process_state(report.lone_pid()) == 'R' &&
           monotonic_now() - begin < longest_wait_for_cpu);
  if (!report.complete) {  // the disk under the program does not answer
    if (const auto stuck = Process::open(report.lone_pid())) stuck->signal(SIGKILL);
    return Err(fmt::format("{}: not executed within {} ms", p.executable,
                           (monotonic_now() - begin) / milliseconds(1)));
  }
  if (report.used == sizeof(pid_t)) {
    if (report.lone_pid() <= 0) return Err(std::string("fork failed in the starter"));
    auto process = Process::open(report.lone_pid());
    if (process) return std::move(*process);
    return Err(fmt::format("{} ended at once; see its log", p.executable));
  }
  const Failure failure = report.failure();
  return Err(fmt::format("{}: {}: {}", p.executable, failure.step, errno_text(failure.error)));
}

/// The restart lock is kept until the new process can be found, so that no other process looks in between and
/// finds no instance. @return false: it ended before
bool wait_for_instance(const VarPaths& var, const std::string& node, const Process& process) {
  const MonotonicTime give_up = monotonic_now() + longest_wait_for_instance;
  while (!find_instance(var, node)) {
    if (process.wait_for_exit(milliseconds(1))) return false;
    if (monotonic_now() >= give_up) return true;
  }
  return true;
}

/// What is wrong with the program of a version; of golden that is for its start to tell.
std::optional<std::string> damage_of(const VarPaths& var, const NodeEntry& node,
                                     const update::VersionTable& table, update::VersionNumber number,
                                     ProgramCheck check) {
  const update::Version* version = table.find(number);
  if (version == nullptr) return std::nullopt;
  update::PosixVersionFiles files(versions_folder(var, node.name));
  const update::VersionStore store(files, node.name);
  if (check == ProgramCheck::hash) return store.damage(*version);
  const auto program = versions_folder(var, node.name) / store.file_of(number);
  struct stat status {};
  if (stat(program.c_str(), &status) != 0) return fmt::format("{}: {}", program.string(), errno_text(errno));
  if (static_cast<std::uint64_t>(status.st_size) != version->octets)
    return fmt::format("{}: {} octets instead of {}", program.string(), status.st_size, version->octets);
  return std::nullopt;
}

/// A process that keeps the node from its instance lock by a shared one, which no node takes: who may only
/// read the file can do no more. nullopt: none.
std::optional<Process> open_pretender(const VarPaths& var, const std::string& node) {
  const Fd fd(open(var.instance_lock(node).c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
  if (!fd) return std::nullopt;
  const auto holder = [&fd]() -> pid_t {
    struct flock lock {};
    lock.l_type = F_WRLCK;
    return fcntl(fd.get(), F_GETLK, &lock) == 0 && lock.l_type == F_RDLCK ? lock.l_pid : 0;
  };
  const pid_t pid = holder();
  if (pid <= 0) return std::nullopt;
  auto process = Process::open(pid);
  // Still the holder: then the descriptor names it, and no later process of that number.
  return process && holder() == pid ? std::move(process) : std::nullopt;
}

/// An uplinked program may keep a dead node down by such a lock.
void end_pretenders(const VarPaths& var, const std::string& node) {
  constexpr int most = 4;
  for (int i = 0; i < most; ++i) {
    const auto pretender = open_pretender(var, node);
    if (!pretender) return;
    log::warn("process {} keeps {} from its instance lock: killed", pretender->pid(), node);
    pretender->signal(SIGKILL);
    (void)pretender->wait_for_exit(longest_end_of_a_pretender);
  }
}

Result<pid_t, std::string> start_version(const LaunchRequest& request, const NodeEntry& node,
                                         update::VersionNumber number) {
  const bool in_slot = number != update::golden;
  const auto program = in_slot ? std::filesystem::absolute(versions_folder(request.var, node.name) /
                                                           fmt::format("{}.{}", node.name, number))
                               : golden_program(request, node);
  // A node without them works, and executes no telecommand: it says so. Before it is confined to them.
  if (const auto handed = hand_out_command_key(request.var, node.name); !handed)
    log::error("no command key for {}: {}", node.name, handed.error());
  const bool uplinked = trust_in(request.deployment, node, number) == Trust::foreign;
  if (const auto seal = hand_out_seal_key(request.var, node.name, uplinked); !seal)
    log::error("no key for the datagrams of {}: {}", node.name, seal.error());
  const auto prepared = prepare(request, node, program, number);
  if (!prepared) return Err(prepared.error());
  end_pretenders(request.var, node.name);
  auto process = spawn(*prepared, node);
  if (!process) return Err(process.error());
  remember_started(request.var, node.name, *process, monotonic_now(), number);
  if (!wait_for_instance(request.var, node.name, *process))
    return Err(fmt::format("{} ended before it held its instance lock; see {}", node.name,
                           request.var.log(node.name).string()));
  return process->pid();
}

/// While a node is down on purpose; believed for no longer than the lease.
class StandingIn {
 public:
  StandingIn(const VarPaths& var, const std::string& node, const std::string& by) : var_(var), node_(node) {
    write_stand_in(var, node, by, monotonic_now() + longest_stand_in);
  }
  StandingIn(const StandingIn&) = delete;
  StandingIn& operator=(const StandingIn&) = delete;
  ~StandingIn() { end_stand_in(var_, node_); }

 private:
  const VarPaths& var_;
  const std::string& node_;
};

/// For starts that no observer of the ring writes down. Blocks on the disk.
void record_fallback(const LaunchRequest& request, const NodeEntry& node, const Launched& launched) {
  if (const auto settled = settle_versions(request.var, node.name); !settled)
    log::error("versions of {}: {}", node.name, settled.error());
  FaultRecord record;
  record.utc = system_utc_now();
  record.monotonic = monotonic_now();
  record.boot = kernel_boot_id().value_or("unknown");
  record.observer = "launcher";
  record.subject = node.name;
  record.detail = "start: " + request.cause;
  record.reason = to_text(*launched.fallback);
  record.version = launched.version;
  record.failed_version = launched.fallback->from;
  if (const auto written = FaultLedger(request.var).append(record); !written)
    log::error("cannot record the fault of {} in the ledger: {}", node.name, written.error());
}

}  // namespace

std::string environment_for_nodes() {
  std::string lines;
  for (const char* name : passed_on) {
    if (const char* value = std::getenv(name)) lines += fmt::format("{}={}\n", name, value);
  }
  return lines;
}

std::filesystem::path suite_bin_folder() {
  if (const char* told = std::getenv(bin_folder_variable); told != nullptr && *told != '\0') return told;
  std::error_code ec;
  return std::filesystem::read_symlink("/proc/self/exe", ec).parent_path();
}

Result<RestartLock, RestartLock::Refusal> RestartLock::take(const VarPaths& var, const std::string& node) {
  auto path = var.restart_lock(node);
  // Where others may write, they could hold the lock.
  if (!var.make_run_folder()) {
    path = var.memory() / path.filename();
    if (const auto made = open_private_folder(var.memory(), true, var.owner()); !made)
      return Err(Refusal{false, made.error().message});
  }
  while (true) {
    Fd fd = open_lock_file(path);
    if (!fd) {
      const auto in_memory = var.memory() / path.filename();
      if (path == in_memory)
        return Err(Refusal{false, fmt::format("{}: {}", path.string(), errno_text(errno))});
      path = in_memory;  // a full or lost disk must not keep a node down
      if (const auto made = open_private_folder(var.memory(), true, var.owner()); !made)
        return Err(Refusal{false, made.error().message});
      continue;
    }
    if (flock(fd.get(), LOCK_EX | LOCK_NB) != 0)
      return Err(Refusal{true, fmt::format("{} is being started by another process", node)});
    struct stat status {};
    if (fstat(fd.get(), &status) == 0 && status.st_nlink > 0) return RestartLock(std::move(fd));
    // The end of the suite removed the file before we had the lock: that locks nothing.
  }
}

RestartLock::~RestartLock() {
  // Not by closing alone: a child that another thread forks at this moment has the descriptor too.
  if (fd_) flock(fd_.get(), LOCK_UN);
}

Result<pid_t, std::string> launch(const LaunchRequest& request, const NodeEntry& node, nanoseconds patience) {
  const MonotonicTime deadline = monotonic_now() + patience;
  auto lock = RestartLock::take(request.var, node.name);
  while (!lock && lock.error().held && monotonic_now() < deadline) {
    const timespec pause{0, 2'000'000};
    nanosleep(&pause, nullptr);
    lock = RestartLock::take(request.var, node.name);
  }
  if (std::filesystem::exists(request.var.stopping_flag()))
    return Err(std::string("the suite is being stopped"));
  // Also without the lock: another starter has won, and its process is as good as ours.
  if (const auto running = find_instance(request.var, node.name)) return running->pid;
  if (const auto starting = find_starting(request.var, node.name)) return starting->process.pid();
  if (!lock) return Err(lock.error().text);
  const auto launched = launch_locked(request, node, *lock, ProgramCheck::hash);
  if (!launched) {
    (void)settle_versions(request.var, node.name);  // what was set aside on the way
    return Err(launched.error());
  }
  count_start_on_disk(request, node);
  if (launched->fallback) record_fallback(request, node, *launched);
  return launched->pid;
}

Result<Launched, std::string> launch_locked(const LaunchRequest& request, const NodeEntry& node,
                                            const RestartLock& /*held*/, ProgramCheck check) {
  // The caller may not know yet that it was removed; its process would then belong to no suite.
  if (node.added && read_added_nodes(request.var).added.find(node.name) == nullptr)
    return Err(fmt::format("{} was removed from the suite", node.name));
  // Before the start: a starter that is killed right after it must not leave the next death uncounted.
  DeathHistory history = read_deaths(request.var, node.name);
  count_start(history, monotonic_now());
  write_deaths(request.var, node.name, history);
  const auto [table, problem] = read_versions(request.var, node.name);
  if (!problem.empty()) log::error("versions of {}: {}", node.name, problem);
  std::string first_failure;
  for (const update::VersionNumber number : table.start_order()) {
    if (number == update::golden && node.added) {
      if (first_failure.empty()) first_failure = no_golden;
      continue;
    }
    auto bad = damage_of(request.var, node, table, number, check);
    std::string failure = bad.value_or("");
    if (!bad) {
      const auto pid = start_version(request, node, number);
      if (pid) {
        Launched launched{*pid, number, std::nullopt};
        if (number != table.active())
          launched.fallback = VersionFallback{table.active(), number, first_failure};
        return launched;
      }
      failure = pid.error();
      bad = damage_of(request.var, node, table, number, ProgramCheck::hash);
      const update::Version* trial = table.on_trial();
      if (!bad && trial != nullptr && trial->number == number) bad = failure;
    }
    if (first_failure.empty()) first_failure = bad.value_or(failure);
    const bool golden_is_gone =
        number == update::golden && access(golden_program(request, node).c_str(), X_OK) != 0;
    if (!bad && !golden_is_gone) break;
    if (number == update::golden) continue;
    log::error("version {} of {} cannot be started: {}", number, node.name, failure);
    set_aside(request.var, node.name, number, *bad);
  }
  return Err(first_failure);
}

Result<std::optional<Launched>, std::string> use_version(const LaunchRequest& request, const NodeEntry& node,
                                                         std::uint32_t version, milliseconds probation,
                                                         const std::string& self) {
  if (version == update::golden && node.added) return Err(std::string(no_golden));
  // Before anything is locked or stopped, so that nothing waits for it.
  const auto before_change = read_versions(request.var, node.name).table;
  const bool leaves_a_good_one = before_change.active() == before_change.last_good();
  if (leaves_a_good_one && version != before_change.active() && before_change.find(version) != nullptr) {
    if (const auto taken = snapshot_state(request.var, node.name, before_change.active()); !taken)
      log::error("cannot snapshot the state of {}: {}", node.name, taken.error());
  }
  auto lock = RestartLock::take(request.var, node.name);
  const MonotonicTime deadline = monotonic_now() + longest_wait_for_lock;
  while (!lock && lock.error().held && monotonic_now() < deadline) {
    poll(nullptr, 0, 2);
    lock = RestartLock::take(request.var, node.name);
  }
  if (!lock) return Err(lock.error().text);
  const auto changed =
      change_versions(request.var, node.name, [&](update::VersionStore& store) -> Result<void, std::string> {
        const update::VersionTable table = store.read().table;
        if (const update::Version* wanted = table.find(version)) {
          if (const auto bad = store.damage(*wanted)) return Err(*bad);
        }
        return store.use(version, probation, "another version was requested");
      });
  if (!changed) return Err(changed.error());
  const auto running = open_instance(request.var, node.name);
  const auto before = last_started(request.var, node.name);
  const bool runs_already = running && before && before->pid == running->pid() && before->version == version;
  if (!running || runs_already || node.name == self) return std::optional<Launched>();
  const StandingIn standing_in(request.var, node.name, self.empty() ? "srfs" : self);
  const MonotonicTime stopped = monotonic_now();
  running->signal(SIGTERM);
  running->signal(SIGCONT);  // a stopped process would sleep through it
  if (!running->wait_for_exit(longest_wait_for_end)) {
    running->signal(SIGKILL);
    if (!running->wait_for_exit(longest_wait_for_end))
      return Err(std::string("its process cannot be killed"));
  }
  if (std::filesystem::exists(request.var.stopping_flag())) return std::optional<Launched>();
  auto launched = launch_locked(request, node, *lock, ProgramCheck::size);
  if (!launched) return Err(launched.error());
  launched->stopped = stopped;
  count_start_on_disk(request, node);
  if (launched->fallback) record_fallback(request, node, *launched);
  return std::optional(*launched);
}

void count_suite_start(const LaunchRequest& request, const NodeEntry& node) {
  const auto before = read_versions(request.var, node.name).table;
  const update::Version* trial = before.on_trial();
  if (trial == nullptr) return;
  const auto counted =
      change_versions(request.var, node.name, [](update::VersionStore& store) -> Result<void, std::string> {
        if (store.read().table.on_trial() == nullptr) return {};  // what was set aside is settled by now
        return store.count_reset();
      });
  if (!counted)
    set_aside(request.var, node.name, trial->number, "its starts cannot be counted: " + counted.error());
  const auto now = read_versions(request.var, node.name).table;
  const update::Version* version = now.find(trial->number);
  if (version == nullptr || version->state != update::VersionState::failed) return;
  log::error("version {} of {} has failed: {}", version->number, node.name, version->reason);
  record_fallback(request, node,
                  {0, now.active(), VersionFallback{version->number, now.active(), version->reason}});
}

void count_start_on_disk(const LaunchRequest& request, const NodeEntry& node) {
  StartRecord record = read_start_record(request.var, node.name);
  ++record.starts;
  if (request.cause != "up") {
    ++record.restarts;
    record.last_cause = request.cause;
  }
  write_start_record(request.var, node.name, record);
}

}  // namespace srfs::suite
