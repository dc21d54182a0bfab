// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/worker.hpp"

#include <pthread.h>

#include "base/background.hpp"

namespace srfs::ros {

Worker::Worker(Executor& executor, const std::string& name, std::size_t capacity, milliseconds deadline,
               WorkerKind kind)
    : executor_(executor),
      name_(name.substr(0, 15)),
      deadline_(deadline),
      kind_(kind),
      capacity_(capacity),
      record_(&executor.statistics().record(CallbackKind::posted, "worker " + name)) {
  thread_ = std::thread([this] { run(); });
  pthread_setname_np(thread_.native_handle(), name_.c_str());
  executor_.add_worker(this);
}

Worker::~Worker() {
  executor_.remove_worker(this);
  *alive_ = false;
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    jobs_.clear();
  }
  changed_.notify_all();
  thread_.join();
}

bool Worker::post(std::function<void()> job, std::function<void()> done,
                  std::optional<milliseconds> deadline) {
  {
    const std::lock_guard lock(mutex_);
    if (jobs_.size() >= capacity_) {
      ++progress_.refused;
      return false;
    }
    if (jobs_.empty()) first_waits_since_ = monotonic_now();
    jobs_.push_back({std::move(job), std::move(done), deadline.value_or(deadline_)});
  }
  changed_.notify_all();
  return true;
}

WorkerProgress Worker::progress() const {
  const std::lock_guard lock(mutex_);
  WorkerProgress progress = progress_;
  progress.waiting = jobs_.size();
  // A thread that does not take what waits is as frozen as one inside a job.
  if (progress.busy) {
    progress.owes_since = progress.busy_since;
  } else if (!jobs_.empty()) {
    progress.owes_since = first_waits_since_;
    progress.deadline = jobs_.front().deadline;
  }
  return progress;
}

void Worker::review_cpu(MonotonicTime now) {
  const ThreadCpuFiles* files = nullptr;
  bool owes = false;
  {
    const std::lock_guard lock(mutex_);
    if (cpu_) files = &*cpu_;  // set once
    owes = progress_.busy || !jobs_.empty();
  }
  const auto cpu = files != nullptr ? files->read() : std::nullopt;
  if (!cpu) return;
  // What it waited while it owed nothing excuses nothing.
  if (owes && !std::exchange(owed_, owes)) {
    wait_.skip_to(*cpu, now);
  } else {
    owed_ = owes;
    wait_.on_reading(*cpu, owes && files->state() == 'R', now);
  }
  waits_.add(now, {wait_.total(), cpu->ran, wait_.total()});
}

void Worker::drain() {
  while (true) {
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return jobs_.empty() && !progress_.busy; });
      if (finished_.empty()) return;
    }
    run_finished();
  }
}

void Worker::run_finished() {
  // One by one: what a throwing `done` leaves behind is handed over by the next post.
  const auto alive = alive_;
  std::size_t due = 0;
  {
    const std::lock_guard lock(mutex_);
    due = finished_.size();
  }
  for (; due > 0 && *alive; --due) {
    std::function<void()> done;
    {
      const std::lock_guard lock(mutex_);
      if (finished_.empty()) return;
      done = std::move(finished_.front());
      finished_.pop_front();
    }
    done();
  }
}

void Worker::run() {
  std::unique_lock lock(mutex_);
  cpu_ = ThreadCpuFiles::open_own();
  while (true) {
    changed_.wait(lock, [this] { return stop_ || !jobs_.empty(); });
    if (stop_) return;
    const Job job = std::move(jobs_.front());
    jobs_.pop_front();
    progress_.busy = true;
    progress_.busy_since = monotonic_now();
    progress_.deadline = job.deadline;
    lock.unlock();
    std::function<void()> done = job.done;
    bool failed = false;
    if (kind_ == WorkerKind::background) enter_background();  // again: a loan may have ended with its lender
    try {
      job.run();
    } catch (...) {
      failed = true;
      done = [error = std::current_exception()] { std::rethrow_exception(error); };
    }
    lock.lock();
    // Counted before any thread can see that the job has ended.
    progress_.busy = false;
    first_waits_since_ = monotonic_now();
    progress_.failed += failed ? 1 : 0;
    ++progress_.finished;
    if (done) finished_.push_back(done);
    changed_.notify_all();
    if (!done) continue;
    lock.unlock();
    // A refused post is no loss: the next one, or drain(), hands over everything that has finished.
    executor_.post(
        [this, alive = alive_] {
          if (*alive) run_finished();
        },
        record_);
    lock.lock();
  }
}

}  // namespace srfs::ros
