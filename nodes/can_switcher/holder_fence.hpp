#pragma once

#include <sys/types.h>

#include <functional>
#include <optional>
#include <string>

#include "base/fd.hpp"
#include "base/time.hpp"
#include "ros/executor.hpp"

namespace srfs {

/// Ends a payload's process so surely that it can never write to the bus again, without blocking: SIGKILL by
/// pidfd (a number that was reused meanwhile is never hit), then the exit is waited for, bounded. Work
/// thread.
class HolderFence {
 public:
  /// What it needs from its surroundings.
  struct Hooks {
    std::function<std::optional<pid_t>(const std::string& payload)>
        find;  ///< who holds the payload's instance lock now
    std::function<ros::Executor::Handle(int fd, std::function<void()> readable)> watch;
    std::function<ros::Timer(nanoseconds delay, std::function<void()> due)> after;
  };
  /// @param gone false: still there after the longest wait
  using Done = std::function<void(bool gone)>;

  HolderFence(Hooks hooks, nanoseconds longest_wait)
      : hooks_(std::move(hooks)), longest_wait_(longest_wait) {}

  /// Calls @p done once: at once when no such process runs, else when it is gone or the wait is over. One at
  /// a time.
  void fence(const std::string& payload, Done done);
  [[nodiscard]] bool busy() const { return static_cast<bool>(done_); }

 private:
  void finish(bool gone);

  Hooks hooks_;
  nanoseconds longest_wait_;
  Fd pidfd_;
  ros::Executor::Handle watch_;
  ros::Timer timeout_;
  Done done_;
};

}  // namespace srfs
