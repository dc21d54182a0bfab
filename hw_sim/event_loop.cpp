// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/event_loop.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <ctime>
#include <system_error>

#include <sys/epoll.h>
#include <sys/timerfd.h>
#include <unistd.h>

namespace srfs::sim {

EventLoop::EventLoop()
    : epoll_(epoll_create1(EPOLL_CLOEXEC)),
      timer_fd_(timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK)),
      cpu_files_(ThreadCpuFiles::open_own()),
      running_clock_(monotonic_now(), own_cpu()) {
  if (!epoll_ || !timer_fd_) throw std::system_error(errno, std::generic_category(), "epoll or timerfd");
  watch(timer_fd_.get(), EPOLLIN, [this](std::uint32_t, MonotonicTime) {
    std::uint64_t expirations = 0;
    [[maybe_unused]] const ssize_t n = read(timer_fd_.get(), &expirations, sizeof expirations);
  });
}

void EventLoop::watch(int fd, std::uint32_t events, FdCallback callback) {
  epoll_event event{};
  event.events = events;
  event.data.fd = fd;
  if (epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, fd, &event) != 0) {
    throw std::system_error(errno, std::generic_category(), "epoll_ctl");
  }
  callbacks_[fd] = std::make_shared<FdCallback>(std::move(callback));
}

void EventLoop::change(int fd, std::uint32_t events) {
  epoll_event event{};
  event.events = events;
  event.data.fd = fd;
  epoll_ctl(epoll_.get(), EPOLL_CTL_MOD, fd, &event);
}

void EventLoop::unwatch(int fd) {
  epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, fd, nullptr);
  callbacks_.erase(fd);
}

EventLoop::Timer EventLoop::add_timer(TimerCallback callback) {
  timers_.push_back({std::nullopt, std::move(callback)});
  return timers_.size() - 1;
}

void EventLoop::set_timer(Timer timer, std::optional<MonotonicTime> at) {
  timers_.at(timer).at = at;
}

void EventLoop::run_timers(MonotonicTime now) {
  for (std::size_t i = 0; i < timers_.size(); ++i) {
    if (!timers_[i].at || *timers_[i].at > now) continue;
    timers_[i].at.reset();
    timers_[i].callback(now);
  }
}

ThreadCpu EventLoop::own_cpu() const {
  const auto counted = cpu_files_ ? cpu_files_->read() : std::nullopt;
  ThreadCpu own = counted.value_or(ThreadCpu{});
  timespec ran{};  // the kernel's file follows at its ticks only
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &ran);
  own.ran = seconds(ran.tv_sec) + nanoseconds(ran.tv_nsec);
  return own;
}

std::optional<MonotonicTime> EventLoop::arm() {
  std::optional<MonotonicTime> next;
  for (const TimerEntry& timer : timers_) {
    if (timer.at && (!next || *timer.at < *next)) next = timer.at;
  }
  itimerspec spec{};
  if (next) {
    const std::int64_t ns = std::max<std::int64_t>(1, next->ns());  // zero would stop it
    spec.it_value = {.tv_sec = ns / 1'000'000'000, .tv_nsec = ns % 1'000'000'000};
  }
  timerfd_settime(timer_fd_.get(), TFD_TIMER_ABSTIME, &spec, nullptr);
  return next;
}

void EventLoop::run() {
  std::array<epoll_event, 32> events{};
  while (running_) {
    const std::optional<MonotonicTime> due = arm();
    const int n = epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()), -1);
    if (n < 0 && errno != EINTR) throw std::system_error(errno, std::generic_category(), "epoll_wait");
    const MonotonicTime now = monotonic_now();
    running_clock_.advance(now, own_cpu(), due);
    // Timers first: they pace the devices, descriptors only bring requests.
    run_timers(now);
    for (int i = 0; i < n && running_; ++i) {
      const auto found = callbacks_.find(events[static_cast<std::size_t>(i)].data.fd);
      if (found == callbacks_.end()) continue;  // unwatched by an earlier callback of this round
      const std::shared_ptr<FdCallback> callback = found->second;
      (*callback)(events[static_cast<std::size_t>(i)].events, now);
    }
  }
}

}  // namespace srfs::sim
