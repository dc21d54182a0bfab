#pragma once

#include <filesystem>
#include <string>

#include "base/fd.hpp"
#include "base/result.hpp"
#include "ros/deployment.hpp"
#include "ros/instance.hpp"

namespace srfs::ros {

struct LaunchRequest {
  const Deployment& deployment;
  VarPaths var;
  std::filesystem::path bin_folder;  ///< where node executables are
  std::string cause;                 ///< "up", or why this is a restart
};

/// The right to kill and to start one node: one holder in the whole suite, at most, and the kernel takes it
/// back with the holder, however that ends. The file left behind means nothing.
class RestartLock {
 public:
  struct Refusal {
    bool held = false;  ///< by somebody else; otherwise there is no place for a lock
    std::string text;   ///< ready to print
  };
  /// Never waits. On a disk that takes no new file the lock is on tmpfs.
  [[nodiscard]] static Result<RestartLock, Refusal> take(const VarPaths& var, const std::string& node);
  RestartLock(RestartLock&&) = default;
  RestartLock& operator=(RestartLock&& other) noexcept {
    std::swap(fd_, other.fd_);  // the other's destructor unlocks
    return *this;
  }
  ~RestartLock();

 private:
  explicit RestartLock(Fd fd) : fd_(std::move(fd)) {}
  Fd fd_;
};

/// Starts one node, the same way whoever asks: environment, user, scheduling, CPUs, limits, I/O priority,
/// timer slack, working folder, signal mask and descriptors are set absolutely from the deployment. Limits
/// are soft ones: the hard ones stay open, so that a node can start another one whose limits are wider. What
/// the system does not permit leaves the node running without it; the node says so once. The node is no child
/// of the caller. One starter at a time (restart lock); never a second instance (instance lock); never while
/// the suite is stopping. Blocks until the program holds its instance lock or has ended: some 10 ms, 2 s at
/// most.
/// @param patience  with somebody else who is starting it
/// @return what went wrong, ready to print. A node that runs or starts already is no error: its pid is
/// returned.
[[nodiscard]] Result<pid_t, std::string> launch(const LaunchRequest& request, const NodeEntry& node,
                                                nanoseconds patience = {});

/// The start alone, for who holds the lock and has looked that nobody runs or starts. Works on a full disk;
/// waits for no fsync.
[[nodiscard]] Result<pid_t, std::string> launch_locked(const LaunchRequest& request, const NodeEntry& node,
                                                       const RestartLock& held);
/// The start record of a start that has happened. Blocks on the disk.
void count_start_on_disk(const LaunchRequest& request, const NodeEntry& node);

/// Lines NAME=value of those variables of this process that nodes may have: sanitizer settings, the place of
/// the mission dictionary of a build tree, a library path. `srfs up` writes them to
/// VarPaths::environment_file(); whoever starts a node later takes them from there instead of from its own
/// environment.
[[nodiscard]] std::string environment_for_nodes();

/// The folder of the running program's own executable.
[[nodiscard]] std::filesystem::path own_bin_folder();

}  // namespace srfs::ros
