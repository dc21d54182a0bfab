// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <iosfwd>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "base/process.hpp"
#include "base/result.hpp"

namespace srfs::suite {

/// Where a running deployment keeps its things: VAR/run, VAR/state, VAR/log.
struct VarPaths {
  std::filesystem::path root;
  /// The paths below the folder that @p var names, as its real path: links followed, no trailing slash. A
  /// suite is identified by its folder, so programs that take the folder from outside make its paths here.
  [[nodiscard]] static VarPaths at(const std::filesystem::path& var);
  [[nodiscard]] std::filesystem::path run() const { return root / "run"; }
  [[nodiscard]] std::filesystem::path state(const std::string& node) const { return root / "state" / node; }
  /// The boot record (boot_store.hpp).
  [[nodiscard]] std::filesystem::path boot() const { return root / "state" / "boot"; }
  [[nodiscard]] std::filesystem::path log(const std::string& node) const {
    return root / "log" / (node + ".log");
  }
  [[nodiscard]] std::filesystem::path instance_lock(const std::string& node) const {
    return run() / (node + ".lock");
  }
  [[nodiscard]] std::filesystem::path restart_lock(const std::string& node) const {
    return run() / (node + ".restart.lock");
  }
  /// Locked (flock) while `srfs up` starts node after node: a node that is not there yet is not missing.
  [[nodiscard]] std::filesystem::path starting_lock() const { return run() / "starting.lock"; }
  /// Exists while the suite is being stopped: no node may be started then.
  [[nodiscard]] std::filesystem::path stopping_flag() const { return run() / "stopping"; }
  /// Environment variables of test tools that every node of the suite gets (environment_for_nodes).
  [[nodiscard]] std::filesystem::path environment_file() const { return run() / "environment"; }
  /// The folder of files that processes map and share, below the owner's runtime_folder(): on tmpfs, so that
  /// no store ever waits for a disk. A power loss empties it, and ends the processes it describes. Removed by
  /// `srfs down`. Without a runtime folder it is memory_link(), on VAR's disk. Files there are opened by
  /// open_private(file, flags, owner()).
  [[nodiscard]] std::filesystem::path memory() const;
  /// Names memory() of the suite that runs, so that all its processes agree although a runtime folder comes
  /// and goes with its user's sessions.
  [[nodiscard]] std::filesystem::path memory_link() const { return run() / "memory"; }
  /// The name of memory() in a runtime folder: two deployments differ by the place of their folders.
  [[nodiscard]] std::string memory_name() const;
  /// The owner of VAR, if it exists: root takes that user's memory() for the suite's.
  [[nodiscard]] std::optional<uid_t> owner() const;
  /// Whether a record below memory() may name this process, to be signalled: the record's author, VAR's
  /// owner, could signal it, too.
  [[nodiscard]] bool may_name(pid_t pid) const;
  /// Makes run(), which holds locks and sockets, for this user alone, and memory_link(). @return why run() is
  /// not to be used: it belongs to another user, or others may write to it
  Result<void, std::string> make_run_folder() const;
  /// The node that may write to a CAN bus, kept by its switcher for its successor.
  [[nodiscard]] std::filesystem::path holder_of(const std::string& bus) const {
    return memory() / (bus + "_holder");
  }
  [[nodiscard]] std::filesystem::path domain_file() const { return run() / "dds_domain"; }
};

/// Where runtime files of a user's suites may lie, the best first: /run/srfs (RuntimeDirectory of the unit;
/// root makes it), /run/user/UID/srfs (a session of the user).
[[nodiscard]] std::vector<std::filesystem::path> runtime_folders(uid_t user);
/// The first of these that is this user's alone; made where that is possible. nullopt: none.
[[nodiscard]] std::optional<std::filesystem::path> runtime_folder(uid_t user);

/// Proof that this process is the only instance of a node: an fcntl record lock. The kernel drops it with the
/// process, however that ends, and reports the owner's pid itself.
class InstanceLock {
 public:
  /// @return the lock, or why not ("timing runs already as pid 12")
  [[nodiscard]] static Result<InstanceLock, std::string> take(const VarPaths& var, const std::string& node);
  /// Publishes what runs here for find_instance of other processes.
  void publish(std::uint32_t incarnation, const std::string& version);

 private:
  explicit InstanceLock(Fd fd) : fd_(std::move(fd)) {}
  Fd fd_;
};

struct RunningInstance {
  pid_t pid;
  std::uint32_t incarnation;  ///< 0 while it has not written it yet
  std::string version;
};

/// The process that holds the node's instance lock now, asked from the kernel; nullopt: no process does.
[[nodiscard]] std::optional<RunningInstance> find_instance(const VarPaths& var, const std::string& node);

/// The same process, to be signalled; nullopt also when it ends meanwhile.
[[nodiscard]] std::optional<Process> open_instance(const VarPaths& var, const std::string& node);

struct Incarnation {
  std::uint32_t number = 1;
  std::string not_durable_because;  ///< empty: it is on disk
};

/// The incarnation of this start: one more than the last, on disk before it is returned. A damaged file
/// counts from the clock, a disk that cannot be written from the last number and the time since boot, never
/// below what the predecessor wrote into the lock file: it always goes up within a boot.
[[nodiscard]] Incarnation next_incarnation(const VarPaths& var, const std::string& node);

/// How often and why a node was started, kept by the launcher.
struct StartRecord {
  std::uint32_t starts = 0;
  std::uint32_t restarts = 0;    ///< starts whose cause was not the operator's "up"
  std::string last_cause = "-";  ///< of the last restart
};
[[nodiscard]] StartRecord read_start_record(const VarPaths& var, const std::string& node);
void write_start_record(const VarPaths& var, const std::string& node, const StartRecord& record);

/// The DDS domains whose UDP ports another user's programs hold. @param udp_sockets  /proc/net/udp
/// @param own  nullopt: any user's programs
[[nodiscard]] std::set<int> domains_of_other_users(std::istream& udp_sockets, std::optional<uid_t> own);

/// A DDS domain that no other suite of this machine uses, held by a lock file until the lock's last holder
/// ends. The locks lie in this user's runtime_folder(), without one in ~/.cache/srfs, without a home in VAR
/// itself. Domains of other users are known by their UDP ports; in the last case, those of this user, too.
class DomainLock {
 public:
  static constexpr int first_domain = 42;
  /// The first free domain from @p first upwards (at most 101), or exactly @p wanted, in which other users'
  /// programs do not matter: they could keep a suite from starting.
  /// @param suite  name of the suite in the lock file: its VAR folder
  [[nodiscard]] static Result<DomainLock, std::string> allocate(std::optional<int> wanted,
                                                                int first = first_domain,
                                                                const std::string& suite = "");
  /// Holds a domain together with others of the same suite. Fails if another suite holds the domain: it may
  /// have taken it after all nodes of this one had been killed. Any number of the suite's processes may call
  /// it at once. Blocks for at most 0.1 s, while somebody has the domain alone or another suite has it.
  [[nodiscard]] static Result<DomainLock, std::string> share(int domain, const std::string& suite);
  DomainLock(DomainLock&&) = default;
  DomainLock& operator=(DomainLock&&) = default;
  ~DomainLock();  ///< the last holder removes the lock file
  [[nodiscard]] int domain() const { return domain_; }
  /// From sole holder to one of several.
  void downgrade();

 private:
  DomainLock(int domain, Fd fd, std::filesystem::path file)
      : domain_(domain), fd_(std::move(fd)), file_(std::move(file)) {}
  void sign(const std::string& suite);
  [[nodiscard]] std::string signature() const;
  int domain_;
  Fd fd_;
  std::filesystem::path file_;
};

}  // namespace srfs::suite
