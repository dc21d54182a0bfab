// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "base/fd.hpp"
#include "base/time.hpp"
#include "ros/executor.hpp"

namespace srfs {

/// Whether the process that has a payload's instance lock now is the one that held the bus.
/// @param incarnation  of that process; 0: it has not made it known yet
/// @param holder       incarnation of the holder; nullopt: not known
[[nodiscard]] bool is_holder(std::uint32_t incarnation, const std::optional<std::uint32_t>& holder);

/// Ends a payload's process so surely that it can never write to the bus again. Does not block: sends SIGKILL
/// by pidfd (a reused number is never hit), then waits for the exit. A process that cannot be killed, or does
/// not go away, may still write: it is not reported as gone before it is, and is killed again after each
/// wait. Work thread.
class HolderFence {
 public:
  /// What it needs from its surroundings.
  struct Hooks {
    std::function<std::optional<pid_t>(const std::string& payload)>
        find;  ///< holder of the payload's instance lock now
    std::function<ros::Executor::Handle(int fd, std::function<void()> readable)> watch;
    std::function<ros::Timer(nanoseconds delay, std::function<void()> due)> after;
    std::function<int(int pidfd)> kill = send_sigkill;  ///< @return 0 or errno
  };
  struct Outcome {
    std::function<void()> gone;  ///< once, and nothing after it
    /// After each wait without proof; it goes on.
    std::function<void(const std::string& why)> unproven = {};
  };

  HolderFence(Hooks hooks, nanoseconds wait) : hooks_(std::move(hooks)), wait_(wait) {}

  /// One at a time. gone() is called at once when no such process runs.
  void fence(const std::string& payload, Outcome outcome);
  [[nodiscard]] bool busy() const { return static_cast<bool>(outcome_.gone); }

  static int send_sigkill(int pidfd);

 private:
  void attempt();
  /// @return why the process is not known to be on its way out, nothing when it is
  std::optional<std::string> kill_holder();
  void finish();

  Hooks hooks_;
  nanoseconds wait_;
  std::string payload_;
  Fd pidfd_;
  ros::Executor::Handle watch_;
  ros::Timer timeout_;
  Outcome outcome_;
};

}  // namespace srfs
