// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "base/cpu_wait.hpp"
#include "base/fd.hpp"
#include "base/time.hpp"
#include "hw_sim/running_clock.hpp"

namespace srfs::sim {

/// One thread's epoll loop with timers. The executor of nodes (lib/ros/executor.hpp) has another job: input
/// of several threads, priorities, statistics. What both share is ten calls of epoll and timerfd. Callbacks
/// get the time of the wake-up, read once per round.
///
/// Timers and callbacks are on the true clock: what a device owes, it does as soon as it can. A time-out
/// against others it measures with running_clock(), and sets its timer to earliest(). If more is lost until
/// then, the timer comes too early and is set again.
class EventLoop {
 public:
  using FdCallback = std::function<void(std::uint32_t events, MonotonicTime now)>;
  using TimerCallback = std::function<void(MonotonicTime now)>;
  using Timer = std::size_t;

  /// For the thread that constructs it. Throws std::system_error when the kernel gives no descriptors.
  EventLoop();

  /// @param fd  stays the caller's; unwatch before closing it
  void watch(int fd, std::uint32_t events, FdCallback callback);
  void change(int fd, std::uint32_t events);
  void unwatch(int fd);

  /// A timer for the loop's lifetime, not running.
  [[nodiscard]] Timer add_timer(TimerCallback callback);
  /// One shot at @p at, replacing what was set; nullopt stops it.
  void set_timer(Timer timer, std::optional<MonotonicTime> at);

  /// Of this thread, advanced once per round.
  [[nodiscard]] const RunningClock& running_clock() const { return running_clock_; }
  [[nodiscard]] RunningTime running_now() const { return running_clock_.now(); }
  /// For set_timer().
  [[nodiscard]] std::optional<MonotonicTime> earliest(std::optional<RunningTime> t) const {
    return t ? std::optional(running_clock_.earliest(*t)) : std::nullopt;
  }

  /// Runs until stop().
  void run();
  void stop() { running_ = false; }

 private:
  struct TimerEntry {
    std::optional<MonotonicTime> at;
    TimerCallback callback;
  };
  void run_timers(MonotonicTime now);
  /// @return when the next timer is due
  std::optional<MonotonicTime> arm();
  [[nodiscard]] ThreadCpu own_cpu() const;

  Fd epoll_;
  Fd timer_fd_;
  std::map<int, std::shared_ptr<FdCallback>> callbacks_;
  std::vector<TimerEntry> timers_;
  std::optional<ThreadCpuFiles> cpu_files_;  // none: the kernel does not count; lateness is seen all the same
  RunningClock running_clock_;
  bool running_ = true;
};

}  // namespace srfs::sim
