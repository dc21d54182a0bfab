// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <bitset>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/fd.hpp"
#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::update {

/// What stands between an untrusted program and the satellite (README.md). Each is set up by itself; where
/// the kernel or a container refuses one, the others hold.
enum class Layer : std::uint8_t {
  user,       ///< a user of its own, no privileges, none gained by a set-uid program
  files,      ///< the system read-only, nothing else of it visible: mount namespace, else Landlock
  processes,  ///< own process numbers: all of them end with the first
  network,    ///< none, or a loopback of its own
  ipc,        ///< own System V objects and message queues
  host_name,
  quota,          ///< the work folder is a file system of limited size; else it is watched
  memory,         ///< control group; else RLIMIT_DATA of each process alone
  process_count,  ///< control group; else RLIMIT_NPROC alone
  system_calls,   ///< seccomp: no sockets but the allowed, no mounts, no debugging, no keys...
  limits,         ///< rlimits: the floor
  priority,       ///< SCHED_IDLE, nice 19, idle I/O
};
inline constexpr std::size_t layer_count = 12;
[[nodiscard]] std::string_view to_text(Layer layer);
[[nodiscard]] std::optional<Layer> layer_of(std::string_view text);

using LayerSet = std::bitset<layer_count>;
[[nodiscard]] LayerSet set_of(std::initializer_list<Layer> layers);

struct LayerFailure {
  Layer layer;
  std::string reason;  ///< "mount namespace: Operation not permitted (EPERM)"
};
struct Layers {
  LayerSet in_force;
  std::vector<LayerFailure> failures;  ///< also of a first choice where the second one holds
};

struct Limits {
  seconds wall{60};
  seconds cpu{60};  ///< of one process
  std::uint64_t memory_octets = 1U << 30;
  std::uint64_t work_octets =
      256U << 20;  ///< all files together; where the work folder is in memory, part of it
  std::uint64_t file_octets = 128U << 20;
  std::uint64_t files = 4096;
  unsigned processes = 64;  ///< threads count
  unsigned open_files = 256;
  bool lowest_priority = true;
};

struct Confinement {
  std::vector<std::filesystem::path> readable;  ///< beside /usr; absolute. Missing ones are left out
  bool network = false;  ///< a loopback of its own; where that is not possible, the host's network
  uid_t user = 64042;    ///< where this process is root; else it keeps its user
  gid_t group = 64042;
  Limits limits;
  LayerSet required;       ///< without these nothing is run
  bool namespaces = true;  ///< false: as if the kernel had none
};

/// The one folder that a confined program may write to, with `tmp` and `shm` in it. Where the kernel allows
/// it, it is in memory, of limited size, invisible from outside, and gone with the last user; else a plain
/// folder, removed with this object. For one run.
class WorkFolder {
 public:
  /// @param path  absolute; made. Whatever lies there is removed
  [[nodiscard]] static Result<WorkFolder, std::string> make(const std::filesystem::path& path,
                                                            const Confinement& confinement);
  WorkFolder(WorkFolder&&) = default;
  WorkFolder& operator=(WorkFolder&&) = delete;
  /// Removes it, if need be by a process of its own.
  ~WorkFolder();

  /// Where the confined program finds it.
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  /// For this side: openat() and the like, with O_NOFOLLOW once the program has run.
  [[nodiscard]] int fd() const { return fd_.get(); }
  [[nodiscard]] bool in_memory() const { return in_memory_; }
  /// 0, or why it is not: an errno.
  [[nodiscard]] int refusal() const { return refusal_; }

  /// For the confined program to read; missing folders are made. @return why not
  [[nodiscard]] std::optional<std::string> put(const std::filesystem::path& name, std::string_view content,
                                               bool executable = false) const;
  /// What the program left there: an ordinary file of at most @p limit octets, not a link. A name without
  /// '/'.
  [[nodiscard]] Result<Fd, std::string> take(const std::string& name, std::uint64_t limit) const;
  /// The limits are reached: octets or files. Counts the files of a plain folder.
  [[nodiscard]] bool is_full(const Limits& limits) const;

 private:
  WorkFolder(std::filesystem::path path, Fd fd, bool in_memory, int refusal)
      : path_(std::move(path)), fd_(std::move(fd)), in_memory_(in_memory), refusal_(refusal) {}
  std::filesystem::path path_;
  Fd fd_;
  bool in_memory_;
  int refusal_;
};

struct Listener {
  std::function<void(std::string_view)> output;  ///< standard output, as it comes
  std::function<void(std::string_view)> log;     ///< standard error
  int cancel_fd = -1;                            ///< readable: end it
};

/// How a confined program ended, with all that it had started.
struct Ended {
  enum class Stop : std::uint8_t { none, wall_time, quota, cancelled };  ///< what ended it; none: it itself
  Stop stop = Stop::none;
  std::optional<int> exit_code;
  int signal = 0;
  double seconds = 0;
  double cpu_s = 0;               ///< of all its processes that were waited for
  std::uint64_t peak_octets = 0;  ///< of all together where there is a control group, else of the largest
  bool out_of_memory = false;     ///< the control group reports it
  bool too_many_processes = false;
  Layers layers;
};

struct SandboxFailure {
  std::string message;
  Layers layers;
};

/// Runs @p program in a process of its own, confined; it returns the exit code or becomes another program by
/// execute(). Blocks until nothing of it is left. If this process ends, by whatever signal, all of it ends.
/// The calling process must have one thread only. Standard input is empty, descriptors are closed, the
/// environment is what execute() is given.
[[nodiscard]] Result<Ended, SandboxFailure> run_confined(const Confinement& confinement,
                                                         const WorkFolder& work,
                                                         const std::function<int()>& program,
                                                         const Listener& listener);

/// For a confined program: becomes @p command (an absolute path first), in an environment of PATH, HOME,
/// TMPDIR and LANG. @return 127 when there is no such program
[[nodiscard]] int execute(const std::vector<std::string>& command, const std::filesystem::path& work);

}  // namespace srfs::update
