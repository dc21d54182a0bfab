// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/sandbox_layers.hpp"

#include <array>
#include <cerrno>
#include <memory>

#include <fcntl.h>
#include <fmt/format.h>
#include <grp.h>
#include <linux/capability.h>
#include <linux/landlock.h>
#include <net/if.h>
#include <sched.h>
#include <seccomp.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "base/background.hpp"
#include "base/process.hpp"

namespace srfs::update {
namespace {

namespace fs = std::filesystem;

Step failed(const char* name) {
  return {name, errno};
}

int write_text(const char* file, const std::string& text) {
  const Fd fd(open(file, O_WRONLY | O_CLOEXEC));
  if (!fd) return -1;
  return write(fd.get(), text.data(), text.size()) < 0 ? -1 : 0;
}

/// Public files that programs need; no more of /etc is visible.
constexpr std::array public_files{"/etc/ld.so.cache", "/etc/alternatives", "/etc/localtime", "/etc/hosts",
                                  "/etc/nsswitch.conf"};
constexpr std::array system_folders{"/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32"};
constexpr std::array devices{"/dev/null", "/dev/zero", "/dev/full", "/dev/random", "/dev/urandom"};

/// libseccomp leaves out those that an architecture does not have.
constexpr std::array refused_calls{
    // other processes
    "ptrace", "process_vm_readv", "process_vm_writev", "pidfd_getfd", "perf_event_open", "userfaultfd",
    // mounts and namespaces
    "mount", "umount2", "pivot_root", "chroot", "move_mount", "open_tree", "fsopen", "fsconfig", "fsmount",
    "fspick", "mount_setattr", "unshare", "setns",
    // files by other ways
    "name_to_handle_at", "open_by_handle_at", "mknod", "mknodat", "fanotify_init", "lookup_dcookie",
    "quotactl", "acct",
    // kernel
    "bpf", "keyctl", "add_key", "request_key", "io_uring_setup", "io_uring_enter", "io_uring_register",
    "kexec_load", "kexec_file_load", "init_module", "finit_module", "delete_module",
    // machine
    "reboot", "swapon", "swapoff", "syslog", "vhangup", "sethostname", "setdomainname", "settimeofday",
    "clock_settime", "clock_adjtime", "adjtimex", "iopl", "ioperm", "modify_ldt", "uselib", "ustat"};

/// @p path of the old root at the same place of the new one.
int show(const fs::path& path, const fs::path& root, std::uint64_t attributes) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return errno == ENOENT ? 0 : -1;
  const Fd tree(open_tree(AT_FDCWD, path.c_str(), OPEN_TREE_CLONE | OPEN_TREE_CLOEXEC | AT_RECURSIVE));
  if (!tree) return -1;
  mount_attr wanted{};
  wanted.attr_set = attributes;
  if (mount_setattr(tree.get(), "", AT_EMPTY_PATH | AT_RECURSIVE, &wanted, sizeof wanted) != 0) return -1;
  const fs::path place = root / path.relative_path();
  std::error_code ec;
  fs::create_directories(S_ISDIR(status.st_mode) ? place : place.parent_path(), ec);
  if (!S_ISDIR(status.st_mode)) {
    const Fd empty(open(place.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0644));
  }
  return move_mount(tree.get(), "", AT_FDCWD, place.c_str(), MOVE_MOUNT_F_EMPTY_PATH);
}

}  // namespace

Step map_user(uid_t user, gid_t group) {
  if (write_text("/proc/self/setgroups", "deny") != 0) return failed("user namespace: groups");
  if (write_text("/proc/self/uid_map", fmt::format("{0} {0} 1", user)) != 0)
    return failed("user namespace: user");
  if (write_text("/proc/self/gid_map", fmt::format("{0} {0} 1", group)) != 0)
    return failed("user namespace: group");
  return {};
}

Step enter_view(const Confinement& confinement, const WorkFolder& work, bool own_processes) {
  if (mount(nullptr, "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0) return failed("private mounts");
  // The new root covers the work folder's place, so a plain one is taken hold of before.
  Fd work_mount;
  if (!work.in_memory()) {
    work_mount = Fd(open_tree(AT_FDCWD, work.path().c_str(), OPEN_TREE_CLONE | OPEN_TREE_CLOEXEC));
    if (!work_mount) return failed("work folder");
  }
  const fs::path& root = work.path();
  std::vector<std::pair<fs::path, fs::path>> links;
  if (mount("srfs_lane", root.c_str(), "tmpfs", MS_NOSUID | MS_NODEV, "mode=755,size=1m,nr_inodes=4096") != 0)
    return failed("new root");
  constexpr std::uint64_t read_only = MOUNT_ATTR_RDONLY | MOUNT_ATTR_NOSUID | MOUNT_ATTR_NODEV;
  std::error_code ec;
  for (const fs::path folder : system_folders) {
    if (fs::is_symlink(folder, ec)) {
      fs::create_symlink(fs::read_symlink(folder, ec), root / folder.relative_path(), ec);
    } else if (show(folder, root, read_only) != 0) {
      return failed("system folders");
    }
  }
  for (const char* file : public_files)
    if (show(file, root, read_only) != 0) return failed("public files");
  for (const char* device : devices)
    if (show(device, root, MOUNT_ATTR_NOSUID | MOUNT_ATTR_NOEXEC) != 0) return failed("devices");
  for (const fs::path& path : confinement.readable)
    if (show(path, root, read_only) != 0) return failed("readable paths");

  const fs::path place = root / work.path().relative_path();
  fs::create_directories(place, ec);
  const int work_fd = work.in_memory() ? work.fd() : work_mount.get();
  if (move_mount(work_fd, "", AT_FDCWD, place.c_str(), MOVE_MOUNT_F_EMPTY_PATH) != 0)
    return failed("work folder");
  fs::create_symlink(work.path() / "tmp", root / "tmp", ec);
  fs::create_symlink(work.path() / "shm", root / "dev/shm", ec);
  fs::create_directory(root / "proc", ec);
  // Without it (a container may refuse) compilers and nodes work too.
  if (own_processes)
    (void)mount("proc", (root / "proc").c_str(), "proc", MS_NOSUID | MS_NODEV | MS_NOEXEC, nullptr);

  mount_attr wanted{};
  wanted.attr_set = MOUNT_ATTR_RDONLY;
  if (mount_setattr(AT_FDCWD, root.c_str(), 0, &wanted, sizeof wanted) != 0) return failed("read-only root");
  if (chdir(root.c_str()) != 0 || syscall(SYS_pivot_root, ".", ".") != 0) return failed("change of root");
  if (umount2(".", MNT_DETACH) != 0 || chdir("/") != 0) return failed("old root");
  return {};
}

Step bring_up_loopback() {
  const Fd socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  ifreq request{.ifr_ifrn = {.ifrn_name = "lo"}, .ifr_ifru = {}};
  request.ifr_flags = IFF_UP | IFF_RUNNING;
  if (!socket || ioctl(socket.get(), SIOCSIFFLAGS, &request) != 0) return failed("loopback");
  return {};
}

Step take_lowest_priority() {
  const sched_param none{};
  if (setpriority(PRIO_PROCESS, 0, 19) != 0) return failed("nice 19");
  if (sched_setscheduler(0, SCHED_IDLE, &none) != 0) return failed("SCHED_IDLE");
  // EAGAIN: without privileges it may be set ten times a second by all.
  if (const int error = set_session_niceness(19); error != 0 && error != EAGAIN)
    return {"niceness of the session", error};
  if (syscall(SYS_ioprio_set, io_priority_of_one, 0, idle_io_priority) != 0) return failed("idle I/O");
  return {};
}

Step limit_resources(const Limits& limits, bool own_user) {
  const auto limit = [](__rlimit_resource resource, rlim_t value, rlim_t grace = 0) {
    const rlimit wanted{value, value + grace};
    return setrlimit(resource, &wanted);
  };
  // 1, not 0: with a program as core_pattern the kernel takes 0 for "as much as you like".
  if (limit(RLIMIT_CORE, 1) != 0) return failed("RLIMIT_CORE");
  if (limit(RLIMIT_CPU, static_cast<rlim_t>(limits.cpu.count()), 2) != 0) return failed("RLIMIT_CPU");
  if (limit(RLIMIT_FSIZE, limits.file_octets) != 0) return failed("RLIMIT_FSIZE");
  if (limit(RLIMIT_NOFILE, limits.open_files) != 0) return failed("RLIMIT_NOFILE");
  if (limit(RLIMIT_MEMLOCK, 64U << 10) != 0) return failed("RLIMIT_MEMLOCK");
  if (limit(RLIMIT_MSGQUEUE, 0) != 0) return failed("RLIMIT_MSGQUEUE");
  if (limit(RLIMIT_SIGPENDING, 256) != 0) return failed("RLIMIT_SIGPENDING");
  if (limit(RLIMIT_NICE, 0) != 0 || limit(RLIMIT_RTPRIO, 0) != 0) return failed("RLIMIT_NICE");
#ifndef SRFS_SANITIZED                               // they map terabytes
  constexpr rlim_t reserved_addresses = 4ULL << 30;  // stacks and heaps of threads, never touched
  if (limit(RLIMIT_AS, limits.memory_octets + reserved_addresses) != 0) return failed("RLIMIT_AS");
  if (limit(RLIMIT_DATA, limits.memory_octets) != 0) return failed("RLIMIT_DATA");
#endif
  // Above the control group's, which can tell that it was reached.
  if (own_user && limit(RLIMIT_NPROC, limits.processes + 4) != 0) return failed("RLIMIT_NPROC");
  return {};
}

Step forbid_new_privileges() {
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 ? Step{} : failed("no_new_privs");
}

Step restrict_files(const Confinement& confinement, const WorkFolder& work) {
  const long version = syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
  if (version < 0) return failed("Landlock");
  constexpr std::uint64_t truncate = 1U << 14;  // newer than Debian 12's headers
  constexpr std::uint64_t read = LANDLOCK_ACCESS_FS_READ_FILE;
  constexpr std::uint64_t read_below = read | LANDLOCK_ACCESS_FS_READ_DIR | LANDLOCK_ACCESS_FS_EXECUTE;
  std::uint64_t all = (LANDLOCK_ACCESS_FS_MAKE_SYM << 1U) - 1;  // version 1
  if (version >= 2) all |= LANDLOCK_ACCESS_FS_REFER;
  if (version >= 3) all |= truncate;
  const landlock_ruleset_attr handled{.handled_access_fs = all};
  const Fd rules(static_cast<int>(syscall(SYS_landlock_create_ruleset, &handled, sizeof handled, 0)));
  if (!rules) return failed("Landlock");
  const auto allow = [&](const fs::path& path, std::uint64_t of_folder, std::uint64_t of_file) {
    const Fd place(open(path.c_str(), O_PATH | O_CLOEXEC));
    struct stat status {};
    if (!place || fstat(place.get(), &status) != 0) return errno == ENOENT ? 0L : -1L;
    const landlock_path_beneath_attr rule{.allowed_access = S_ISDIR(status.st_mode) ? of_folder : of_file,
                                          .parent_fd = place.get()};
    return syscall(SYS_landlock_add_rule, rules.get(), LANDLOCK_RULE_PATH_BENEATH, &rule, 0);
  };
  const std::uint64_t program = read | LANDLOCK_ACCESS_FS_EXECUTE;
  bool complete = true;
  for (const char* path : system_folders) complete &= allow(path, read_below, program) == 0;
  for (const char* path : public_files) complete &= allow(path, read_below, read) == 0;
  for (const char* path : devices) complete &= allow(path, 0, read | LANDLOCK_ACCESS_FS_WRITE_FILE) == 0;
  for (const fs::path& path : confinement.readable) complete &= allow(path, read_below, program) == 0;
  complete &= allow(work.path(), all, read) == 0;
  if (!complete) return failed("Landlock rules");
  if (syscall(SYS_landlock_restrict_self, rules.get(), 0) != 0) return failed("Landlock");
  return {};
}

Step drop_privileges(std::optional<std::pair<uid_t, gid_t>> user) {
  if (user) {
    if (setgroups(0, nullptr) != 0) return failed("groups");
    if (setresgid(user->second, user->second, user->second) != 0) return failed("group");
    if (setresuid(user->first, user->first, user->first) != 0) return failed("user");
  }
  __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
  const std::array<__user_cap_data_struct, 2> none{};
  if (syscall(SYS_capset, &header, none.data()) != 0) return failed("capabilities");
  return {};
}

Step filter_system_calls(AllowedSockets sockets) {
  const std::unique_ptr<void, decltype(&seccomp_release)> filter(seccomp_init(SCMP_ACT_ALLOW),
                                                                 &seccomp_release);
  if (!filter) return {"seccomp", ENOMEM};
  int result = 0;
  const auto set = [&](scmp_filter_attr attribute, std::uint32_t value) {
    if (result == 0) result = seccomp_attr_set(filter.get(), attribute, value);
  };
  const auto refuse = [&](int call, int error, const std::vector<scmp_arg_cmp>& when = {}) {
    if (result == 0)
      result = seccomp_rule_add_array(filter.get(), SCMP_ACT_ERRNO(static_cast<unsigned>(error)), call,
                                      static_cast<unsigned>(when.size()), when.data());
  };
  set(SCMP_FLTATR_ACT_BADARCH, SCMP_ACT_KILL_PROCESS);  // x32, too
  set(SCMP_FLTATR_API_SYSRAWRC, 1);                     // the kernel's errno
  for (const char* call : refused_calls) refuse(seccomp_syscall_resolve_name(call), EPERM);
  refuse(SCMP_SYS(clone3), ENOSYS);  // its flags lie in memory; the C library then takes clone
  for (const std::uint64_t name_space :
       {CLONE_NEWNS, CLONE_NEWUSER, CLONE_NEWPID, CLONE_NEWNET, CLONE_NEWIPC, CLONE_NEWUTS, CLONE_NEWCGROUP})
    refuse(SCMP_SYS(clone), EPERM, {{0, SCMP_CMP_MASKED_EQ, name_space, name_space}});
  // libseccomp has no rule for "none of these".
  // All 64 bits are compared, though the kernel looks at the lower 32 alone: others set are refused.
  for (std::uint64_t family = 0; family < AF_MAX; ++family)
    if (!sockets.allow(family)) refuse(SCMP_SYS(socket), EACCES, {{0, SCMP_CMP_EQ, family, 0}});
  refuse(SCMP_SYS(socket), EACCES, {{0, SCMP_CMP_GE, AF_MAX, 0}});
  if (result == 0) result = seccomp_load(filter.get());
  return {"seccomp", -result};
}

}  // namespace srfs::update
