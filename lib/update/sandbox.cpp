// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/sandbox.hpp"

#include <array>
#include <cerrno>
#include <csignal>
#include <fstream>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sched.h>
#include <spawn.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/signalfd.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/statfs.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/process.hpp"
#include "update/control_group.hpp"
#include "update/sandbox_layers.hpp"

namespace srfs::update {
namespace {

namespace fs = std::filesystem;

constexpr std::array<std::string_view, layer_count> layer_names{
    "user",  "files",  "processes",     "network",      "ipc",    "host_name",
    "quota", "memory", "process_count", "system_calls", "limits", "priority"};

constexpr std::size_t index_of(Layer layer) {
  return static_cast<std::size_t>(layer);
}

// ---- work folder

/// Also what is nested too deep for an ordinary walk.
void remove_tree(const fs::path& path) {
  std::array<const char*, 5> command{"rm", "-rf", "--", path.c_str(), nullptr};
  pid_t pid = 0;
  if (posix_spawn(&pid, "/bin/rm", nullptr, nullptr, const_cast<char**>(command.data()), nullptr) == 0)
    waitpid(pid, nullptr, 0);
}

/// A file system of its own, not yet seen anywhere.
Fd make_memory_folder(const Limits& limits, uid_t user, gid_t group) {
  const Fd context(fsopen("tmpfs", FSOPEN_CLOEXEC));
  if (!context) return {};
  const auto set = [&](const char* key, const std::string& value) {
    return fsconfig(context.get(), FSCONFIG_SET_STRING, key, value.c_str(), 0) == 0;
  };
  if (!set("size", std::to_string(limits.work_octets)) || !set("nr_inodes", std::to_string(limits.files)) ||
      !set("uid", std::to_string(user)) || !set("gid", std::to_string(group)) || !set("mode", "700"))
    return {};
  if (fsconfig(context.get(), FSCONFIG_CMD_CREATE, nullptr, nullptr, 0) != 0) return {};
  return Fd(fsmount(context.get(), FSMOUNT_CLOEXEC, MOUNT_ATTR_NOSUID | MOUNT_ATTR_NODEV));
}

bool write_all(int fd, std::string_view content) {
  while (!content.empty()) {
    const ssize_t n = write(fd, content.data(), content.size());
    if (n < 0 && errno != EINTR) return false;
    if (n > 0) content.remove_prefix(static_cast<std::size_t>(n));
  }
  return true;
}

// ---- what the confined side reports, over a SOCK_SEQPACKET pair; the other end's silence is an end, too

struct Message {
  enum class Stage : std::uint8_t { confined, refused, ended } stage = Stage::refused;
  LayerSet in_force;
  std::array<Step, layer_count> failures;  ///< literals: same addresses in both processes
  Step fatal;
  int status = 0;  ///< as waitpid() has it
  double cpu_s = 0;
  std::uint64_t peak_octets = 0;
};
static_assert(std::is_trivially_copyable_v<Message>);

void tell(int channel, const Message& message) {
  (void)send(channel, &message, sizeof message, MSG_NOSIGNAL);
}

struct Channels {
  Fd channel, output, log;  ///< one side of each
};

/// In the confined process' keeper and in the process itself.
class Confined {
 public:
  Confined(const Confinement& confinement, const WorkFolder& work, const std::function<int()>& program,
           ControlGroup& group, Channels channels, Message layers, bool own_processes,
           bool own_user_namespace)
      : confinement_(confinement),
        work_(work),
        program_(program),
        group_(group),
        channels_(std::move(channels)),
        message_(layers),
        own_processes_(own_processes),
        own_user_namespace_(own_user_namespace),
        root_(geteuid() == 0) {}

  /// The keeper: sets up what it shares with the program, starts it, ends what it leaves behind.
  [[noreturn]] void keep() {
    sigset_t all;
    sigfillset(&all);
    sigprocmask(SIG_SETMASK, &all, nullptr);
    sigset_t child;
    sigemptyset(&child);
    sigaddset(&child, SIGCHLD);
    const Fd children(signalfd(-1, &child, SFD_CLOEXEC));
    if (own_processes_) prctl(PR_SET_PDEATHSIG, SIGKILL);
    prctl(PR_SET_CHILD_SUBREAPER, 1);
    setsid();
    char go = 0;
    if (recv(channels_.channel.get(), &go, 1, 0) != 1) _exit(0);

    if (message_.fatal.ok()) enter_namespaces();
    if (message_.fatal.ok()) {
      const pid_t program = fork();
      if (program == 0) become_program();
      channels_.output.reset();
      channels_.log.reset();
      wait_for(program, children.get());
    }
    message_.stage = message_.fatal.ok() ? Message::Stage::ended : Message::Stage::refused;
    tell(channels_.channel.get(), message_);
    _exit(0);
  }

 private:
  void note(Layer layer, const Step& step) {
    if (step.ok()) {
      message_.in_force.set(index_of(layer));
    } else {
      message_.failures[index_of(layer)] = step;
    }
  }

  [[nodiscard]] Step enter(int name_space, const char* name) const {
    if (!confinement_.namespaces) return {name, ENOTSUP};
    return unshare(name_space) == 0 ? Step{} : Step{name, errno};
  }

  void enter_namespaces() {
    Step network = enter(CLONE_NEWNET, "network namespace");
    if (network.ok() && confinement_.network) network = bring_up_loopback();
    note(Layer::network, network);
    note(Layer::ipc, enter(CLONE_NEWIPC, "IPC namespace"));
    note(Layer::host_name, enter(CLONE_NEWUTS, "UTS namespace"));
    const Step mounts = enter(CLONE_NEWNS, "mount namespace");
    const Step view = mounts.ok() ? enter_view(confinement_, work_, own_processes_) : mounts;
    note(Layer::files, view);
    // Half a view is none; and a folder in memory is nowhere without one.
    if (!view.ok() && (mounts.ok() || work_.in_memory())) message_.fatal = view;
  }

  [[noreturn]] void become_program() {
    const Fd empty(open("/dev/null", O_RDONLY | O_CLOEXEC));
    dup2(empty.get(), STDIN_FILENO);
    dup2(channels_.output.get(), STDOUT_FILENO);
    dup2(channels_.log.get(), STDERR_FILENO);
    setsid();
    umask(022);
    // The keeper stays outside: what it needs to end the others must not be their limit.
    group_.join();
    note(Layer::memory, {"control group", group_.memory_refusal()});
    note(Layer::process_count, {"control group", group_.process_refusal()});
    if (chdir(work_.path().c_str()) != 0) message_.fatal = {"work folder", errno};
    if (confinement_.limits.lowest_priority) note(Layer::priority, take_lowest_priority());
    const bool own_user = root_ || own_user_namespace_;
    note(Layer::limits, limit_resources(confinement_.limits, own_user));
    const Step privileges = forbid_new_privileges();
    if (!message_.in_force.test(index_of(Layer::files)) && privileges.ok()) {
      const Step first_choice = message_.failures[index_of(Layer::files)];
      note(Layer::files, restrict_files(confinement_, work_));
      // The first choice's reason is reported, too, where the second one holds.
      if (message_.in_force.test(index_of(Layer::files)))
        message_.failures[index_of(Layer::files)] = first_choice;
    }
    const Step user = drop_privileges(root_ ? std::optional(std::pair(confinement_.user, confinement_.group))
                                            : std::nullopt);
    note(Layer::user, user.ok() ? privileges : user);
    // Root must not stay root: nothing else would hold it.
    if (root_ && !user.ok()) message_.fatal = user;
    const bool alone = message_.in_force.test(index_of(Layer::network)) && has_own_view();
    note(Layer::system_calls,
         filter_system_calls({.internet = confinement_.network, .local = confinement_.network && alone}));
    prctl(PR_SET_PDEATHSIG, SIGKILL);

    const bool complete = (confinement_.required & ~message_.in_force).none();
    message_.stage = complete && message_.fatal.ok() ? Message::Stage::confined : Message::Stage::refused;
    tell(channels_.channel.get(), message_);
    close_range(STDERR_FILENO + 1, ~0U, 0);
    if (message_.stage == Message::Stage::refused) _exit(0);
    for (int number = 1; number < NSIG; ++number) (void)signal(number, SIG_DFL);
    sigset_t none;
    sigemptyset(&none);
    sigprocmask(SIG_SETMASK, &none, nullptr);
    clearenv();
    const int code = program_();
    fflush(nullptr);
    _exit(code);
  }

  /// No sockets of other programs are visible among the files.
  [[nodiscard]] bool has_own_view() const { return message_.failures[index_of(Layer::files)].ok(); }

  void wait_for(pid_t program, int children) {
    std::array<pollfd, 2> entries{{{children, POLLIN, 0}, {channels_.channel.get(), POLLIN, 0}}};
    bool ended = false;
    while (!ended) {
      (void)poll(entries.data(), entries.size(), -1);
      signalfd_siginfo child;
      if (entries[0].revents != 0) {
        [[maybe_unused]] const ssize_t ignored = read(children, &child, sizeof child);
      }
      int status = 0;
      pid_t pid = 0;
      while ((pid = waitpid(-1, &status, WNOHANG)) > 0) {
        if (pid != program) continue;
        message_.status = status;
        ended = true;
      }
      if (entries[1].revents != 0) break;  // asked to end it, or the other end is gone
    }
    end_all(program, ended);
    rusage used{};
    getrusage(RUSAGE_CHILDREN, &used);
    const auto in_s = [](const timeval& t) {
      return static_cast<double>(t.tv_sec) + static_cast<double>(t.tv_usec) * 1e-6;
    };
    message_.cpu_s = in_s(used.ru_utime) + in_s(used.ru_stime);
    message_.peak_octets = static_cast<std::uint64_t>(used.ru_maxrss) << 10U;
  }

  void end_all(pid_t program, bool ended) {
    while (true) {
      kill_all();
      int status = 0;
      pid_t pid = waitpid(-1, &status, 0);
      while (pid > 0) {
        if (pid == program && !ended) message_.status = status;
        pid = waitpid(-1, &status, WNOHANG);
      }
      if (pid < 0 && errno == ECHILD) return;
    }
  }

  void kill_all() const {
    if (own_processes_) {
      kill(-1, SIGKILL);  // this is process 1 of its namespace: all the others there
      return;
    }
    // Our children; theirs become ours. None of them may have more.
    std::ifstream children(fmt::format("/proc/self/task/{}/children", syscall(SYS_gettid)));
    for (pid_t child = 0; children >> child;) {
      const rlimit none{0, 0};
      prlimit(child, RLIMIT_NPROC, &none, nullptr);
      kill(child, SIGKILL);
    }
    // All processes of the user, which has no others: none can fork away from that.
    if (root_ && fork() == 0) {
      if (setresuid(confinement_.user, confinement_.user, confinement_.user) == 0) kill(-1, SIGKILL);
      _exit(0);
    }
  }

  const Confinement& confinement_;
  const WorkFolder& work_;
  const std::function<int()>& program_;
  ControlGroup& group_;
  Channels channels_;
  Message message_;
  const bool own_processes_;
  const bool own_user_namespace_;
  const bool root_;
};

/// A child in a process namespace of its own where that is possible, and a user namespace where it needs one.
struct Forked {
  pid_t pid;
  Step processes;  ///< why it has no process namespace
  bool own_user_namespace = false;
};
Forked fork_keeper(bool namespaces) {
  if (!namespaces) return {fork(), {"process namespace", ENOTSUP}};
  const auto clone = [](unsigned long flags) {
    return static_cast<pid_t>(syscall(SYS_clone, flags | SIGCHLD, nullptr, nullptr, nullptr, nullptr));
  };
  if (const pid_t pid = clone(CLONE_NEWPID); pid >= 0) return {pid, {}};
  const Step refusal{"process namespace", errno};
  // A process that is root already gains nothing by it, and would be root outside.
  if (geteuid() != 0) {
    if (const pid_t pid = clone(CLONE_NEWUSER | CLONE_NEWPID); pid >= 0) return {pid, {}, true};
  }
  return {fork(), refusal};
}

struct Pair {
  Fd ours, theirs;
};
struct Pairs {
  Pair channel, output, log;
};
Pair make_pipe() {
  int ends[2] = {-1, -1};
  if (pipe2(ends, O_CLOEXEC) != 0) return {};
  fcntl(ends[0], F_SETFL, O_NONBLOCK);
  return {Fd(ends[0]), Fd(ends[1])};
}
Pair make_channel() {
  int ends[2] = {-1, -1};
  (void)socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, ends);
  return {Fd(ends[0]), Fd(ends[1])};
}

/// At most what a full pipe holds, so that a program that writes without end does not hold its judge up.
/// @return false: no more will come
bool pass_on(int fd, const std::function<void(std::string_view)>& listener) {
  char chunk[16384];
  for (int i = 0; i < 4; ++i) {
    const ssize_t n = read(fd, chunk, sizeof chunk);
    if (n == 0) return false;
    if (n < 0) return errno == EAGAIN || errno == EINTR;
    if (listener) listener({chunk, static_cast<std::size_t>(n)});
  }
  return true;
}

Layers layers_of(const Message& message) {
  Layers layers{message.in_force, {}};
  for (std::size_t i = 0; i < layer_count; ++i) {
    const Step& step = message.failures[i];
    if (!step.ok())
      layers.failures.push_back(
          {static_cast<Layer>(i), fmt::format("{}: {}", step.name, errno_text(step.error))});
  }
  return layers;
}

std::string missing_layers(LayerSet missing) {
  std::string text;
  for (std::size_t i = 0; i < layer_count; ++i)
    if (missing.test(i)) text += fmt::format("{}{}", text.empty() ? "" : ", ", layer_names[i]);
  return text;
}

/// The side of the process that started the keeper.
class Observer {
 public:
  Observer(const Confinement& confinement, const WorkFolder& work, const Listener& listener,
           Channels channels, pid_t keeper, MonotonicTime begin)
      : confinement_(confinement),
        work_(work),
        listener_(listener),
        channels_(std::move(channels)),
        keeper_(keeper),
        begin_(begin) {}

  /// Lets the keeper begin, passes on what the program writes, ends it at its limits. Returns when nothing is
  /// left.
  void follow() {
    constexpr milliseconds look_period{50};
    (void)send(channels_.channel.get(), "g", 1, MSG_NOSIGNAL);
    std::array<pollfd, 4> entries{{{channels_.channel.get(), POLLIN, 0},
                                   {channels_.output.get(), POLLIN, 0},
                                   {channels_.log.get(), POLLIN, 0},
                                   {listener_.cancel_fd, POLLIN, 0}}};
    while (true) {
      (void)poll(entries.data(), entries.size(), static_cast<int>(look_period.count()));
      if (entries[1].revents != 0 && !pass_on(channels_.output.get(), listener_.output)) entries[1].fd = -1;
      if (entries[2].revents != 0 && !pass_on(channels_.log.get(), listener_.log)) entries[2].fd = -1;
      if (entries[3].revents != 0) {
        entries[3].fd = -1;
        end_it(Ended::Stop::cancelled);
      }
      if (entries[0].revents != 0 && !take_message()) break;
      look_at_limits();
    }
    waitpid(keeper_, nullptr, 0);
    (void)pass_on(channels_.output.get(), listener_.output);
    (void)pass_on(channels_.log.get(), listener_.log);
    if (last_) ended_.layers = layers_of(*last_);
  }

  /// How it ended, after follow().
  [[nodiscard]] Result<Ended, SandboxFailure> judge(const ControlGroup& group) {
    if (!confined_) return judge_setup();
    if (last_->stage == Message::Stage::ended) {
      if (WIFEXITED(last_->status)) ended_.exit_code = WEXITSTATUS(last_->status);
      if (WIFSIGNALED(last_->status)) ended_.signal = WTERMSIG(last_->status);
    } else {
      ended_.signal = SIGKILL;  // with its keeper
    }
    ended_.seconds = std::chrono::duration<double>(monotonic_now() - begin_).count();
    ended_.cpu_s = last_->cpu_s;
    ended_.peak_octets = group.peak_octets().value_or(last_->peak_octets);
    ended_.out_of_memory = group.out_of_memory();
    ended_.too_many_processes = group.too_many_processes();
    if (ended_.stop == Ended::Stop::none && work_.is_full(confinement_.limits))
      ended_.stop = Ended::Stop::quota;
    return ended_;
  }

 private:
  void end_it(Ended::Stop why) {
    if (told_) return;
    ended_.stop = why;
    told_ = monotonic_now();
    shutdown(channels_.channel.get(), SHUT_WR);
  }

  /// @return false: the keeper has ended
  bool take_message() {
    Message message;
    if (recv(channels_.channel.get(), &message, sizeof message, MSG_DONTWAIT) !=
        static_cast<ssize_t>(sizeof message))
      return false;
    confined_ = confined_ || message.stage == Message::Stage::confined;
    // What the program said of its layers is kept; the keeper adds how it ended.
    if (last_ && message.stage == Message::Stage::ended) {
      message.in_force = last_->in_force;
      message.failures = last_->failures;
      if (last_->stage == Message::Stage::refused) {
        message.stage = Message::Stage::refused;
        message.fatal = last_->fatal;
      }
    }
    last_ = message;
    return true;
  }

  void look_at_limits() {
    constexpr seconds patience{5};  // with its end, once it is asked to
    const MonotonicTime now = monotonic_now();
    if (now - begin_ > confinement_.limits.wall) end_it(Ended::Stop::wall_time);
    if (!told_ && work_.is_full(confinement_.limits)) end_it(Ended::Stop::quota);
    if (told_ && now - *told_ > patience) kill(keeper_, SIGKILL);
  }

  /// Why the program did not run.
  [[nodiscard]] Result<Ended, SandboxFailure> judge_setup() const {
    if (ended_.stop != Ended::Stop::none) return ended_;
    if (!last_) return Err(SandboxFailure{"ended during setup", ended_.layers});
    const LayerSet missing = confinement_.required & ~last_->in_force;
    if (!last_->fatal.ok())
      return Err(SandboxFailure{fmt::format("{}: {}", last_->fatal.name, errno_text(last_->fatal.error)),
                                ended_.layers});
    return Err(SandboxFailure{
        missing.any() ? "required but not available: " + missing_layers(missing) : "ended during setup",
        ended_.layers});
  }

  const Confinement& confinement_;
  const WorkFolder& work_;
  const Listener& listener_;
  Channels channels_;
  const pid_t keeper_;
  const MonotonicTime begin_;
  Ended ended_;
  std::optional<Message> last_;
  bool confined_ = false;
  std::optional<MonotonicTime> told_;  // to end
};

}  // namespace

std::string_view to_text(Layer layer) {
  return layer_names[index_of(layer)];
}

std::optional<Layer> layer_of(std::string_view text) {
  for (std::size_t i = 0; i < layer_count; ++i)
    if (layer_names[i] == text) return static_cast<Layer>(i);
  return std::nullopt;
}

LayerSet set_of(std::initializer_list<Layer> layers) {
  LayerSet set;
  for (const Layer layer : layers) set.set(index_of(layer));
  return set;
}

Result<WorkFolder, std::string> WorkFolder::make(const fs::path& path, const Confinement& confinement) {
  if (!path.is_absolute()) return Err(fmt::format("{}: not an absolute path", path.string()));
  remove_tree(path);
  std::error_code ec;
  fs::create_directories(path, ec);
  const bool root = geteuid() == 0;
  const uid_t user = root ? confinement.user : geteuid();
  const gid_t group = root ? confinement.group : getegid();
  int refusal = ENOTSUP;
  Fd fd;
  if (confinement.namespaces) {
    fd = make_memory_folder(confinement.limits, user, group);
    refusal = fd ? 0 : errno;
  }
  const bool in_memory = static_cast<bool>(fd);
  if (!in_memory) {
    fd = Fd(open(path.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
    if (!fd || fchmod(fd.get(), 0700) != 0 || fchown(fd.get(), user, group) != 0)
      return Err(fmt::format("{}: {}", path.string(), errno_text(errno)));
  }
  for (const char* name : {"tmp", "shm"}) {
    if (mkdirat(fd.get(), name, 0700) != 0 || fchownat(fd.get(), name, user, group, 0) != 0)
      return Err(fmt::format("{}/{}: {}", path.string(), name, errno_text(errno)));
  }
  return WorkFolder(path, std::move(fd), in_memory, refusal);
}

WorkFolder::~WorkFolder() {
  if (fd_) remove_tree(path_);
}

std::optional<std::string> WorkFolder::put(const fs::path& name, std::string_view content,
                                           bool executable) const {
  fs::path folder;
  for (const fs::path& part : name.parent_path()) {
    folder /= part;
    if (mkdirat(fd_.get(), folder.c_str(), 0755) != 0 && errno != EEXIST)
      return fmt::format("{}: {}", folder.string(), errno_text(errno));
  }
  const Fd file(
      openat(fd_.get(), name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, executable ? 0755 : 0644));
  if (!file || !write_all(file.get(), content) || fchmod(file.get(), executable ? 0755 : 0644) != 0)
    return fmt::format("{}: {}", name.string(), errno_text(errno));
  return std::nullopt;
}

Result<Fd, std::string> WorkFolder::take(const std::string& name, std::uint64_t limit) const {
  Fd file(openat(fd_.get(), name.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  struct stat status {};
  if (!file || fstat(file.get(), &status) != 0) return Err(fmt::format("{}: {}", name, errno_text(errno)));
  if (!S_ISREG(status.st_mode)) return Err(fmt::format("{}: not a regular file", name));
  if (static_cast<std::uint64_t>(status.st_size) > limit) return Err(fmt::format("{}: too large", name));
  return file;
}

bool WorkFolder::is_full(const Limits& limits) const {
  if (in_memory_) {
    struct statfs used {};
    return fstatfs(fd_.get(), &used) == 0 && (used.f_bfree == 0 || used.f_ffree == 0);
  }
  std::uint64_t octets = 0;
  std::uint64_t files = 0;
  std::error_code ec;
  fs::recursive_directory_iterator entry(path_, fs::directory_options::skip_permission_denied, ec);
  for (; !ec && entry != fs::recursive_directory_iterator(); entry.increment(ec)) {
    struct stat status {};
    if (lstat(entry->path().c_str(), &status) == 0)
      octets += static_cast<std::uint64_t>(status.st_blocks) * 512;
    if (++files >= limits.files || octets >= limits.work_octets || entry.depth() > 256) return true;
  }
  return false;
}

Result<Ended, SandboxFailure> run_confined(const Confinement& confinement, const WorkFolder& work,
                                           const std::function<int()>& program, const Listener& listener) {
  if (geteuid() == 0 && confinement.user == 0) return Err(SandboxFailure{"root cannot be confined", {}});
  Pairs pairs{make_channel(), make_pipe(), make_pipe()};
  if (!pairs.channel.ours || !pairs.output.ours || !pairs.log.ours)
    return Err(SandboxFailure{"cannot create pipes: " + errno_text(errno), {}});
  ControlGroup group(confinement.limits.memory_octets, confinement.limits.processes);

  const uid_t user = geteuid();
  const gid_t user_group = getegid();
  fflush(nullptr);  // what waits to be written is not the program's
  const MonotonicTime begin = monotonic_now();
  const Forked keeper = fork_keeper(confinement.namespaces);
  if (keeper.pid < 0) return Err(SandboxFailure{"cannot create a process: " + errno_text(errno), {}});
  if (keeper.pid == 0) {
    pairs.channel.ours.reset();
    Message message;
    const auto note = [&](Layer layer, const Step& step) {
      message.failures[index_of(layer)] = step;
      if (step.ok()) message.in_force.set(index_of(layer));
    };
    const Step mapped = keeper.own_user_namespace ? map_user(user, user_group) : Step{};
    note(Layer::processes, keeper.processes);
    note(Layer::quota, {"file system in memory", work.refusal()});
    message.fatal = mapped;
    Confined(confinement, work, program, group,
             {std::move(pairs.channel.theirs), std::move(pairs.output.theirs), std::move(pairs.log.theirs)},
             message, keeper.processes.ok() && getpid() == 1, keeper.own_user_namespace)
        .keep();
  }
  pairs.channel.theirs.reset();
  pairs.output.theirs.reset();
  pairs.log.theirs.reset();
  Observer observer(confinement, work, listener,
                    {std::move(pairs.channel.ours), std::move(pairs.output.ours), std::move(pairs.log.ours)},
                    keeper.pid, begin);
  observer.follow();
  return observer.judge(group);
}

int execute(const std::vector<std::string>& command, const fs::path& work) {
  const std::array environment{std::string("PATH=/usr/bin:/bin"), "HOME=" + work.string(),
                               "TMPDIR=" + (work / "tmp").string(), std::string("LANG=C.UTF-8")};
  std::vector<char*> arguments;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  std::vector<char*> variables;
  for (const std::string& variable : environment) variables.push_back(const_cast<char*>(variable.c_str()));
  variables.push_back(nullptr);
  execve(arguments[0], arguments.data(), variables.data());
  fmt::print(stderr, "{}: {}\n", command[0], errno_text(errno));
  return 127;
}

}  // namespace srfs::update
