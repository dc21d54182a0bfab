// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/confinement.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <memory>
#include <sstream>

#include <dlfcn.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <linux/capability.h>
#include <linux/filter.h>
#include <linux/landlock.h>
#include <linux/seccomp.h>
#include <sched.h>
#include <seccomp.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "base/background.hpp"
#include "base/file.hpp"
#include "base/private_file.hpp"
#include "suite/command_keys.hpp"

namespace srfs::suite {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t bit_of(unsigned capability) {
  return 1ULL << capability;
}
constexpr unsigned highest_capability = 63;
/// Stands in the filter for the process' own number, which the fork gives it.
constexpr std::uint32_t own_pid_mark = 0x5AFE51D0;

/// libseccomp leaves out those that an architecture does not have.
constexpr std::array refused_to_all{
    // other processes
    "ptrace", "process_vm_readv", "process_vm_writev", "pidfd_getfd", "perf_event_open", "userfaultfd",
    "kcmp",
    // mounts and namespaces
    "mount", "umount2", "pivot_root", "chroot", "move_mount", "open_tree", "fsopen", "fsconfig", "fsmount",
    "fspick", "mount_setattr", "unshare", "setns",
    // files by other ways
    "open_by_handle_at", "fanotify_init", "lookup_dcookie", "quotactl", "acct",
    // kernel
    "bpf", "keyctl", "add_key", "request_key", "io_uring_setup", "io_uring_enter", "io_uring_register",
    "kexec_load", "kexec_file_load", "init_module", "finit_module", "delete_module",
    // machine
    "reboot", "swapon", "swapoff", "syslog", "vhangup", "sethostname", "setdomainname", "iopl", "ioperm",
    "modify_ldt", "uselib", "ustat", "personality"};
constexpr int io_priority_of_one = 1;  // IOPRIO_WHO_PROCESS
constexpr std::array refused_without_clock{"settimeofday", "clock_settime", "clock_adjtime", "adjtimex"};
/// A foreign node sends no signal to others, holds no lock of others, starts nothing. (kill, tgkill, clone
/// have rules of their own.)
constexpr std::array refused_to_foreign{"tkill",
                                        "rt_sigqueueinfo",
                                        "rt_tgsigqueueinfo",
                                        "pidfd_send_signal",
                                        "flock",
                                        "fork",
                                        "vfork",
                                        "mknod",
                                        "mknodat",
                                        "msgget",
                                        "semget",
                                        "shmget",
                                        "mq_open",
                                        "memfd_create",
                                        "memfd_secret",
                                        "migrate_pages",
                                        "move_pages",
                                        "process_madvise",
                                        "process_mrelease"};
/// Flags of mmap. RLIMIT_DATA counts neither of these, nor what memfd_create and /dev/zero give.
constexpr std::array memory_beside_its_limit{MAP_SHARED | MAP_ANONYMOUS, MAP_GROWSDOWN};
/// Their first argument is the process, or thread, that changes; 0: the caller.
constexpr std::array of_the_caller_alone{"prlimit64", "sched_setscheduler", "sched_setparam", "sched_setattr",
                                         "sched_setaffinity"};
/// The kernel sends a signal of one's choice to whom one chooses, when there is something to read; holds who
/// opens a file until its lease is given back; names nobody as the holder of a lock.
constexpr std::array refused_of_fcntl{F_SETOWN, F_SETOWN_EX, F_SETSIG, F_SETLEASE, F_OFD_SETLK, F_OFD_SETLKW};
constexpr std::array refused_of_ioctl{FIOSETOWN, SIOCSPGRP};

constexpr std::array system_folders{"/usr", "/bin", "/sbin", "/lib", "/lib32", "/lib64", "/libx32"};
constexpr std::array public_files{"/etc/ld.so.cache",     "/etc/ld.so.conf", "/etc/ld.so.conf.d",
                                  "/etc/alternatives",    "/etc/localtime",  "/etc/hosts",
                                  "/etc/nsswitch.conf",   "/etc/passwd",     "/etc/group",
                                  "/etc/ssl/openssl.cnf", "/etc/host.conf",  "/etc/resolv.conf"};
constexpr std::array devices{"/dev/null", "/dev/full", "/dev/random", "/dev/urandom"};

/// Where the package keeps the settings of srfs_rescue, keys among them (packaging/srfs-start).
constexpr const char* rescue_folder = "/var/lib/srfs-rescue";

constexpr std::uint64_t read_file = LANDLOCK_ACCESS_FS_READ_FILE;
constexpr std::uint64_t read_below = read_file | LANDLOCK_ACCESS_FS_READ_DIR;
constexpr std::uint64_t execute = LANDLOCK_ACCESS_FS_EXECUTE;
constexpr std::uint64_t write_file = LANDLOCK_ACCESS_FS_WRITE_FILE;
constexpr std::uint64_t truncate_file = 1ULL << 14;  // newer than Debian 12's headers
constexpr std::uint64_t version_1 = (LANDLOCK_ACCESS_FS_MAKE_SYM << 1U) - 1;
constexpr std::uint64_t of_files = read_file | execute | write_file | truncate_file;

/// Rules of Landlock: what is not allowed is refused.
class FileRules {
 public:
  explicit FileRules(long version) : all_(version_1) {
    if (version >= 2) all_ |= LANDLOCK_ACCESS_FS_REFER;
    if (version >= 3) all_ |= truncate_file;
    const landlock_ruleset_attr handled{.handled_access_fs = all_};
    rules_ = Fd(static_cast<int>(syscall(SYS_landlock_create_ruleset, &handled, sizeof handled, 0)));
  }
  [[nodiscard]] std::uint64_t all() const { return all_; }
  /// What is missing needs no rule.
  void allow(const fs::path& path, std::uint64_t access) {
    const Fd place(open(path.c_str(), O_PATH | O_CLOEXEC));
    struct stat status {};
    if (!rules_ || !place || fstat(place.get(), &status) != 0) return;
    if (!S_ISDIR(status.st_mode)) access &= of_files;
    const landlock_path_beneath_attr rule{.allowed_access = access & all_, .parent_fd = place.get()};
    (void)syscall(SYS_landlock_add_rule, rules_.get(), LANDLOCK_RULE_PATH_BENEATH, &rule, 0);
  }
  /// All below @p folder, except for what lies below @p hidden.
  void allow_all_but(const fs::path& folder, const std::vector<fs::path>& hidden, std::uint64_t access) {
    const auto contains = [](const fs::path& outer, const fs::path& inner) {
      return std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end()).first == outer.end();
    };
    if (std::none_of(hidden.begin(), hidden.end(), [&](const fs::path& h) { return contains(folder, h); }))
      return allow(folder, access);
    std::error_code ec;
    for (const auto& entry : fs::directory_iterator(folder, ec)) {
      if (std::find(hidden.begin(), hidden.end(), entry.path()) != hidden.end()) continue;
      if (entry.is_symlink(ec)) continue;  // leads to what has a rule of its own
      allow_all_but(entry.path(), hidden, access);
    }
  }
  [[nodiscard]] Fd take() { return std::move(rules_); }

 private:
  std::uint64_t all_;
  Fd rules_;
};

/// "/dev/gpiochip3" of "gpiochip:/dev/gpiochip3?0=9"; VAR/run/gps_tty of "serial:run/gps_tty", which leads to
/// its terminal
fs::path device_file(const fs::path& var, const std::string& uri) {
  const auto begin = uri.find(':');
  if (begin == std::string::npos) return {};
  return var / uri.substr(begin + 1, uri.find('?') - begin - 1);
}

bool is_for_foreign(const std::string& device) {
  return device != "watchdog" && device != "rs422";
}

std::vector<fs::path> foreign_devices(const Confinement::Place& place) {
  std::vector<fs::path> files;
  for (const auto& [key, uri] : place.deployment.devices) {
    if (is_for_foreign(key)) files.push_back(device_file(place.var.root, uri));
  }
  return files;
}

/// Simulated devices are local sockets. On hardware a foreign node needs none: they lead to systemd and
/// D-Bus.
bool needs_local_sockets(const Deployment& deployment) {
  return std::any_of(deployment.devices.begin(), deployment.devices.end(), [](const auto& device) {
    return is_for_foreign(device.first) && device.second.starts_with("sim:");
  });
}

/// An argument of 32 bits: the kernel does not look at what stands above them.
scmp_arg_cmp is(unsigned argument, int value) {
  return {argument, SCMP_CMP_MASKED_EQ, UINT32_MAX, static_cast<std::uint32_t>(value)};
}

scmp_arg_cmp has(unsigned argument, int flags) {
  return {argument, SCMP_CMP_MASKED_EQ, static_cast<std::uint32_t>(flags), static_cast<std::uint32_t>(flags)};
}

std::string program_of(const NodeEntry& node) {
  return fs::path(node.executable).filename().string();
}

/// A regular file in a folder of this user, made when it is missing, to have a rule.
void make_file(const fs::path& path) {
  const Fd fd(open(path.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, S_IRUSR | S_IWUSR));
}

/// DDS takes receive buffers of 4 MiB (ros/transport.cpp). The package's sysctl.conf permits them to all; on
/// a machine that is not prepared the capability does.
bool buffers_need_a_privilege() {
  constexpr long wanted = 4L << 20;
  std::ifstream file("/proc/sys/net/core/rmem_max");
  long most = 0;
  return !(file >> most) || most < wanted;
}

/// flight_niceness. The package's unit permits it by a limit; who may not raise limits has the capability
/// alone.
bool weight_needs_a_privilege() {
  constexpr int niceness_0 = 20;  // as RLIMIT_NICE counts
  rlimit limit{};
  if (getrlimit(RLIMIT_NICE, &limit) == 0 && limit.rlim_max >= niceness_0 - flight_niceness) return false;
  const auto own = privileges_from(srfs::read_file("/proc/self/status", 65536).value_or(""));
  return (own.capabilities & bit_of(CAP_SYS_RESOURCE)) == 0;
}

fs::path library_folder() {
  Dl_info self{};
  if (dladdr(reinterpret_cast<const void*>(&privileges_from), &self) == 0 || self.dli_fname == nullptr)
    return {};
  std::error_code ec;
  return fs::canonical(self.dli_fname, ec).parent_path();
}

/// Of what proves orders, what it proves its own with.
void allow_order_keys(FileRules& rules, const Confinement::Place& place, Trust trust) {
  for (const fs::path& folder : order_keys_for(place.var, place.node.name, trust == Trust::foreign))
    rules.allow(folder, read_below);
}

void allow_foreign(FileRules& rules, const Confinement::Place& place) {
  const VarPaths& var = place.var;
  const std::string& name = place.node.name;
  for (const char* folder : system_folders) rules.allow(folder, read_below | execute);
  for (const char* file : public_files) rules.allow(file, read_below);
  for (const char* device : devices) rules.allow(device, read_file | write_file);
  for (const char* folder : {"/proc", "/sys"}) rules.allow(folder, read_below);
  for (const fs::path& device : foreign_devices(place)) rules.allow(device, read_file | write_file);
  // The installation, or a build tree and its sources: programs, libraries, the mission's dictionary.
  const fs::path prefix = library_folder().parent_path();
  rules.allow_all_but(prefix, {var.root}, read_below | execute);
  rules.allow(prefix.parent_path() / "msgs", read_below);
  rules.allow(prefix.parent_path() / "mission", read_below);
  if (!place.deployment.dictionary.empty()) rules.allow(place.deployment.dictionary, read_below);
  if (const char* folder = std::getenv("SRFS_MISSION_DIR")) rules.allow(folder, read_below);
  rules.allow(place.program, read_file | execute);
  rules.allow(place.deployment.file, read_file);
  std::error_code ec;
  for (const auto& entry : fs::directory_iterator(place.deployment.file.parent_path(), ec)) {
    if (entry.path().extension() == ".yaml") rules.allow(entry.path(), read_file);  // what it may extend
  }
  // VAR: its own state; of the rest only what the ring and the suite tell all.
  for (const std::string& folder : {name, std::string("ring"), std::string("suite")})
    fs::create_directories(var.state(folder), ec);
  rules.allow(var.state(name), rules.all() & ~execute);
  for (const auto& folder : {var.state("ring"), var.state("suite"), var.boot(), var.run(), var.memory()})
    rules.allow(folder, read_below);
  make_file(var.instance_lock(name));
  rules.allow(var.instance_lock(name), read_file | write_file | truncate_file);
  for (const char* file : {".heartbeat", "_ids_lost"}) {  // the latter is a payload's mark
    make_file(var.memory() / (name + file));
    rules.allow(var.memory() / (name + file), read_file | write_file | truncate_file);
  }
  if (program_of(place.node).starts_with("image_")) rules.allow(var.root / "images", rules.all() & ~execute);
  allow_order_keys(rules, place, Trust::foreign);
}

/// Reads what its user may, except for keys and their copies; writes below VAR, except for programs, and to
/// devices; executes nothing but programs of the system and of SRFS.
void allow_own(FileRules& rules, const Confinement::Place& place) {
  const fs::path& var = place.var.root;
  const bool commands = program_of(place.node) == "ttc_node";
  std::vector<fs::path> hidden;
  if (!commands)
    hidden = {order_keys(place.var), var / "keys",   var / "golden",
              var / "set_aside",     var / "ground", rescue_folder};
  // What it makes in VAR itself it could not make later.
  std::error_code ec;
  fs::create_directories(place.var.state(place.node.name), ec);
  if (program_of(place.node).starts_with("image_")) fs::create_directories(var / "images", ec);
  // Nor read what others make there later: the ring reads the versions of its nodes.
  const fs::path versions = var / "versions";
  if (fs::create_directories(versions, ec) && geteuid() == 0) [[maybe_unused]]
    const int ignored = lchown(versions.c_str(), place.var.owner().value_or(0), static_cast<gid_t>(-1));
  rules.allow_all_but("/", hidden, read_below);
  if (!commands) hidden.push_back(var / "versions");
  rules.allow_all_but(var, hidden, rules.all() & ~execute);
  (void)open_private_folder(place.var.memory(), true, place.var.owner());
  rules.allow_all_but(place.var.memory().parent_path(), hidden, rules.all() & ~execute);
  allow_order_keys(rules, place, Trust::own);
  for (const char* folder : {"/dev", "/proc"}) rules.allow(folder, read_below | write_file | truncate_file);
  for (const char* folder : system_folders) rules.allow(folder, read_below | execute);
  for (const fs::path& folder : {library_folder(), place.bin_folder})
    rules.allow(folder, read_below | execute);
  rules.allow(place.program, read_file | execute);
}

/// Root without privileges cannot come to it, for instance below an ordinary user's home.
bool is_closed_to_root(fs::path folder) {
  std::error_code ec;
  folder = fs::absolute(folder, ec);
  for (; !folder.empty(); folder = folder.parent_path()) {
    struct stat status {};
    if (stat(folder.c_str(), &status) == 0 && status.st_uid != 0 && (status.st_mode & S_IXOTH) == 0)
      return true;
    if (folder == folder.parent_path()) break;
  }
  return false;
}

}  // namespace

const char* to_text(Trust trust) {
  static constexpr std::array names{"whole", "own", "foreign"};
  return names[static_cast<std::size_t>(trust)];
}

Trust trust_in(const Deployment& deployment, const NodeEntry& node, std::uint32_t version) {
  if (node.added) return Trust::foreign;
  if (program_of(node) == "maintenance_node") return Trust::whole;
  return version != 0 && !deployment.on_command_path(node.name) ? Trust::foreign : Trust::own;
}

std::uint64_t capabilities_of(const Deployment& deployment, const NodeEntry& node, Trust trust) {
  if (trust == Trust::whole) return ~0ULL;
  if (trust == Trust::foreign) return 0;
  if (program_of(node) == "timing_node") return bit_of(CAP_SYS_TIME);
  if (program_of(node) != "can_switcher_node") return 0;
  // It kills who holds the bus beyond its slot, whoever's process that is.
  const bool kills_others = std::any_of(deployment.nodes.begin(), deployment.nodes.end(),
                                        [&](const NodeEntry& other) { return other.user != node.user; });
  return bit_of(CAP_NET_ADMIN) | (kills_others ? bit_of(CAP_KILL) : 0);  // restarts a bus that is off
}

Confinement Confinement::make(const Place& place, Trust trust) {
  Confinement c;
  c.trust_ = trust;
  if (trust == Trust::whole) return c;
  c.capabilities_ = capabilities_of(place.deployment, place.node, trust);
  if (trust == Trust::own && buffers_need_a_privilege()) c.capabilities_ |= bit_of(CAP_NET_ADMIN);
  if (trust == Trust::own && weight_needs_a_privilege()) c.capabilities_ |= bit_of(CAP_SYS_NICE);
  // Root in the folder of another user works by these.
  if (geteuid() == 0 && place.var.owner().value_or(0) != 0 && place.node.user.empty())
    c.capabilities_ |= bit_of(CAP_DAC_OVERRIDE) | bit_of(CAP_CHOWN) | bit_of(CAP_FOWNER);
  if (trust == Trust::own && geteuid() == 0 &&
      (is_closed_to_root(place.program.parent_path()) || is_closed_to_root(place.var.root) ||
       is_closed_to_root(place.deployment.file.parent_path())))
    c.capabilities_ |= bit_of(CAP_DAC_READ_SEARCH);
  c.allow_files(place);
  c.make_filter(place);
  return c;
}

void Confinement::allow_files(const Place& place) {
  const long version = syscall(SYS_landlock_create_ruleset, nullptr, 0, LANDLOCK_CREATE_RULESET_VERSION);
  if (version < 0) {
    missing_ = "files (Landlock): " + errno_text(errno);
    return;
  }
  if (version < 2) {  // it would let nobody move a file into another folder
    missing_ = "files (Landlock): older than Linux 5.19";
    return;
  }
  FileRules rules(version);
  if (trust_ == Trust::foreign) {
    allow_foreign(rules, place);
  } else {
    allow_own(rules, place);
  }
  files_ = rules.take();
  if (!files_) missing_ = "files (Landlock): " + errno_text(errno);
}

void Confinement::make_filter([[maybe_unused]] const Place& place) {
#if defined(SRFS_SANITIZED) || defined(__SANITIZE_THREAD__)
  missing_ += "; system calls: a sanitizer needs them";
#else
  // A kernel that has filters finds that there is none at this address.
  if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, nullptr, 0, 0) == 0 || errno != EFAULT) {
    missing_ += "; system calls (seccomp): " + errno_text(errno);
    return;
  }
  const std::unique_ptr<void, decltype(&seccomp_release)> filter(seccomp_init(SCMP_ACT_ALLOW),
                                                                 &seccomp_release);
  int result = filter ? 0 : -ENOMEM;
  const auto refuse = [&](int call, int error, const std::vector<scmp_arg_cmp>& when = {}) {
    if (result == 0 && call != __NR_SCMP_ERROR)
      result = seccomp_rule_add_array(filter.get(), SCMP_ACT_ERRNO(static_cast<unsigned>(error)), call,
                                      static_cast<unsigned>(when.size()), when.data());
  };
  if (result == 0) result = seccomp_attr_set(filter.get(), SCMP_FLTATR_ACT_BADARCH, SCMP_ACT_KILL_PROCESS);
  if (result == 0) result = seccomp_attr_set(filter.get(), SCMP_FLTATR_CTL_OPTIMIZE, 2);
  for (const char* call : refused_to_all) refuse(seccomp_syscall_resolve_name(call), EPERM);
  if ((capabilities_ & bit_of(CAP_SYS_TIME)) == 0) {
    for (const char* call : refused_without_clock) refuse(seccomp_syscall_resolve_name(call), EPERM);
  }
  refuse(SCMP_SYS(clone3), ENOSYS);  // its flags lie in memory; the C library then takes clone
  for (const std::uint64_t name_space :
       {CLONE_NEWNS, CLONE_NEWUSER, CLONE_NEWPID, CLONE_NEWNET, CLONE_NEWIPC, CLONE_NEWUTS, CLONE_NEWCGROUP})
    refuse(SCMP_SYS(clone), EPERM, {{0, SCMP_CMP_MASKED_EQ, name_space, name_space}});
  if (trust_ == Trust::foreign) {
    for (const char* call : refused_to_foreign) refuse(seccomp_syscall_resolve_name(call), EPERM);
    refuse(SCMP_SYS(clone), EPERM, {{0, SCMP_CMP_MASKED_EQ, CLONE_THREAD, 0}});
    for (const int call : {SCMP_SYS(kill), SCMP_SYS(tgkill)})
      refuse(call, EPERM, {{0, SCMP_CMP_NE, own_pid_mark, 0}});
    for (const int flags : memory_beside_its_limit) refuse(SCMP_SYS(mmap), EPERM, {has(3, flags)});
    for (const char* call : of_the_caller_alone)
      refuse(seccomp_syscall_resolve_name(call), EPERM, {{0, SCMP_CMP_NE, 0, 0}});
    for (const int call : {SCMP_SYS(setpriority), SCMP_SYS(ioprio_set)}) {
      const scmp_datum_t one_process = call == SCMP_SYS(setpriority) ? PRIO_PROCESS : io_priority_of_one;
      refuse(call, EPERM, {{0, SCMP_CMP_NE, one_process, 0}});
      refuse(call, EPERM, {{1, SCMP_CMP_NE, 0, 0}});
    }
    for (const int command : refused_of_fcntl) refuse(SCMP_SYS(fcntl), EPERM, {is(1, command)});
    for (const int request : refused_of_ioctl) refuse(SCMP_SYS(ioctl), EPERM, {is(1, request)});
    if (!needs_local_sockets(place.deployment)) refuse(SCMP_SYS(socket), EACCES, {is(0, AF_UNIX)});
  }
  const Fd text(memfd_create("filter", MFD_CLOEXEC));
  if (result == 0) result = text ? seccomp_export_bpf(filter.get(), text.get()) : -errno;
  const off_t octets = result == 0 ? lseek(text.get(), 0, SEEK_END) : 0;
  filter_.resize(static_cast<std::size_t>(octets) / sizeof(sock_filter));
  if (result == 0 && pread(text.get(), filter_.data(), static_cast<std::size_t>(octets), 0) != octets)
    result = -EIO;
  if (result == 0) return;
  filter_.clear();
  missing_ += fmt::format("{}system calls (seccomp): {}", missing_.empty() ? "" : "; ", errno_text(-result));
#endif
}

void keep_capabilities(std::uint64_t wanted) {
  // After a change of the user what is permitted is not effective, and the bounding set needs CAP_SETPCAP.
  __user_cap_header_struct of_self{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
  __user_cap_data_struct before[2] = {};
  if (syscall(SYS_capget, &of_self, before) != 0) return;
  for (auto& half : before) half.effective = half.permitted;
  (void)syscall(SYS_capset, &of_self, before);
  for (unsigned capability = 0; capability <= highest_capability; ++capability) {
    if ((wanted >> capability & 1U) == 0) (void)prctl(PR_CAPBSET_DROP, capability, 0, 0, 0);
  }
  (void)prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_CLEAR_ALL, 0, 0, 0);
  __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
  __user_cap_data_struct sets[2] = {};
  if (syscall(SYS_capget, &header, sets) != 0) return;
  for (unsigned half = 0; half < 2; ++half) {
    const auto of_half = static_cast<std::uint32_t>(wanted >> 32U * half);
    sets[half] = {sets[half].effective & of_half, sets[half].permitted & of_half, 0};
  }
  (void)syscall(SYS_capset, &header, sets);
}

namespace {

/// What root has after exec anyhow; another user only what is ambient.
void keep_through_exec(std::uint64_t wanted) {
  if (geteuid() == 0) return;
  __user_cap_header_struct header{.version = _LINUX_CAPABILITY_VERSION_3, .pid = 0};
  __user_cap_data_struct sets[2] = {};
  if (syscall(SYS_capget, &header, sets) != 0) return;
  for (auto& half : sets) half.inheritable = half.permitted;
  if (syscall(SYS_capset, &header, sets) != 0) return;
  for (unsigned number = 0; number <= highest_capability; ++number) {
    if ((wanted >> number & 1U) != 0) (void)prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_RAISE, number, 0, 0);
  }
}

/// The weight of its session is its own affair (base/process.hpp).
void allow_own_weight(int rules) {
  const int file = open("/proc/self/autogroup", O_PATH | O_CLOEXEC);
  if (file < 0) return;
  const landlock_path_beneath_attr rule{.allowed_access = read_file | write_file, .parent_fd = file};
  (void)syscall(SYS_landlock_add_rule, rules, LANDLOCK_RULE_PATH_BENEATH, &rule, 0);
  close(file);
}

}  // namespace

const char* Confinement::enter() const {
  if (trust_ == Trust::whole) return nullptr;
  keep_capabilities(capabilities_);
  keep_through_exec(capabilities_);
  if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0) return "no new privs";
  allow_own_weight(files_.get());
  if (files_ && syscall(SYS_landlock_restrict_self, files_.get(), 0) != 0) return "landlock";
  if (filter_.empty()) return nullptr;
  // The number of this process is known from here on. The memory is the child's own copy.
  auto* const program = const_cast<sock_filter*>(filter_.data());
  const auto own_pid = static_cast<std::uint32_t>(getpid());
  for (std::size_t i = 0; i < filter_.size(); ++i) {
    if (program[i].k == own_pid_mark) program[i].k = own_pid;
  }
  const sock_fprog whole{static_cast<unsigned short>(filter_.size()), program};
  if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &whole, 0, 0) != 0) return "seccomp";
  return nullptr;
}

RealPrivileges privileges_from(const std::string& status) {
  RealPrivileges real;
  std::istringstream lines(status);
  for (std::string line; std::getline(lines, line);) {
    std::istringstream in(line.substr(std::min(line.find(':'), line.size() - 1) + 1));
    if (line.starts_with("Uid:")) in >> real.user;
    if (line.starts_with("NoNewPrivs:")) in >> real.no_new_privileges;
    int mode = 0;
    if (line.starts_with("Seccomp:") && in >> mode) real.filtered = mode == SECCOMP_MODE_FILTER;
    std::uint64_t set = 0;
    if ((line.starts_with("CapPrm:") || line.starts_with("CapEff:")) && in >> std::hex >> set)
      real.capabilities |= set;
  }
  return real;
}

std::string capability_names(std::uint64_t capabilities) {
  static constexpr std::array<std::pair<unsigned, const char*>, 14> known{
      {{CAP_CHOWN, "CAP_CHOWN"},
       {CAP_DAC_OVERRIDE, "CAP_DAC_OVERRIDE"},
       {CAP_FOWNER, "CAP_FOWNER"},
       {CAP_KILL, "CAP_KILL"},
       {CAP_SETGID, "CAP_SETGID"},
       {CAP_SETUID, "CAP_SETUID"},
       {CAP_NET_ADMIN, "CAP_NET_ADMIN"},
       {CAP_NET_RAW, "CAP_NET_RAW"},
       {CAP_IPC_LOCK, "CAP_IPC_LOCK"},
       {CAP_SYS_PTRACE, "CAP_SYS_PTRACE"},
       {CAP_SYS_ADMIN, "CAP_SYS_ADMIN"},
       {CAP_SYS_NICE, "CAP_SYS_NICE"},
       {CAP_SYS_RESOURCE, "CAP_SYS_RESOURCE"},
       {CAP_SYS_TIME, "CAP_SYS_TIME"}}};
  if (capabilities == 0) return "none";
  constexpr int most_named = 8;
  if (std::popcount(capabilities) > most_named)
    return fmt::format("{} capabilities", std::popcount(capabilities));
  std::string names;
  for (unsigned number = 0; number <= highest_capability; ++number) {
    if ((capabilities >> number & 1U) == 0) continue;
    const auto found =
        std::find_if(known.begin(), known.end(), [&](const auto& k) { return k.first == number; });
    names += (names.empty() ? "" : " ") +
             (found != known.end() ? std::string(found->second) : fmt::format("capability {}", number));
  }
  return names;
}

}  // namespace srfs::suite
