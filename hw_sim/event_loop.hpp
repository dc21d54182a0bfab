#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "base/fd.hpp"
#include "base/time.hpp"

namespace srfs::sim {

/// One thread's epoll loop with timers. Callbacks get the time of the wake-up, read once per round.
class EventLoop {
 public:
  using FdCallback = std::function<void(std::uint32_t events, MonotonicTime now)>;
  using TimerCallback = std::function<void(MonotonicTime now)>;
  using Timer = std::size_t;

  /// Throws std::system_error when the kernel gives no descriptors.
  EventLoop();

  /// @param fd  stays the caller's; unwatch before closing it
  void watch(int fd, std::uint32_t events, FdCallback callback);
  void change(int fd, std::uint32_t events);
  void unwatch(int fd);

  /// A timer for the loop's lifetime, not running.
  [[nodiscard]] Timer add_timer(TimerCallback callback);
  /// One shot at @p at, replacing what was set; nullopt stops it.
  void set_timer(Timer timer, std::optional<MonotonicTime> at);

  /// Runs until stop().
  void run();
  void stop() { running_ = false; }

 private:
  struct TimerEntry {
    std::optional<MonotonicTime> at;
    TimerCallback callback;
  };
  void run_timers(MonotonicTime now);
  void arm();

  Fd epoll_;
  Fd timer_fd_;
  std::map<int, std::shared_ptr<FdCallback>> callbacks_;
  std::vector<TimerEntry> timers_;
  bool running_ = true;
};

}  // namespace srfs::sim
