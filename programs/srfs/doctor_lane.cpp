// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// What the build lane needs (programs/lane, lib/update/sandbox), and the keys.

#include <algorithm>
#include <array>
#include <cerrno>

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/fd.hpp"
#include "base/known_key.hpp"
#include "programs/srfs/doctor.hpp"
#include "update/build_lane.hpp"
#include "update/package_keys.hpp"

namespace srfs::tool {
namespace {

namespace fs = std::filesystem;
using suite::NodeEntry;

constexpr std::int64_t lane_memory_mib = 1536;  // --memory-mib of srfs-lane

/// A program or a header of the lane, and the package that brings it.
struct Tool {
  const char* file;
  const char* package;
};
constexpr std::array tools{Tool{update::compiler, "g++"},
                           Tool{"/usr/bin/ld", "binutils"},
                           Tool{"/usr/include/tl/expected.hpp", "libexpected-dev"},
                           Tool{"/usr/include/fastcdr/Cdr.h", "libfastcdr-dev"},
                           Tool{"/usr/include/fastdds/dds/domain/DomainParticipant.hpp", "libfastrtps-dev"},
                           Tool{"/usr/include/fmt/format.h", "libfmt-dev"},
                           Tool{"/usr/include/yaml-cpp/yaml.h", "libyaml-cpp-dev"}};

void examine_tools(Examination& x) {
  std::string missing;
  std::string packages;
  for (const Tool& tool : tools) {
    if (x.machine.exists(tool.file)) continue;
    missing += (missing.empty() ? "" : ", ") + std::string(tool.file);
    packages += std::string(" ") + tool.package;
  }
  if (missing.empty()) {
    x.ok("lane.tools", "compiler, linker, headers");
  } else {
    x.add(Verdict::fail, "lane.tools", "missing: " + missing, "tools that compile a node on board",
          "apt-get install --no-install-recommends" + packages);
  }
  const fs::path settings = x.prefix / "share/srfs/node_build.json";
  const auto text = x.machine.text(settings);
  const auto build = text ? update::decode_node_build(*text, x.prefix)
                          : Result<update::NodeBuild, std::string>(Err(std::string("cannot be read")));
  const std::string expected = "an installation or a build tree with all headers of nodes";
  if (!build)
    return x.add(Verdict::fail, "lane.installation", fmt::format("{}: {}", settings.string(), build.error()),
                 expected, "");
  for (const fs::path& folder : build->include) {
    if (!x.machine.exists(folder))
      return x.add(Verdict::fail, "lane.installation", folder.string() + " is missing", expected, "");
  }
  if (!x.machine.exists(x.prefix / "bin/srfs-lane"))
    return x.add(Verdict::fail, "lane.installation", (x.prefix / "bin/srfs-lane").string() + " is missing",
                 expected, "");
  x.ok("lane.installation", x.prefix.string());
}

void examine_lane_user(Examination& x, const Account& owner) {
  const uid_t uid = update::Confinement().user;
  const std::string expected = fmt::format("its own user, uid {}: maintenance runs as root", uid);
  if (owner.user != 0)
    return x.add(Verdict::warn, "lane.user", fmt::format("compiled code runs as user {}", owner.name),
                 expected, "");
  if (!owner.has(Capability::setuid) || !owner.has(Capability::setgid))
    return x.add(Verdict::fail, "lane.user", "root without the right to change the user",
                 "CAP_SETUID, CAP_SETGID", "");
  const std::string name = name_of_user(x.machine, uid);
  if (name != std::to_string(uid))
    return x.add(Verdict::warn, "lane.user", fmt::format("uid {} belongs to {}", uid, name),
                 "no user with this uid", fmt::format("usermod -u 64043 {}", name));
  x.ok("lane.user", fmt::format("uid {}, no other user", uid));
}

void examine_namespaces(Examination& x, const Account& owner) {
  const std::string weaker = "namespaces; otherwise only Landlock and limits confine compiled code";
  const auto all = x.machine.names("/proc/self/ns");
  if (!all) return x.unknown("lane.namespaces", "/proc/self/ns cannot be read", weaker);
  for (const char* name : {"mnt", "pid", "net", "ipc", "uts"}) {
    if (std::find(all->begin(), all->end(), name) == all->end())
      return x.add(Verdict::warn, "lane.namespaces", fmt::format("this kernel has no {} namespaces", name),
                   weaker, "");
  }
  if (owner.user == 0 && owner.has(Capability::sys_admin)) return x.ok("lane.namespaces", "by CAP_SYS_ADMIN");
  if (owner.user == 0)
    return x.add(Verdict::warn, "lane.namespaces", "root without CAP_SYS_ADMIN, as in a container", weaker,
                 "");
  if (x.machine.number("/proc/sys/user/max_user_namespaces") == 0)
    return x.add(Verdict::warn, "lane.namespaces", "no user namespaces", weaker,
                 "sysctl -w user.max_user_namespaces=1024 | tee -a /etc/sysctl.d/60-srfs.conf");
  for (const auto& [name, good] :
       {std::pair{"unprivileged_userns_clone", 1}, std::pair{"apparmor_restrict_unprivileged_userns", 0}}) {
    const auto value = x.machine.number(fs::path("/proc/sys/kernel") / name);
    if (value && *value != good)
      return x.add(Verdict::warn, "lane.namespaces", fmt::format("kernel.{} = {}", name, *value), weaker,
                   fmt::format("sysctl -w kernel.{}={} | tee -a /etc/sysctl.d/60-srfs.conf", name, good));
  }
  if (!x.machine.exists("/proc/sys/user/max_user_namespaces"))
    return x.unknown("lane.namespaces", "user namespaces not reported by this kernel", weaker);
  x.ok("lane.namespaces", "user namespaces");
}

void examine_control_groups(Examination& x, const Account& owner) {
  const fs::path groups = "/sys/fs/cgroup";
  const std::string check = "lane.cgroup";
  const std::string expected = "control groups for memory and processes; otherwise only limits per process";
  const bool version_2 = x.machine.exists(groups / "cgroup.controllers");
  if (!version_2 && !(x.machine.exists(groups / "memory") && x.machine.exists(groups / "pids")))
    return x.add(Verdict::warn, check, "no control groups in /sys/fs/cgroup", expected,
                 "mount -t cgroup2 cgroup2 /sys/fs/cgroup");
  for (const std::string& line : x.machine.lines("/proc/mounts")) {
    if (line.find(" /sys/fs/cgroup ") != std::string::npos && line.find(" ro,") != std::string::npos)
      return x.add(Verdict::warn, check, "/sys/fs/cgroup is read-only, as in a container", expected,
                   "mount -o remount,rw /sys/fs/cgroup");
  }
  if (owner.user != 0)
    return x.add(Verdict::warn, check, fmt::format("user {} may not create control groups", owner.name),
                 expected, "");
  if (!version_2) return x.ok(check, "version 1: memory, pids");
  const std::string enabled = " " + x.machine.text(groups / "cgroup.subtree_control").value_or("") + " ";
  for (const char* controller : {" memory ", " pids "}) {
    if (enabled.find(controller) == std::string::npos)
      return x.add(Verdict::warn, check, fmt::format("version 2 without{}at its root", controller), expected,
                   "echo '+memory +pids' > /sys/fs/cgroup/cgroup.subtree_control");
  }
  x.ok(check, "version 2: memory, pids");
}

void examine_kernel_rules(Examination& x) {
  if (x.machine.exists("/proc/sys/kernel/seccomp/actions_avail")) {
    x.ok("lane.seccomp", "there");
  } else {
    x.add(Verdict::warn, "lane.seccomp", "not reported by this kernel", "CONFIG_SECCOMP_FILTER", "");
  }
  const auto modules = x.machine.text("/sys/kernel/security/lsm");
  if (!modules) {
    x.unknown("lane.landlock", "not shown in /sys/kernel/security");
  } else if (modules->find("landlock") == std::string::npos) {
    x.note("lane.landlock", "not active: without namespaces only the user's rights confine compiled code",
           "landlock in lsm= on the kernel's command line");
  } else {
    x.ok("lane.landlock", "there");
  }
}

void examine_lane_memory(Examination& x) {
  for (const std::string& line : x.machine.lines("/proc/meminfo")) {
    long long kib = 0;
    if (std::sscanf(line.c_str(), "MemAvailable: %lld", &kib) != 1) continue;
    const std::string found = fmt::format("{} MiB available", kib / 1024);
    if (kib / 1024 >= lane_memory_mib) return x.ok("lane.memory", found);
    return x.add(Verdict::warn, "lane.memory", found,
                 fmt::format("{} MiB, the lane's limit; a build needs about 900", lane_memory_mib), "");
  }
  x.unknown("lane.memory", "not shown in /proc/meminfo");
}

// ---------------------------------------------------------------- keys

bool is_key(const std::string& text) {
  return text.size() == 64 && text.find_first_not_of("0123456789abcdefABCDEF") == std::string::npos;
}

void examine_key(Examination& x, const fs::path& path, bool secret, const std::optional<Account>& reader,
                 bool simulated, const std::string& make) {
  const std::string check = "key." + path.filename().string();
  const auto file = x.machine.look(path);
  if (!file && file.error() == EACCES)
    return x.unknown(check, path.string() + " cannot be examined; run as root");
  if (!file && simulated) return x.note(check, path.string() + ": hw_sim makes a test key");
  if (!file)
    return x.add(
        secret ? Verdict::fail : Verdict::warn, check,
        fmt::format("{}: {}", path.string(), errno_text(file.error())),
        secret ? "the same key as on the ground" : "the key of packages; otherwise all packages are refused",
        make);
  if (!S_ISREG(file->mode))
    return x.add(Verdict::fail, check, path.string() + " is not a regular file", "a key", "");
  const unsigned forbidden = secret ? 077U : 022U;
  if ((file->mode & forbidden) != 0)
    return x.add(Verdict::fail, check, fmt::format("{} has mode {:04o}", path.string(), file->mode & 07777U),
                 secret ? "0600: others may not read a key" : "0644: others may not change it",
                 fmt::format("chmod {} {}", secret ? "600" : "644", path.string()));
  if (reader && !reader->may(*file, R_OK))
    return x.add(Verdict::fail, check,
                 fmt::format("{} belongs to {}", path.string(), name_of_user(x.machine, file->owner)),
                 fmt::format("read access for user {}", reader->name),
                 fmt::format("chown {} {}", reader->name, path.string()));
  const auto text = x.machine.text(path);
  if (!text) return x.unknown(check, path.string() + " cannot be read; run as root");
  if (!is_key(*text))
    return x.add(Verdict::fail, check, path.string() + " is not a key", "64 hexadecimal digits", make);
  if (const auto known = why_known(*from_hex(*text)); known && (!simulated || !secret))
    return x.add(Verdict::fail, check, fmt::format("{}: publicly known, {}", path.string(), *known),
                 "a random key: this one is refused", make);
  x.ok(check, fmt::format("{}, mode {:04o}", path.string(), file->mode & 07777U));
}

}  // namespace

void examine_lane(Examination& x) {
  const NodeEntry* maintenance = x.running("maintenance_node");
  if (maintenance == nullptr) return;
  const auto owner = x.account(*maintenance);
  if (!owner) return;  // a finding of its own
  examine_tools(x);
  examine_lane_user(x, *owner);
  examine_namespaces(x, *owner);
  examine_control_groups(x, *owner);
  examine_kernel_rules(x);
  examine_lane_memory(x);
}

namespace {

void examine_secret(Examination& x, const std::string& key_file, const std::optional<Account>& reader,
                    bool simulated) {
  const fs::path path = x.var / key_file;
  examine_key(x, path, true, reader, simulated,
              fmt::format("install -d -m 0700 {} && (umask 077; openssl rand -hex 32 > {})",
                          path.parent_path().string(), path.string()));
}

}  // namespace

void examine_keys(Examination& x) {
  const auto line = x.deployment.devices.find("rs422");
  const bool simulated = line == x.deployment.devices.end() || !suite::is_hardware_line(line->second, x.var);
  if (const NodeEntry* ttc = x.running("ttc_node")) {
    const auto reader = x.account(*ttc);
    for (const suite::TelecommandChannel& channel : x.deployment.link.channels) {
      if (channel.security != suite::ChannelSecurity::sdls) {
        const std::string open =
            fmt::format("TC virtual channel {} has no security", channel.virtual_channel);
        if (simulated) {
          x.note("link.security", open, "for tests only");
        } else {
          x.add(Verdict::fail, "link.security",
                fmt::format("{}, and {} is a line of hardware", open, line->second),
                "sdls; otherwise the suite does not start", "");
        }
      }
    }
    for (const std::string& file : suite::key_files_of(x.deployment.link))
      examine_secret(x, file, reader, simulated);
  }
  if (const NodeEntry* maintenance = x.running("maintenance_node"))
    examine_key(x, x.var / update::public_key_file, false, x.account(*maintenance), simulated, "");
}

}  // namespace srfs::tool
