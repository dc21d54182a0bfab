// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/executor.hpp"

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include <sys/epoll.h>
#include <sys/eventfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

namespace srfs::ros {

struct Executor::Timer : Registration, std::enable_shared_from_this<Timer> {
  Executor* executor = nullptr;
  MonotonicTime due;
  nanoseconds period{0};
  TimerCallback callback;
  CallbackRecord* record = nullptr;
  std::optional<std::multimap<MonotonicTime, std::shared_ptr<Timer>>::iterator> place;  // in timers_

  void enter() { place = executor->timers_.emplace(due, shared_from_this()); }
  /// What the callback holds goes with the timer, at once, unless it is just running.
  void cancel() override {
    if (place) executor->timers_.erase(*std::exchange(place, std::nullopt));
  }
};

struct Executor::Watch : Registration {
  Executor* executor = nullptr;
  int fd = -1;
  FdCallback callback;
  CallbackRecord* record = nullptr;
  bool cancelled = false;

  void cancel() override {
    if (cancelled) return;
    cancelled = true;
    epoll_ctl(executor->epoll_.get(), EPOLL_CTL_DEL, fd, nullptr);
    executor->watches_.erase(fd);
  }
};

namespace {

constexpr std::size_t most_posts = 1024;
constexpr nanoseconds forever = nanoseconds::max();

/// Without a limit the kernel needs no timer of its own, whose setting and ending lie in the path of every
/// wake-up.
int wait_ms(nanoseconds longest) {
  if (longest == forever) return -1;
  return static_cast<int>(std::clamp<std::int64_t>((longest.count() + 999'999) / 1'000'000, 0, 60'000));
}

// The executor whose loop this thread is in: what it notifies itself is seen without being woken.
thread_local const Executor* in_loop_of = nullptr;

// What the owner holds: forgetting it cancels, while the executor still keeps the object alive through its
// callback.
template <class T>
Executor::Handle owner_handle(std::shared_ptr<T> object) {
  T* raw = object.get();
  return {raw, [kept = std::move(object)](Executor::Registration* r) { r->cancel(); }};
}

}  // namespace

Executor::Executor()
    : epoll_(epoll_create1(EPOLL_CLOEXEC)),
      wake_(eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)),
      timer_fd_(timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC)),
      now_(monotonic_now()) {
  if (!epoll_ || !wake_ || !timer_fd_) throw std::runtime_error("executor: " + errno_text(errno));
  for (const int fd : {wake_.get(), timer_fd_.get()}) {
    epoll_event event{};
    event.events = EPOLLIN;
    event.data.fd = fd;
    epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event);
  }
}

Executor::~Executor() {
  for (const auto& [due, timer] : timers_) timer->place.reset();  // a handle still held cancels nothing
}

/// Runs a callback whose beginning is now_, counts it unless it says that it had nothing to do, and catches
/// what it throws. @return whether it was counted
template <class Callback>
bool Executor::run(CallbackRecord& record, Callback&& callback) {
  const MonotonicTime begun = now_;
  bool worked = true;
  try {
    if constexpr (std::is_same_v<decltype(callback()), bool>) {
      worked = callback();
    } else {
      callback();
    }
  } catch (const std::exception& e) {
    ++record.failed;
    if (!failure_) throw;
    failure_(record, e.what());
  } catch (...) {
    ++record.failed;
    if (!failure_) throw;
    failure_(record, "not a std::exception");
  }
  now_ = monotonic_now();
  if (!worked) return false;
  const nanoseconds took = now_ - begun;
  if (statistics_.add(record, took, now_) && over_budget_) over_budget_(record, took);
  return true;
}

void Executor::name_source(const std::shared_ptr<Source>& source, CallbackKind kind, std::string_view name) {
  source->record_ = &statistics_.record(kind, name);
  std::erase_if(sources_, [](const std::weak_ptr<Source>& s) { return s.expired(); });
  sources_.push_back(source);
}

void Executor::for_each_source(const std::function<void(const CallbackRecord&, const Source&)>& visit) const {
  for (const auto& weak : sources_) {
    if (const auto source = weak.lock()) visit(*source->record_, *source);
  }
}

Executor::Handle Executor::add_timer(MonotonicTime first, nanoseconds period, TimerCallback callback,
                                     std::string_view name) {
  auto timer = std::make_shared<Timer>();
  timer->executor = this;
  timer->due = first;
  timer->period = period;
  timer->callback = std::move(callback);
  timer->record = &statistics_.record(CallbackKind::timer, name);
  timer->enter();
  return owner_handle(std::move(timer));
}

Executor::Handle Executor::add_fd(int fd, std::uint32_t events, FdCallback callback, std::string_view name) {
  auto watch = std::make_shared<Watch>();
  watch->executor = this;
  watch->fd = fd;
  watch->callback = std::move(callback);
  watch->record = &statistics_.record(CallbackKind::descriptor, name);
  epoll_event event{};
  event.events = events;
  event.data.fd = fd;
  if (epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event) != 0)
    throw std::runtime_error("watch descriptor: " + errno_text(errno));
  watches_[fd] = watch;
  return owner_handle(std::move(watch));
}

void Executor::notify(const std::shared_ptr<Source>& source, Priority priority) {
  if (source->queued_.exchange(true)) return;
  {
    const std::lock_guard lock(mutex_);
    incoming_.push_back({source, priority});
  }
  wake();
}

bool Executor::post(std::function<void()> callback, CallbackRecord* record) {
  {
    const std::lock_guard lock(mutex_);
    if (posts_.size() >= most_posts) {
      ++refused_posts_;
      return false;
    }
    posts_.push_back({std::move(callback), record});
  }
  wake();
  return true;
}

void Executor::wake() {
  if (in_loop_of == this || wake_pending_.exchange(true)) return;
  const std::uint64_t one = 1;
  [[maybe_unused]] const ssize_t ignored = write(wake_.get(), &one, sizeof one);
}

void Executor::stop() {
  stopped_ = true;
  wake();
}

void Executor::spin() {
  while (spin_once(forever)) {
  }
}

bool Executor::spin_until(const std::function<bool()>& condition, MonotonicTime deadline) {
  while (!condition()) {
    const nanoseconds left = deadline - monotonic_now();
    // Conditions may also change on middleware threads (a match), which does not wake this thread: look again
    // every few ms.
    constexpr nanoseconds look_again = milliseconds(5);
    if (left <= nanoseconds(0) || !spin_once(std::min(left, look_again))) return condition();
  }
  return true;
}

void Executor::take_incoming() {
  const std::lock_guard lock(mutex_);
  for (Ready& ready : incoming_) {
    if (const auto source = ready.source.lock()) source->ready_since_ = now_;
    ready_[static_cast<std::size_t>(ready.priority)].push_back(std::move(ready.source));
  }
  incoming_.clear();
}

bool Executor::run_posts() {
  // Only what was there when the round began; one at a time, so that what a callback throws loses no other.
  std::size_t due = 0;
  {
    const std::lock_guard lock(mutex_);
    due = posts_.size();
  }
  if (due == 0) return false;
  now_ = monotonic_now();
  for (; due > 0; --due) {
    Post post;
    {
      const std::lock_guard lock(mutex_);
      post = std::move(posts_.front());
      posts_.pop_front();
    }
    run(post.record != nullptr ? *post.record : statistics_.record(CallbackKind::posted, "posted"),
        post.callback);
  }
  return true;
}

bool Executor::run_due_timers() {
  bool ran = false;
  now_ = monotonic_now();
  if (turn_) turn_(now_);
  // Only what was due when the round began: a timer that takes longer than its period starves nothing else.
  const MonotonicTime round = now_;
  while (!timers_.empty() && timers_.begin()->first <= round) {
    const std::shared_ptr<Timer> timer = timers_.begin()->second;
    timers_.erase(timers_.begin());
    timer->place.reset();
    if (timer->period > nanoseconds(0)) {
      // The next deadline lies on the timer's own grid, whatever this wake-up was late by.
      const std::int64_t missed = (now_ - timer->due) / timer->period;
      missed_timer_periods_ += static_cast<std::uint64_t>(missed);
      timer->record->missed_periods += static_cast<std::uint64_t>(missed);
      timer->due += timer->period * (missed + 1);
      timer->enter();
    }
    run(*timer->record, timer->callback);
    ran = true;
  }
  return ran;
}

bool Executor::run_one_source() {
  for (auto& queue : ready_) {
    while (!queue.empty()) {
      const std::shared_ptr<Source> source = queue.front().lock();
      queue.pop_front();
      if (!source) continue;
      now_ = monotonic_now();
      source->queued_ = false;  // before taking: input that comes now queues it again
      if (source->record_ == nullptr) source->record_ = &statistics_.record(CallbackKind::other, "source");
      const bool more = run(*source->record_, [&] { return source->dispatch_one(now_); });
      if (more && &queue != &ready_.front()) ++handled_;
      if (more && !source->queued_.exchange(true)) {
        source->ready_since_ = now_;
        queue.push_back(source);
      }
      return true;
    }
  }
  return false;
}

Executor::Backlog Executor::backlog() const {
  Backlog backlog;
  backlog.handled = handled_;
  // A queue is in order of coming, so its front has waited longest.
  for (const auto& queue : ready_) {
    backlog.waiting += static_cast<std::uint32_t>(queue.size());
    const auto first = queue.empty() ? nullptr : queue.front().lock();
    if (first && (!backlog.oldest || first->ready_since_ < *backlog.oldest))
      backlog.oldest = first->ready_since_;
  }
  return backlog;
}

bool Executor::has_incoming() {
  const std::lock_guard lock(mutex_);
  return !incoming_.empty() || !posts_.empty();
}

void Executor::arm_timer_fd() {
  std::optional<MonotonicTime> next;
  if (!timers_.empty()) next = timers_.begin()->first;
  // An alarm that is earlier than needed (a call that was answered before its deadline) costs one idle turn
  // later instead of two system calls now.
  if (!next || (armed_ && *armed_ <= *next)) return;
  armed_ = next;
  const std::int64_t ns = std::max<std::int64_t>(next->ns(), 1);
  itimerspec spec{};
  spec.it_value.tv_sec = ns / 1'000'000'000;
  spec.it_value.tv_nsec = ns % 1'000'000'000;
  timerfd_settime(timer_fd_.get(), TFD_TIMER_ABSTIME, &spec, nullptr);
}

bool Executor::spin_once(nanoseconds longest) {
  if (stopped_) return false;
  struct InLoop {
    const Executor* before;
    explicit InLoop(const Executor* executor) : before(std::exchange(in_loop_of, executor)) {}
    ~InLoop() { in_loop_of = before; }
  } const in_loop(this);
  bool busy = run_due_timers();
  take_incoming();
  busy = run_posts() || busy;
  busy = run_one_source() || busy;
  arm_timer_fd();
  // What this thread enqueued behind the looks above was not woken for.
  busy = busy || has_incoming();

  std::array<epoll_event, 16> events{};
  const int count =
      epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()), busy ? 0 : wait_ms(longest));
  for (int i = 0; i < count; ++i) {
    const epoll_event& event = events[static_cast<std::size_t>(i)];
    if (event.data.fd == wake_.get()) {
      std::uint64_t ignored = 0;
      [[maybe_unused]] const ssize_t n = read(wake_.get(), &ignored, sizeof ignored);
      wake_pending_ = false;  // after the read: a wake from now on writes again
    } else if (event.data.fd == timer_fd_.get()) {
      std::uint64_t ignored = 0;
      [[maybe_unused]] const ssize_t n = read(timer_fd_.get(), &ignored, sizeof ignored);
      armed_.reset();
    } else if (const auto found = watches_.find(event.data.fd); found != watches_.end()) {
      if (const auto watch = found->second.lock()) {
        now_ = monotonic_now();
        run(*watch->record, [&] { watch->callback(event.events); });
      }
    }
  }
  return !stopped_;
}

}  // namespace srfs::ros
