// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "hw/linux/can_link.hpp"

namespace srfs::tool {

/// How `srfs doctor` sees this machine: files below a root, and a few facts that are in no file. Tests give a
/// folder of files and their own facts. It writes nothing and opens nothing that opening changes (a watchdog
/// would be armed, a serial line would signal a listener). Reading blocks as files of /proc and /sys do.
class Machine {
 public:
  struct File {
    mode_t mode;
    uid_t owner;
    gid_t group;
  };
  struct Room {
    std::uint64_t free_octets;  ///< for users other than root
  };

  /// The machine that this runs on.
  Machine();
  explicit Machine(std::filesystem::path root) : Machine() { root_ = std::move(root); }
  Machine(const Machine&) = delete;
  Machine& operator=(const Machine&) = delete;
  ~Machine() = default;

  // Facts, by the path or name as the machine knows it. All return an errno.
  std::function<Result<File, int>(const std::filesystem::path&)> look;  ///< after links
  std::function<Result<Room, int>(const std::filesystem::path&)> room;
  std::function<Result<hw::CanLink, int>(const std::string& interface)> can_link;

  [[nodiscard]] std::filesystem::path at(const std::filesystem::path& path) const {
    return root_ / path.relative_path();
  }
  /// Without the line's end; nullopt: cannot be read.
  [[nodiscard]] std::optional<std::string> text(const std::filesystem::path& path) const;
  [[nodiscard]] std::optional<std::int64_t> number(const std::filesystem::path& path) const;
  [[nodiscard]] std::vector<std::string> lines(const std::filesystem::path& path) const;
  [[nodiscard]] bool exists(const std::filesystem::path& path) const;
  /// Names in a folder, sorted; nullopt: cannot be read.
  [[nodiscard]] std::optional<std::vector<std::string>> names(const std::filesystem::path& folder) const;
  /// The last part of what @p path is, after links: "ttyS3" for /dev/gps.
  [[nodiscard]] std::string name_behind(const std::filesystem::path& path) const;
  /// Processes whose file of this name in /proc/PID fulfils the condition.
  struct Processes {
    std::vector<std::string> found;  ///< numbers
    bool complete = true;            ///< the file of every process could be read
  };
  [[nodiscard]] Processes processes(const std::string& file,
                                    const std::function<bool(const std::string&)>& condition) const;

 private:
  std::filesystem::path root_ = "/";
};

/// Capabilities by their number in linux/capability.h.
enum class Capability : unsigned {
  setgid = 6,
  setuid = 7,
  net_admin = 12,
  ipc_lock = 14,
  sys_admin = 21,
  sys_nice = 23,
  sys_resource = 24,
  sys_time = 25,
};

/// The account of a process: user, groups, capabilities.
struct Account {
  std::string name;
  uid_t user = 0;
  std::set<gid_t> groups;
  std::uint64_t capabilities = 0;

  [[nodiscard]] bool has(Capability c) const { return (capabilities >> static_cast<unsigned>(c) & 1U) != 0; }
  /// By the file's mode. @param wanted  of R_OK and W_OK
  [[nodiscard]] bool may(const Machine::File& file, int wanted) const;
};

/// The account of this process; nullopt: /proc does not show it.
[[nodiscard]] std::optional<Account> caller(const Machine& machine);
/// A user of /etc/passwd, without capabilities unless it is root; nullopt: there is none.
[[nodiscard]] std::optional<Account> account_of(const Machine& machine, const std::string& user);
[[nodiscard]] std::string name_of_user(const Machine& machine, uid_t user);
[[nodiscard]] std::string name_of_group(const Machine& machine, gid_t group);

/// A hard limit of this process, by its name in /proc/self/limits; unlimited: the highest number.
[[nodiscard]] std::optional<std::uint64_t> hard_limit(const Machine& machine, const std::string& name);

/// Parses a CPU list of the kernel, such as "0-2,5"; nullopt: not a list.
[[nodiscard]] std::optional<std::set<int>> parse_cpus(const std::string& list);

}  // namespace srfs::tool
