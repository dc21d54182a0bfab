#include "ros/worker.hpp"

#include <pthread.h>

namespace srfs::ros {

Worker::Worker(Executor& executor, std::string name, std::size_t capacity)
    : executor_(executor), capacity_(capacity) {
  thread_ = std::thread([this] { run(); });
  pthread_setname_np(thread_.native_handle(), name.substr(0, 15).c_str());
}

Worker::~Worker() {
  *alive_ = false;
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
    jobs_.clear();
  }
  changed_.notify_all();
  thread_.join();
}

bool Worker::post(std::function<void()> job, std::function<void()> done) {
  {
    const std::lock_guard lock(mutex_);
    if (jobs_.size() >= capacity_) {
      ++progress_.refused;
      return false;
    }
    jobs_.push_back({std::move(job), std::move(done)});
  }
  changed_.notify_all();
  return true;
}

WorkerProgress Worker::progress() const {
  const std::lock_guard lock(mutex_);
  WorkerProgress progress = progress_;
  progress.waiting = jobs_.size();
  return progress;
}

void Worker::drain() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return jobs_.empty() && !progress_.busy; });
}

void Worker::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stop_ || !jobs_.empty(); });
    if (stop_) return;
    const Job job = std::move(jobs_.front());
    jobs_.pop_front();
    progress_.busy = true;
    progress_.busy_since = monotonic_now();
    lock.unlock();
    job.run();
    if (job.done) {
      // Results always arrive: the executor's bound covers strangers, a worker's results are bounded by its
      // own queue.
      while (!executor_.post([alive = alive_, done = job.done] {
        if (*alive) done();
      })) {
        std::this_thread::yield();
      }
    }
    lock.lock();
    progress_.busy = false;
    ++progress_.finished;
    changed_.notify_all();
  }
}

}  // namespace srfs::ros
