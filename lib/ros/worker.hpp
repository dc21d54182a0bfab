// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>

#include "base/cpu_wait.hpp"
#include "base/time.hpp"
#include "ros/executor.hpp"

namespace srfs::ros {

/// What a worker is doing, for liveness answers and telemetry.
struct WorkerProgress {
  std::uint64_t finished = 0;
  std::uint64_t refused = 0;  ///< jobs not taken because the queue was full
  std::uint64_t failed = 0;   ///< jobs that ended with an exception; their `done` is not called
  std::size_t waiting = 0;    ///< jobs not begun
  bool busy = false;
  MonotonicTime busy_since;                   ///< when busy
  std::optional<MonotonicTime> owes_since{};  ///< a job runs, or waits though none runs
  milliseconds deadline{0};                   ///< of that job
};

/// How a worker shares the CPUs and the disk.
enum class WorkerKind : std::uint8_t {
  normal,      ///< as its process
  background,  ///< behind all other threads (base/background.hpp)
};

/// A named thread for what may block: files and fsync, heavy computation, blocking devices. Jobs run in
/// order; what they produced is handled by their `done` on the work thread. The destructor finishes the job
/// that runs, drops the waiting ones and joins. An exception of a job is thrown again on the work thread,
/// where it counts as that of a callback.
class Worker {
 public:
  /// On the work thread. @param name at most 15 characters (the thread's name); @param capacity jobs waiting
  /// at most; further ones are refused; @param deadline of one job: when one runs for longer, or could run
  /// and is not begun, the thread is frozen; liveness answers say so, and the node is restarted
  Worker(Executor& executor, const std::string& name, std::size_t capacity, milliseconds deadline,
         WorkerKind kind = WorkerKind::normal);
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// Never blocks. @param job on the worker's thread; @param done afterwards on the work thread (may be
  /// empty)
  /// @param deadline of this job; nullopt: the worker's
  /// @return false when the queue is full: the job is dropped and counted
  bool post(std::function<void()> job, std::function<void()> done = {},
            std::optional<milliseconds> deadline = {});
  /// The same for a job with a result, which @p done gets. @param work returns it
  template <class Work, class Done>
  bool ask(Work work, Done done) {
    auto result = std::make_shared<std::optional<std::invoke_result_t<Work&>>>();
    return post([result, work = std::move(work)]() mutable { result->emplace(work()); },
                [result, done = std::move(done)]() mutable { done(std::move(**result)); });
  }
  [[nodiscard]] WorkerProgress progress() const;
  /// Reads how long the thread has waited for a CPU. To be called now and then, each 100 ms in a ring; on the
  /// work thread.
  void review_cpu(MonotonicTime now);
  /// Of the time since then, what it was ready to run without a CPU, as far as review_cpu() saw it.
  [[nodiscard]] nanoseconds waited_since(MonotonicTime since) const { return waits_.since(since).waited; }
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] milliseconds deadline() const { return deadline_; }
  /// Runs all jobs and their `done` to the end, also those that a `done` posts; for shutting down without
  /// losing writes. On the work thread; blocks.
  void drain();

 private:
  struct Job {
    std::function<void()> run;
    std::function<void()> done;
    milliseconds deadline;
  };
  void run();
  void run_finished();

  Executor& executor_;
  const std::string name_;
  const milliseconds deadline_;
  const WorkerKind kind_;
  std::size_t capacity_;
  CallbackRecord* record_;  // run time of `done`
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Job> jobs_;
  std::deque<std::function<void()>> finished_;  // `done` of jobs that ended; bounded by the jobs
  WorkerProgress progress_;
  MonotonicTime first_waits_since_;  // for the thread
  bool stop_ = false;
  std::optional<ThreadCpuFiles> cpu_;  ///< of the thread, once it runs
  CpuWait wait_;                       ///< work thread's, as the next two
  bool owed_ = false;                  ///< at the last review
  CpuHistory waits_;
  std::shared_ptr<bool> alive_ = std::make_shared<bool>(true);  // work thread's: no `done` after destruction
  std::thread thread_;
};

}  // namespace srfs::ros
