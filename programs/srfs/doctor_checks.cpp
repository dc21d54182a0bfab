// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Kernel, processors, limits, users, memory, disk, network, clock.

#include <algorithm>
#include <array>
#include <limits>
#include <sstream>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/cpu_wait.hpp"
#include "base/fd.hpp"
#include "programs/srfs/doctor.hpp"
#include "suite/command_keys.hpp"
#include "suite/confinement.hpp"
#include "suite/instance.hpp"
#include "suite/real_time.hpp"

namespace srfs::tool {
namespace {

namespace fs = std::filesystem;
using suite::NodeEntry;
using suite::SchedulingPolicy;

constexpr const char* debian_kernel = "apt-get install linux-image-$(dpkg --print-architecture)";
constexpr const char* real_time_kernel = "apt-get install linux-image-rt-$(dpkg --print-architecture)";
constexpr std::int64_t socket_buffer_octets = 4 << 20;  // DESIGN section 10; lib/ros/transport.cpp
constexpr std::uint64_t mib = 1U << 20;
constexpr std::uint64_t least_shared_memory = 16 * mib;
constexpr std::uint64_t least_disk = 128 * mib;
constexpr std::uint64_t good_disk = 2048 * mib;  // stores, frames, versions, good copies, the lane's header
constexpr std::uint64_t open_files = 1024;       // lib/suite/launcher.cpp

/// Also for the next boot: `sysctl -w` says what it set as sysctl.d wants it.
std::string sysctl_command(const std::string& name, std::int64_t value) {
  return fmt::format("sysctl -w {}={} | tee -a /etc/sysctl.d/60-srfs.conf", name, value);
}

fs::path sysctl_file(std::string name) {
  std::replace(name.begin(), name.end(), '.', '/');
  return fs::path("/proc/sys") / name;
}

std::string mib_text(std::uint64_t octets) {
  return fmt::format("{} MiB", octets / mib);
}

// ---------------------------------------------------------------- limits

struct LimitNeed {
  const char* check;
  const char* name;  ///< in /proc/self/limits
  const char* item;  ///< in limits.conf
  std::uint64_t value;
  std::string value_text;  ///< in limits.conf
  std::string asked_by;    ///< empty: by no node
  bool privileged;         ///< a capability makes up for it
  const char* capability;
};

void examine_limit(Examination& x, const LimitNeed& need) {
  const auto limit = hard_limit(x.machine, need.name);
  const std::string found = !limit                                                ? "?"
                            : *limit == std::numeric_limits<std::uint64_t>::max() ? "unlimited"
                                                                                  : std::to_string(*limit);
  if (need.asked_by.empty()) return x.ok(need.check, fmt::format("{}; no node asks for more", found));
  if (need.privileged)
    return x.ok(need.check,
                fmt::format("user {} may exceed any limit; needed by {}", x.starter.name, need.asked_by));
  if (!limit) return x.unknown(need.check, "not shown in /proc/self/limits", need.value_text);
  if (*limit >= need.value) return x.ok(need.check, fmt::format("{}; needed by {}", found, need.asked_by));
  const bool root = x.starter.user == 0;  // it gets no limits from a login: a container
  x.add(Verdict::fail, need.check, fmt::format("{} of user {}", found, x.starter.name),
        fmt::format("{}, needed by {}{}", need.value_text, need.asked_by,
                    root ? fmt::format(", or {} (in a container: --cap-add)", need.capability)
                         : ", from the next login on"),
        root ? "" : suite::limit_command(x.starter.name, need.item, need.value_text));
}

// ---------------------------------------------------------------- sysctls

struct SysctlNeed {
  const char* name;
  std::int64_t value;  ///< to be set
  const char* expected;
  Verdict verdict;  ///< where it is not
};

void examine_sysctl(Examination& x, const SysctlNeed& need, const std::function<bool(std::int64_t)>& good) {
  const std::string check = std::string("sysctl.") + need.name;
  const auto value = x.machine.number(sysctl_file(need.name));
  if (!value) return x.unknown(check, "not reported by this kernel", need.expected);
  if (good(*value)) return x.ok(check, std::to_string(*value));
  x.add(need.verdict, check, std::to_string(*value), need.expected, sysctl_command(need.name, need.value));
}

void examine_swap(Examination& x) {
  if (x.machine.lines("/proc/swaps").size() > 1) {
    examine_sysctl(x, {"vm.swappiness", 1, "at most 10 with swap", x.when_flying(Verdict::warn)},
                   [](std::int64_t value) { return value <= 10; });
  } else if (x.machine.exists("/proc/swaps")) {
    x.ok("sysctl.vm.swappiness", "no swap");
  } else {
    x.unknown("sysctl.vm.swappiness", "/proc/swaps cannot be read");
  }
}

void examine_core_pattern(Examination& x) {
  const auto pattern = x.machine.text("/proc/sys/kernel/core_pattern");
  if (!pattern) return x.unknown("sysctl.kernel.core_pattern", "not reported by this kernel");
  if (!pattern->starts_with("|"))
    return x.ok("sysctl.kernel.core_pattern", pattern->empty() ? "none" : *pattern);
  x.add(x.when_flying(Verdict::warn), "sysctl.kernel.core_pattern", *pattern,
        "no program: a dying node waits for it, whatever its limit of core files",
        "sysctl -w kernel.core_pattern=core | tee -a /etc/sysctl.d/60-srfs.conf");
}

// ---------------------------------------------------------------- memory

struct Mount {
  std::string point;
  std::string type;
  bool read_only = false;
};

/// The file system that a path is on. @param path  absolute, without links
std::optional<Mount> mount_of(const Machine& machine, const fs::path& path) {
  std::optional<Mount> best;
  for (const std::string& line : machine.lines("/proc/mounts")) {
    std::istringstream in(line);
    std::string device;
    Mount mount;
    std::string options;
    if (!(in >> device >> mount.point >> mount.type >> options)) continue;
    mount.read_only = options == "ro" || options.starts_with("ro,");
    const fs::path point = mount.point;
    const auto [end, rest] = std::mismatch(point.begin(), point.end(), path.begin(), path.end());
    const bool above = end == point.end() || mount.point == "/";
    if (above && (!best || best->point.size() <= mount.point.size())) best = mount;
  }
  return best;
}

/// A folder that the suite uses only if it is its own (base/private_file.hpp). @return false: it would not be
/// used
bool examine_private_folder(Examination& x, const std::string& check, const fs::path& folder,
                            const std::string& effect) {
  const auto file = x.machine.look(folder);
  std::error_code ec;
  const bool linked = fs::is_symlink(fs::symlink_status(x.machine.at(folder), ec));
  if (!linked && !file) return true;  // not there
  const auto of_var = x.machine.look(x.var);
  std::string what;
  if (linked) {
    what = "is a symbolic link";
  } else if (file->owner != x.starter.user &&
             !(x.starter.user == 0 && of_var && file->owner == of_var->owner)) {
    what = "belongs to user " + name_of_user(x.machine, file->owner);
  } else if (!S_ISDIR(file->mode)) {
    what = "is not a folder";
  } else if ((file->mode & (S_IWGRP | S_IWOTH)) != 0) {
    what = "others may write to it";
  } else {
    return true;
  }
  x.add(Verdict::fail, check, fmt::format("{}: {}", folder.string(), what),
        fmt::format("a folder of user {} only: {}", x.starter.name, effect), "rm -r " + folder.string());
  return false;
}

/// suite::runtime_folder of a user, as the machine shows it; also one that the first start will make.
std::optional<fs::path> runtime_folder_of(Examination& x, uid_t user) {
  const auto is_own = [user](const auto& file) {
    return file && file->owner == user && S_ISDIR(file->mode) && (file->mode & (S_IWGRP | S_IWOTH)) == 0;
  };
  for (const fs::path& folder : suite::runtime_folders(user)) {
    const auto file = x.machine.look(folder);
    if (is_own(file) || (!file && is_own(x.machine.look(folder.parent_path())))) return folder;
  }
  return std::nullopt;
}

uid_t owner_of_suite(Examination& x) {
  const auto of_var = x.machine.look(x.var);
  return of_var ? of_var->owner : x.starter.user;
}

/// Where the suite holds its DDS domain.
void examine_domain_locks(Examination& x) {
  const auto folder = runtime_folder_of(x, x.starter.user);
  if (!folder)
    return x.note("network.domains",
                  fmt::format("user {} has no runtime folder; locks lie in ~/.cache/srfs", x.starter.name));
  const fs::path locks = *folder / "domains";
  if (examine_private_folder(x, "network.domains", locks, "otherwise the suite does not start"))
    x.ok("network.domains", locks.string() + ": of this user only");
}

/// What suites leave in a runtime folder: the folder of a suite that runs is mapped by its nodes.
void examine_leftovers(Examination& x, const fs::path& runtime) {
  const fs::path own = runtime / suite::VarPaths{x.var}.memory_name();
  (void)examine_private_folder(x, "memory.suites", own,
                               "otherwise nodes run without heartbeat pages and histories");
  std::vector<std::string> maps;
  std::size_t suites = 0;
  const auto mapped = x.machine.processes("maps", [&](const std::string& text) {
    if (text.find(runtime.string() + "/") == std::string::npos) return false;
    maps.push_back(text);
    return true;
  });
  for (const std::string& name : x.machine.names(runtime).value_or(std::vector<std::string>{})) {
    if (name == "domains" || name.ends_with(suite::order_keys_suffix)) continue;
    ++suites;
    const std::string folder = (runtime / name).string();
    const bool used = std::any_of(maps.begin(), maps.end(), [&](const std::string& text) {
      return text.find(folder + "/") != std::string::npos;
    });
    if (used) {
      x.note("memory.suites", folder + (own == folder ? ": this suite runs" : ": another suite runs"));
    } else if (!mapped.complete) {
      x.unknown("memory.suites", folder + ": may be in use, not all processes are visible");
    } else if (own == folder) {
      x.note("memory.suites", folder + ": this suite was killed", "nothing; srfs up takes it over",
             fmt::format("srfs down --deployment {} --var {}", x.deployment.file.string(), x.var.string()));
    } else {
      x.add(Verdict::warn, "memory.suites", folder + ": left by another suite that was killed", "nothing",
            "rm -r " + folder);
    }
  }
  if (suites == 0) x.ok("memory.suites", "nothing left in " + runtime.string());
}

// ---------------------------------------------------------------- disk

void examine_file_system(Examination& x, const fs::path& folder) {
  const auto mount = mount_of(x.machine, folder);
  if (!mount) {
    x.unknown("disk.kind", "not shown in /proc/mounts");
  } else if (mount->read_only) {
    x.add(Verdict::fail, "disk.kind", mount->point + " is read-only", "a writable file system",
          "mount -o remount,rw " + mount->point);
  } else if (mount->type == "vfat" || mount->type == "exfat" || mount->type.starts_with("ntfs")) {
    x.add(Verdict::fail, "disk.kind", mount->type, "a journalling file system with owners and modes (ext4)",
          "");
  } else if (mount->type == "tmpfs" || mount->type == "ramfs" || mount->type == "overlay") {
    x.add(x.when_flying(Verdict::warn), "disk.kind", fmt::format("{} on {}", mount->type, mount->point),
          "one that survives a power loss (ext4)", "");
  } else {
    x.ok("disk.kind", fmt::format("{} on {}", mount->type, mount->point));
  }
}

void examine_room(Examination& x, const fs::path& folder) {
  const auto room = x.machine.room(folder);
  const std::string expected = mib_text(good_disk) + " free for VAR";
  if (!room) {
    x.unknown("disk.room", folder.string() + ": free space unknown", expected);
  } else if (room->free_octets >= good_disk) {
    x.ok("disk.room", fmt::format("{} free in {}", mib_text(room->free_octets), folder.string()));
  } else {
    x.add(room->free_octets < least_disk ? Verdict::fail : Verdict::warn, "disk.room",
          fmt::format("{} free in {}", mib_text(room->free_octets), folder.string()), expected,
          fmt::format("du -xhd2 {} | sort -h", folder.string()));
  }
}

/// Of what is there already of VAR.
void examine_access(Examination& x, const fs::path& folder) {
  const auto file = x.machine.look(folder);
  if (!file) return x.unknown("disk.access", folder.string() + " cannot be examined");
  std::set<std::string> refused;
  for (const NodeEntry& node : x.deployment.nodes) {
    const auto account = x.account(node);
    if (account && !account->may(*file, R_OK | W_OK)) refused.insert(account->name);
  }
  const std::string owner = fmt::format("{} belongs to {}, mode {:04o}", folder.string(),
                                        name_of_user(x.machine, file->owner), file->mode & 07777U);
  if (!refused.empty()) {
    x.add(Verdict::fail, "disk.access", owner,
          fmt::format("write access for user {}", fmt::join(refused, ", ")),
          fmt::format("install -d -o {} -m 0755 {}", *refused.begin(), x.var.string()));
  } else if (folder == x.var && (file->mode & 002U) != 0) {
    x.add(Verdict::warn, "disk.access", owner, "no write access for others", "chmod o-w " + folder.string());
  } else {
    x.ok("disk.access", owner);
  }
}

// ---------------------------------------------------------------- clock

struct Discipliner {
  const char* process;  ///< as in /proc/PID/comm: 15 characters
  const char* unit;
};
constexpr std::array discipliners{Discipliner{"systemd-timesyn", "systemd-timesyncd"},
                                  Discipliner{"chronyd", "chrony"}, Discipliner{"ntpd", "ntp"},
                                  Discipliner{"ptp4l", "ptp4l"}, Discipliner{"phc2sys", "phc2sys"}};

bool is_real_pulse(const suite::Deployment& deployment) {
  const auto uri = deployment.devices.find("gps_pulse");
  return uri != deployment.devices.end() && !uri->second.starts_with("sim:");
}

void examine_cpu_sets(Examination& x, const std::set<int>& online) {
  bool whole = true;
  for (const NodeEntry& node : x.deployment.nodes) {
    std::vector<int> missing;
    std::string switches;  // of those that the machine has
    for (const int cpu : node.scheduling.cpus) {
      if (online.contains(cpu)) continue;
      missing.push_back(cpu);
      const std::string folder = fmt::format("/sys/devices/system/cpu/cpu{}", cpu);
      if (x.machine.exists(folder)) switches += fmt::format(" {}/online", folder);
    }
    if (missing.empty()) continue;
    whole = false;
    const bool none_left = missing.size() == node.scheduling.cpus.size();
    x.add(none_left ? Verdict::fail : Verdict::warn, "cpu.sets",
          fmt::format("{} CPUs are online, not {} of {}", online.size(), fmt::join(missing, ","), node.name),
          "the CPUs of the deployment's `cpus`", switches.empty() ? "" : "echo 1 | tee" + switches);
  }
  if (whole) x.ok("cpu.sets", fmt::format("{} CPUs online, enough for all nodes", online.size()));
}

}  // namespace

void examine_waiting(Examination& x) {
  const auto own = x.machine.text("/proc/self/schedstat");
  const auto reading = own ? parse_schedstat(*own) : std::nullopt;
  if (reading && is_counted(*reading)) {
    x.ok("kernel.schedstat", "tells how long each thread waits for a CPU");
  } else {
    x.add(Verdict::warn, "kernel.schedstat",
          "does not tell how long a thread waits for a CPU: on a busy machine a node that gets none is taken "
          "for "
          "one that hangs",
          "a kernel with CONFIG_SCHED_INFO", debian_kernel);
  }
  if (const auto pressure = x.machine.text("/proc/pressure/cpu"); pressure && !pressure->empty()) {
    x.ok("kernel.pressure", "tells how much programs wait for a CPU");
  } else {
    x.add(
        Verdict::warn, "kernel.pressure",
        "does not tell how much programs wait for a CPU: `srfs up` has only the load average to blame a busy "
        "machine with",
        "a kernel with CONFIG_PSI, psi=1 on its command line where that is off", "");
  }
}

void examine_kernel(Examination& x) {
  const auto release = x.machine.text("/proc/sys/kernel/osrelease");
  int major = 0;
  int minor = 0;
  char dot = 0;
  std::istringstream in(release.value_or(""));
  const std::string expected = "5.13 or newer (Debian 12: 6.1); at least 5.3";
  if (!(in >> major >> dot >> minor)) {
    x.unknown("kernel.release", "not reported", expected);
  } else if (std::pair(major, minor) >= std::pair(5, 13)) {
    x.ok("kernel.release", *release);
  } else {
    const bool works = std::pair(major, minor) >= std::pair(5, 3);  // pidfds; then the sandbox is weaker
    x.add(works ? Verdict::warn : Verdict::fail, "kernel.release", *release, expected, debian_kernel);
  }

  const auto version = x.machine.text("/proc/version");
  const bool told = version && (version->find("PREEMPT_RT") != std::string::npos ||
                                version->find("PREEMPT RT") != std::string::npos);
  if (told || x.machine.text("/sys/kernel/realtime") == "1") return x.ok("kernel.preemption", "PREEMPT_RT");
  if (!version) return x.unknown("kernel.preemption", "not shown in /proc/version");
  const std::string kind = version->find("PREEMPT_DYNAMIC") != std::string::npos ? "PREEMPT_DYNAMIC"
                           : version->find("PREEMPT") != std::string::npos       ? "PREEMPT"
                                                                                 : "no preemption";
  if (!x.is_real_time())
    return x.note("kernel.preemption", kind + "; no node of the deployment is real-time");
  x.add(Verdict::warn, "kernel.preemption", kind, "PREEMPT_RT, for nodes under SCHED_FIFO", real_time_kernel);
}

void examine_processors(Examination& x) {
  const fs::path folder = "/sys/devices/system/cpu";
  const auto online = parse_cpus(x.machine.text(folder / "online").value_or(""));
  if (!online) {
    x.unknown("cpu.sets", "/sys does not show which CPUs are online");
    return x.unknown("cpu.governor", "/sys does not show which CPUs are online", "performance");
  }
  examine_cpu_sets(x, *online);

  std::vector<std::string> others;
  std::vector<std::string> slowed;
  std::size_t governors = 0;
  std::size_t frequencies = 0;
  for (const int cpu : *online) {
    const fs::path scaling = folder / fmt::format("cpu{}", cpu) / "cpufreq";
    const auto governor = x.machine.text(scaling / "scaling_governor");
    if (governor) ++governors;
    if (governor && *governor != "performance") others.push_back(fmt::format("cpu{}: {}", cpu, *governor));
    const auto limit = x.machine.number(scaling / "scaling_max_freq");
    const auto possible = x.machine.number(scaling / "cpuinfo_max_freq");
    if (limit && possible) ++frequencies;
    if (limit && possible && *limit < *possible)
      slowed.push_back(fmt::format("cpu{}: {} of {} kHz", cpu, *limit, *possible));
  }
  const std::string untold = "no cpufreq for some CPUs: firmware or host decides";
  if (!others.empty()) {
    x.add(x.when_flying(Verdict::warn), "cpu.governor", fmt::format("{}", fmt::join(others, ", ")),
          "performance", "echo performance | tee /sys/devices/system/cpu/cpu[0-9]*/cpufreq/scaling_governor");
  } else if (governors < online->size()) {
    x.unknown("cpu.governor", untold, "performance");
  } else {
    x.ok("cpu.governor", "performance");
  }
  if (!slowed.empty()) {
    x.add(x.when_flying(Verdict::warn), "cpu.frequency", fmt::format("{}", fmt::join(slowed, ", ")),
          "the hardware's maximum",
          "for f in /sys/devices/system/cpu/cpu[0-9]*/cpufreq; do cat $f/cpuinfo_max_freq > "
          "$f/scaling_max_freq; done");
  } else if (frequencies < online->size()) {
    x.unknown("cpu.frequency", untold, "the hardware's maximum");
  } else {
    x.ok("cpu.frequency", "not limited");
  }
}

void examine_limits(Examination& x) {
  int priority = 0;
  int nice = 0;
  bool keeps_capabilities = true;
  std::string by_priority, by_nice, by_lock, by_score;
  for (const NodeEntry& node : x.deployment.nodes) {
    if (node.scheduling.priority > priority) {
      priority = node.scheduling.priority;
      by_priority = node.name;
    }
    if (node.scheduling.nice < nice) {
      nice = node.scheduling.nice;
      by_nice = node.name;
    }
    if (node.memory.lock) {
      if (by_lock.empty()) by_lock = node.name;
      const auto account = x.account(node);
      keeps_capabilities = keeps_capabilities && account && account->has(Capability::ipc_lock) &&
                           x.starter.has(Capability::ipc_lock);
    }
    if (node.oom_score_adj < 0 && by_score.empty()) by_score = node.name;
  }
  const bool nices = x.starter.has(Capability::sys_nice);
  const bool raises = x.starter.has(Capability::sys_resource);
  examine_limit(x, {"limit.rtprio", "Max realtime priority", "rtprio", static_cast<std::uint64_t>(priority),
                    std::to_string(priority), by_priority, nices || raises, "CAP_SYS_NICE"});
  examine_limit(x, {"limit.nice", "Max nice priority", "nice", static_cast<std::uint64_t>(20 - nice),
                    std::to_string(nice), by_nice, nices || raises, "CAP_SYS_NICE"});
  examine_limit(x,
                {"limit.memlock", "Max locked memory", "memlock", std::numeric_limits<std::uint64_t>::max(),
                 "unlimited", by_lock, raises || keeps_capabilities, "CAP_IPC_LOCK"});
  examine_limit(x, {"limit.nofile", "Max open files", "nofile", open_files, std::to_string(open_files),
                    "all nodes", raises, "CAP_SYS_RESOURCE"});
  if (by_score.empty()) return;
  if (raises)
    return x.ok("limit.oom_score_adj", "user " + x.starter.name + " may lower it, by CAP_SYS_RESOURCE");
  x.add(Verdict::fail, "limit.oom_score_adj", "user " + x.starter.name + " may not lower it",
        "CAP_SYS_RESOURCE, needed by " + by_score, "");
}

void examine_users(Examination& x) {
  std::set<std::string> looked_at;
  std::vector<std::pair<std::string, Account>> accounts;  // of ring members
  const bool may_change =
      x.starter.user == 0 && x.starter.has(Capability::setuid) && x.starter.has(Capability::setgid);
  for (const NodeEntry& node : x.deployment.nodes) {
    const auto account = x.account(node);
    if (account) accounts.emplace_back(node.name, *account);
    if (node.user.empty() || !looked_at.insert(node.user).second) continue;
    const std::string check = "user." + node.user;
    if (!account) {
      x.add(Verdict::fail, check, "no such user", "the user of " + node.name,
            "useradd --system --no-create-home --shell /usr/sbin/nologin " + node.user);
    } else if (account->user == x.starter.user || may_change) {
      x.ok(check, fmt::format("uid {}, of {}", account->user, node.name));
    } else {
      x.add(Verdict::fail, check, fmt::format("user {} cannot start a node as another user", x.starter.name),
            "root, needed by " + node.name,
            fmt::format("srfs up --deployment {}", x.deployment.file.string()));
    }
  }
  if (!x.deployment.ring.enabled || x.machine.exists(x.prefix / "bin" / "srfs-starter")) return;
  for (const auto& [name, account] : accounts) {
    const auto other = std::find_if(accounts.begin(), accounts.end(),
                                    [&](const auto& o) { return o.second.user != account.user; });
    if (account.user == 0 || other == accounts.end()) continue;
    x.add(Verdict::warn, "user.ring",
          fmt::format("{} runs as user {} and cannot restart {}", name, account.name, other->first),
          "members of the ring that can restart each other: root, or one user for all", "");
    return;
  }
}

namespace {

/// The word of a command line behind @p option.
std::string word_behind(const std::string& command_line, std::string_view option) {
  const std::string key = '\0' + std::string(option) + '\0';
  const auto at = command_line.find(key);
  if (at == std::string::npos) return "";
  const auto begin = at + key.size();
  return command_line.substr(begin, command_line.find('\0', begin) - begin);
}

void examine_process(Examination& x, const NodeEntry& node, bool in_slot, const suite::RealPrivileges& real) {
  const std::string check = "privileges." + node.name;
  const suite::Trust trust = suite::trust_in(x.deployment, node, in_slot ? 1 : 0);
  const std::uint64_t wanted = suite::capabilities_of(x.deployment, node, trust);
  const std::string found =
      fmt::format("user {}, capabilities: {}, {}, {}", name_of_user(x.machine, real.user),
                  suite::capability_names(real.capabilities),
                  real.no_new_privileges ? "gains none" : "may gain some (no_new_privs is off)",
                  real.filtered ? "system calls filtered" : "all system calls");
  if (trust == suite::Trust::whole)
    return x.note(check, found + "; it keeps its starter's: it builds programs and changes versions");
  const std::string expected =
      fmt::format("capabilities: {}, gains none, system calls filtered", suite::capability_names(wanted));
  const std::uint64_t more = real.capabilities & ~wanted;
  if (more == 0 && real.no_new_privileges && real.filtered) return x.ok(check, found);
  const auto bit = [](Capability c) { return 1ULL << static_cast<unsigned>(c); };
  const bool confined = real.no_new_privileges && real.filtered;
  std::string fix = fmt::format("ls -l {}", (x.prefix / "bin" / "srfs-starter").string());
  if (confined && more == bit(Capability::net_admin)) {
    fix = "sysctl -w net.core.rmem_max=4194304";
  } else if (confined && (more & ~bit(Capability::net_admin)) == bit(Capability::sys_nice)) {
    fix = "prlimit --pid $$ --nice=40";
  }
  x.add(Verdict::warn, check, found, expected, fix + ", then srfs restart");
}

}  // namespace

/// The nodes that run: what they may do beside what they need.
void examine_privileges(Examination& x) {
  std::vector<std::pair<const NodeEntry*, bool>> nodes;
  const auto processes = x.machine.processes("cmdline", [&](const std::string& line) {
    if (word_behind(line, "--var") != x.var.string()) return false;
    const NodeEntry* node = x.deployment.find(word_behind(line, "--name"));
    if (node == nullptr) return false;
    nodes.emplace_back(node, line.starts_with((x.var / "versions").string() + "/"));
    return true;
  });
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    const auto& [node, in_slot] = nodes[i];
    if (const auto status = x.machine.text("/proc/" + processes.found[i] + "/status"))
      examine_process(x, *node, in_slot, suite::privileges_from(*status));
  }
  if (nodes.empty() && !processes.complete) x.unknown("privileges", "not all processes are visible");
  if (nodes.empty() && processes.complete) x.note("privileges", "no node runs");
}

void examine_sysctls(Examination& x) {
  const auto enough = [](std::int64_t value) { return value >= socket_buffer_octets; };
  const Verdict required = x.flies() ? Verdict::fail : Verdict::warn;
  examine_sysctl(x,
                 {"net.core.rmem_max", socket_buffer_octets,
                  "at least 4 MiB; otherwise images take 30 times as long", required},
                 enough);
  examine_sysctl(x,
                 {"net.core.wmem_max", socket_buffer_octets, "at least 4 MiB, as the suite requests",
                  x.when_flying(Verdict::warn)},
                 enough);
  if (x.is_real_time()) {
    const char* const name = "kernel.sched_rt_runtime_us";
    const auto runtime = x.machine.number(sysctl_file(name));
    if (runtime && *runtime < 0) {
      x.note(std::string("sysctl.") + name, "-1: only RLIMIT_RTTIME (0.5 s) ends a runaway real-time thread",
             "950000", sysctl_command(name, 950'000));
    } else {
      examine_sysctl(
          x, {name, 950'000, "950000 of 1000000; otherwise real-time threads are held up", Verdict::warn},
          [](std::int64_t value) { return value >= 950'000; });
    }
  }
  examine_sysctl(
      x, {"vm.overcommit_memory", 0, "0 or 1; otherwise reserved stacks count as used", Verdict::warn},
      [](std::int64_t value) { return value != 2; });
  examine_swap(x);
  examine_core_pattern(x);
}

void examine_memory(Examination& x) {
  const uid_t user = owner_of_suite(x);
  const std::string name = name_of_user(x.machine, user);
  const auto runtime = runtime_folder_of(x, user);
  if (!runtime) {
    x.add(Verdict::warn, "memory.runtime",
          fmt::format("user {} has no runtime folder: heartbeat pages lie on the disk of {}", name,
                      x.var.string()),
          "/run/user/" + std::to_string(user), "loginctl enable-linger " + name);
    return;
  }
  const fs::path place = runtime->parent_path();
  const auto mount = mount_of(x.machine, place);
  const auto room = x.machine.room(place);
  const std::string expected = fmt::format("{} free, in memory", mib_text(least_shared_memory));
  if (!room) {
    x.unknown("memory.runtime", place.string() + ": " + errno_text(room.error()), expected);
  } else if (!mount) {
    x.unknown("memory.runtime", place.string() + " not shown in /proc/mounts", expected);
  } else if (mount->type != "tmpfs") {
    x.add(Verdict::warn, "memory.runtime", place.string() + " is on " + mount->type, expected,
          "mount -t tmpfs -o mode=0755,nosuid,nodev tmpfs " + place.string());
  } else if (room->free_octets < least_shared_memory) {
    x.add(Verdict::fail, "memory.runtime", mib_text(room->free_octets) + " free", expected,
          "mount -o remount,size=64M " + mount->point);
  } else {
    x.ok("memory.runtime", mib_text(room->free_octets) + " free in " + place.string());
  }
  examine_leftovers(x, *runtime);
}

/// The keys by which nodes know ttc's telecommands and the suite's datagrams, made at each start of the
/// suite.
void examine_orders(Examination& x) {
  const std::string check = "orders.keys";
  if (x.deployment.open_orders)
    return x.note(check, "dds.orders is open: any program of this computer commands the nodes", "proven");
  const auto runtime = runtime_folder_of(x, owner_of_suite(x));
  const fs::path folder =
      runtime ? *runtime / (suite::VarPaths{x.var}.memory_name() + std::string(suite::order_keys_suffix))
              : x.var / "keys" / "orders";
  if (!examine_private_folder(x, check, folder, "otherwise no node executes a telecommand")) return;
  if (!x.machine.exists(folder)) return x.note(check, "none; srfs up makes them");
  std::vector<std::string> keys{"command_key", "seal/seal_key"};
  for (const NodeEntry& node : x.deployment.nodes) {
    for (const char* key : {"/command_key", "/seal_key"}) keys.push_back("of_" + node.name + key);
  }
  std::size_t found = 0;
  for (const std::string& key : keys) {
    const auto file = x.machine.look(folder / key);
    if (!file && file.error() == EACCES)
      return x.unknown(check, folder.string() + " is closed to this user, whose srfs orders nothing",
                       "run as the user of the suite");
    if (!file) continue;
    ++found;
    if ((file->mode & (S_IRWXG | S_IRWXO)) == 0) continue;
    return x.add(
        Verdict::fail, check, fmt::format("{}: others may use it", (folder / key).string()), "mode 0600",
        fmt::format("srfs restart --deployment {} --var {}", x.deployment.file.string(), x.var.string()));
  }
  x.ok(check, fmt::format("{} keys in {}, of this suite's user only", found, folder.string()));
}

void examine_disk(Examination& x) {
  fs::path folder = x.var;
  while (!x.machine.exists(folder) && folder.has_relative_path()) folder = folder.parent_path();
  examine_file_system(x, folder);
  examine_room(x, folder);
  examine_access(x, folder);
}

void examine_network(Examination& x) {
  examine_domain_locks(x);
  const auto flags = x.machine.text("/sys/class/net/lo/flags");
  constexpr unsigned long up = 1;  // IFF_UP
  if (!flags) {
    x.unknown("network.loopback", "not shown in /sys", "up");
  } else if ((std::strtoul(flags->c_str(), nullptr, 16) & up) != 0) {
    x.ok("network.loopback", "up");
  } else {
    x.add(Verdict::fail, "network.loopback", "down", "up: it carries all messages", "ip link set lo up");
  }
  for (const std::string& address : x.deployment.interfaces) {
    if (!address.starts_with("127."))
      x.note("network.interfaces", address + " is not a loopback address: other hosts can send to the suite",
             "127.0.0.1 only");
  }
}

void examine_clock(Examination& x) {
  const NodeEntry* timing = x.running("timing_node");
  const bool system = timing != nullptr && timing->parameters.text("clock", "mission") == "system";
  // Slewing the system clock also slews the monotonic one, by which the pulse is timed.
  const Verdict verdict = system                        ? Verdict::fail
                          : is_real_pulse(x.deployment) ? Verdict::warn
                                                        : Verdict::note;
  bool found = false;
  bool complete = true;
  for (const Discipliner& one : discipliners) {
    const auto processes =
        x.machine.processes("comm", [&](const std::string& name) { return name == one.process; });
    complete = complete && processes.complete;
    if (processes.found.empty()) continue;
    found = true;
    x.add(verdict, "clock.discipline", fmt::format("{} runs (pid {})", one.unit, processes.found.front()),
          system ? "only timing sets the system clock" : "nothing slews the clock that times the pulse",
          fmt::format("systemctl disable --now {}", one.unit));
  }
  if (!found && complete) x.ok("clock.discipline", "nothing else sets the clock");
  if (!found && !complete) x.unknown("clock.discipline", "not all processes are visible");

  if (const auto source =
          x.machine.text("/sys/devices/system/clocksource/clocksource0/current_clocksource")) {
    if (source->find("jiffies") != std::string::npos) {
      x.add(Verdict::fail, "clock.source", *source, "a hardware counter", "");
    } else {
      x.ok("clock.source", *source);
    }
  } else {
    x.unknown("clock.source", "not shown in /sys");
  }
  if (!system) return;
  const auto account = x.account(*timing);
  if (account && account->has(Capability::sys_time))
    return x.ok("clock.right", "user " + account->name + " may set it");
  x.add(Verdict::fail, "clock.right", "timing may not set the system clock",
        "CAP_SYS_TIME, for `clock: system`", "");
}

}  // namespace srfs::tool
