#pragma once

#include <sys/types.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "base/fd.hpp"
#include "base/process.hpp"
#include "base/result.hpp"

namespace srfs::ros {

/// Where a running deployment keeps its things: VAR/run, VAR/state, VAR/log.
struct VarPaths {
  std::filesystem::path root;
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
  /// Locked (flock) while `srfs up` starts node after node: who is not there yet is not missing.
  [[nodiscard]] std::filesystem::path starting_lock() const { return run() / "starting.lock"; }
  /// Exists while the suite is being stopped: nobody may start a node then.
  [[nodiscard]] std::filesystem::path stopping_flag() const { return run() / "stopping"; }
  /// Environment variables of test tools that every node of the suite gets (environment_for_nodes).
  [[nodiscard]] std::filesystem::path environment_file() const { return run() / "environment"; }
  /// What processes map and share: on tmpfs, so that no store ever waits for a disk. It is empty after a
  /// power loss, like the processes it tells of. Removed by `srfs down`.
  [[nodiscard]] std::filesystem::path memory() const;
  /// Who may write to the CAN bus, kept by can_switcher for its successor.
  [[nodiscard]] std::filesystem::path can_holder() const { return memory() / "can_holder"; }
  [[nodiscard]] std::filesystem::path domain_file() const { return run() / "dds_domain"; }
};

/// Proof that this process is the only instance of a node: an fcntl record lock, which the kernel drops with
/// the process however it ends, and whose owner's pid the kernel itself tells.
class InstanceLock {
 public:
  /// @return the lock, or why not ("timing runs already as pid 12")
  [[nodiscard]] static Result<InstanceLock, std::string> take(const VarPaths& var, const std::string& node);
  /// Tells find_instance of other processes what runs here.
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

/// The process that holds the node's instance lock now, asked from the kernel; nullopt when nobody does.
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

/// A DDS domain nobody else of this machine's suites uses, held by a lock file in /tmp until the lock's last
/// holder ends.
class DomainLock {
 public:
  /// The first free domain from @p first upwards (at most 101), or exactly @p wanted.
  [[nodiscard]] static Result<DomainLock, std::string> allocate(std::optional<int> wanted, int first = 42);
  /// Holds a domain together with others of the same suite.
  [[nodiscard]] static Result<DomainLock, std::string> share(int domain);
  DomainLock(DomainLock&&) = default;
  DomainLock& operator=(DomainLock&&) = default;
  ~DomainLock();  ///< the last holder removes the lock file
  [[nodiscard]] int domain() const { return domain_; }
  /// From sole holder to one of several.
  void downgrade();

 private:
  DomainLock(int domain, Fd fd) : domain_(domain), fd_(std::move(fd)) {}
  int domain_;
  Fd fd_;
};

}  // namespace srfs::ros
