// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "base/result.hpp"
#include "base/time.hpp"
#include "suite/instance.hpp"

namespace srfs::suite {

/// How a process ended, as it recorded itself in its last moment.
enum class EndKind : std::uint32_t {
  running = 0,  ///< no record: it runs, or was killed without a word (SIGKILL, power)
  exit = 1,     ///< value: exit code
  signal = 2,   ///< value: the signal that was fatal
};

/// One page per node in shared memory: the second witness (DESIGN section 8) beside the answers over DDS. Its
/// work thread stores the time of every turn there, so an observer can distinguish a hung process from one
/// whose communication failed. A process that ends leaves its last words there, since it has no parent to
/// report to. Stores and loads are single words: nothing is torn, nothing blocks, a killed process leaves no
/// lock.
class HeartbeatPage {
 public:
  struct Reading {
    pid_t pid = 0;
    std::uint32_t incarnation = 0;
    MonotonicTime last_turn;  ///< when the work thread began its last turn
    std::uint64_t turns = 0;
    std::uint32_t state =
        0;  ///< lifecycle state, also one of a transition that runs since that turn; 0: none yet
    std::uint32_t desired = 0;  ///< lifecycle state
    EndKind end = EndKind::running;
    std::uint32_t end_value = 0;
    std::uint64_t descriptors = 0;  ///< open ones, a second ago at most; 0: not told
  };

  /// The page of this process' own node, cleared for it. Creates what is missing. Blocks as a file of
  /// tmpfs does.
  [[nodiscard]] static Result<HeartbeatPage, std::string> create(const VarPaths& var, const std::string& node,
                                                                 std::uint32_t incarnation);
  /// What stands in another node's page; nullopt: no page yet, or of another layout.
  [[nodiscard]] static std::optional<Reading> read(const VarPaths& var, const std::string& node);

  /// A turn of the work thread begins. Wait-free.
  void beat(MonotonicTime now);
  /// The lifecycle state changes, or the desired one; a turn, too. Wait-free.
  void lifecycle(std::uint32_t state, std::uint32_t desired, MonotonicTime now);
  /// Others may not be able to count them. Wait-free.
  void descriptors(std::uint64_t count);
  /// The process ends. Async-signal-safe.
  void end(EndKind kind, std::uint32_t value);

 private:
  struct Layout;
  struct Unmap {
    void operator()(Layout* page) const;
  };
  explicit HeartbeatPage(Layout* page) : page_(page) {}
  std::unique_ptr<Layout, Unmap> page_;
};

/// The open descriptors of a process. 0: they cannot be counted; before Linux 6.2 those of a process with
/// other privileges cannot.
[[nodiscard]] std::uint64_t count_descriptors(pid_t pid);

}  // namespace srfs::suite
