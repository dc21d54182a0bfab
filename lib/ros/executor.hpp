// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/fd.hpp"
#include "base/time.hpp"
#include "ros/callback_statistics.hpp"
#include "ros/topics.hpp"

namespace srfs::ros {

class Worker;

/// Something with input for the work thread (a DDS reader, a worker's results). Lives as long as its
/// registration.
class Source {
 public:
  Source() = default;
  Source(const Source&) = delete;
  Source& operator=(const Source&) = delete;
  virtual ~Source() = default;
  /// Handles one item. On the work thread. @return true when one was handled (more may be waiting)
  virtual bool dispatch_one(MonotonicTime now) = 0;

 private:
  friend class Executor;
  std::atomic<bool> queued_{false};
  CallbackRecord* record_ = nullptr;  ///< the executor's; nullptr: not counted by name
  MonotonicTime ready_since_;         ///< while in a queue
};

/// One work thread on an epoll loop: DDS input, timers, descriptors and signals all arrive here, so callbacks
/// never run at the same time and need no locks. Among ready sources the highest priority goes first, one
/// item at a time, so a burst of bulk never delays the tick by more than one callback. Due timers run before
/// sources. Every callback is counted with its run time; one that throws is caught here.
class Executor {
 public:
  Executor();
  ~Executor();
  Executor(const Executor&) = delete;
  Executor& operator=(const Executor&) = delete;

  using TimerCallback = std::function<void()>;
  using FdCallback = std::function<void(std::uint32_t epoll_events)>;

  /// A registration; dropping it ends it. On the work thread only, also inside its own callback.
  class Registration {
   public:
    virtual ~Registration() = default;
    virtual void cancel() = 0;
  };
  using Handle = std::shared_ptr<Registration>;

  /// @param period zero: once. A periodic timer that missed deadlines skips them (counted) instead of
  /// bursting. @param name in the statistics
  [[nodiscard]] Handle add_timer(MonotonicTime first, nanoseconds period, TimerCallback callback,
                                 std::string_view name = "timer");
  /// @param events EPOLLIN, EPOLLOUT...; level-triggered
  [[nodiscard]] Handle add_fd(int fd, std::uint32_t events, FdCallback callback,
                              std::string_view name = "descriptor");
  /// Gives a source its name in the statistics. On the work thread.
  void name_source(const std::shared_ptr<Source>& source, CallbackKind kind, std::string_view name);
  /// Calls @p visit(record, source) for every named source that lives. On the work thread.
  void for_each_source(const std::function<void(const CallbackRecord&, const Source&)>& visit) const;

  /// Marks the source as having input. Any thread; never blocks on the work thread.
  void notify(const std::shared_ptr<Source>& source, Priority priority);
  /// Runs the callback on the work thread, soon. Any thread. @return false when 1024 are waiting already
  /// (counted). @param record what its run time is counted under; nullptr: "posted"
  bool post(std::function<void()> callback, CallbackRecord* record = nullptr);

  /// Runs until stop().
  void spin();
  /// Runs what is due, waits for at most @p longest when nothing is (nanoseconds::max(): without limit).
  /// @return false after stop()
  bool spin_once(nanoseconds longest);
  /// Runs until @p condition holds or the deadline passes. @return the condition
  bool spin_until(const std::function<bool()>& condition, MonotonicTime deadline);
  /// Any thread.
  void stop();

  /// Input that came and is not handled.
  struct Backlog {
    std::uint32_t waiting = 0;  ///< sources with input
    std::uint32_t handled = 0;  ///< items since the start, modulo 2^32, without the liveness checks
    std::optional<MonotonicTime> oldest;
  };
  /// On the work thread.
  [[nodiscard]] Backlog backlog() const;
  /// Called as each turn of the loop begins, before anything else of it; must not block. Empty: nothing is.
  void on_turn(std::function<void(MonotonicTime)> callback) { turn_ = std::move(callback); }
  /// The workers whose results come here, on the work thread; each enters and leaves by itself.
  [[nodiscard]] const std::vector<Worker*>& workers() const { return workers_; }
  void add_worker(Worker* worker) { workers_.push_back(worker); }
  void remove_worker(const Worker* worker) { std::erase(workers_, worker); }

  /// Time of this wake-up: read once before each callback.
  [[nodiscard]] MonotonicTime now() const { return now_; }
  [[nodiscard]] std::uint64_t missed_timer_periods() const { return missed_timer_periods_; }
  [[nodiscard]] std::uint64_t refused_posts() const { return refused_posts_; }
  /// On the work thread only.
  [[nodiscard]] CallbackStatistics& statistics() { return statistics_; }
  /// Called when a callback was over its budget, at most every 10 s for each.
  void on_over_budget(std::function<void(const CallbackRecord&, nanoseconds took)> callback) {
    over_budget_ = std::move(callback);
  }
  /// Called when a callback ended with an exception. Without one it goes on to the caller of spin.
  void on_failure(std::function<void(const CallbackRecord&, const std::string& what)> callback) {
    failure_ = std::move(callback);
  }

 private:
  struct Timer;
  struct Watch;
  struct Ready {
    std::weak_ptr<Source> source;
    Priority priority;
  };

  struct Post {
    std::function<void()> callback;
    CallbackRecord* record;
  };

  template <class Callback>
  bool run(CallbackRecord& record, Callback&& callback);
  void arm_timer_fd();
  bool run_due_timers();
  bool run_one_source();
  bool run_posts();
  void wake();
  void take_incoming();
  [[nodiscard]] bool has_incoming();

  Fd epoll_;
  Fd wake_;
  Fd timer_fd_;
  MonotonicTime now_;
  std::multimap<MonotonicTime, std::shared_ptr<Timer>> timers_;
  std::optional<MonotonicTime> armed_;
  std::map<int, std::weak_ptr<Watch>> watches_;
  std::array<std::deque<std::weak_ptr<Source>>, 4> ready_;  // work thread's; at most one entry a source

  std::mutex mutex_;  // guards the two below
  std::deque<Ready> incoming_;
  std::deque<Post> posts_;
  std::atomic<bool> wake_pending_{false};
  std::atomic<bool> stopped_{false};
  std::atomic<std::uint64_t> refused_posts_{0};
  std::uint64_t missed_timer_periods_ = 0;
  CallbackStatistics statistics_;
  std::vector<std::weak_ptr<Source>> sources_;  // named ones
  std::vector<Worker*> workers_;
  std::function<void(MonotonicTime)> turn_;
  std::uint32_t handled_ = 0;
  std::function<void(const CallbackRecord&, nanoseconds)> over_budget_;
  std::function<void(const CallbackRecord&, const std::string&)> failure_;
};

using Timer = Executor::Handle;

}  // namespace srfs::ros
