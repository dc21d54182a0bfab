// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw/reopening.hpp"

#include <algorithm>
#include <cerrno>
#include <utility>

#include <sys/epoll.h>
#include <sys/timerfd.h>

#include "base/log.hpp"

namespace srfs::hw {
namespace {

constexpr nanoseconds soonest(1);  // zero would disarm the timer

void arm(int timer, nanoseconds after) {
  itimerspec when{};
  when.it_value.tv_sec = after.count() / 1'000'000'000;
  when.it_value.tv_nsec = after.count() % 1'000'000'000;
  ::timerfd_settime(timer, 0, &when, nullptr);  // also clears an expiry that was not read
}

bool watch(int epoll, int fd) {
  epoll_event event{};
  event.events = EPOLLIN;
  return ::epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &event) == 0;
}

}  // namespace

Reopening::Reopening(std::string name, Opener opener, bool watched)
    : name_(std::move(name)),
      opener_(std::move(opener)),
      watched_(watched),
      epoll_(::epoll_create1(EPOLL_CLOEXEC)),
      timer_(::timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK)) {
  if (watched_) watch(epoll_.get(), timer_.get());
  try_open();
}

int Reopening::device() {
  if (!device_ && monotonic_now() >= next_try_) try_open();
  return device_.get();
}

void Reopening::try_open() {
  auto opened = opener_();
  if (opened && watched_ && !watch(epoll_.get(), opened->get())) opened = Err("epoll: " + errno_text(errno));
  if (!opened) {
    if (opened.error() != reason_) {
      reason_ = std::move(opened.error());
      log::warn("{}: {}", name_, reason_);
    }
    retry_after(wait_);
    wait_ = std::min<nanoseconds>(2 * wait_, retry_interval);
    return;
  }
  device_ = std::move(*opened);
  arm(timer_.get(), nanoseconds(0));
  if (was_there_) ++reopened_;
  if (!reason_.empty()) log::info("{}: open", name_);
  was_there_ = true;
  wait_ = retry_interval;
  reason_.clear();
}

void Reopening::lost(std::string reason, Retry retry) {
  if (!device_) return;
  device_.reset();  // leaves the epoll set by itself: the descriptor has no other holder
  reason_ = std::move(reason);
  log::warn("{}: {}", name_, reason_);
  const bool at_once = retry == Retry::at_once;
  if (at_once) wait_ = first_retry_interval;
  retry_after(at_once ? soonest : retry_interval);
}

void Reopening::wake_at(std::optional<MonotonicTime> at) {
  if (!device_) return;
  arm(timer_.get(), at ? std::max<nanoseconds>(*at - monotonic_now(), soonest) : nanoseconds(0));
}

void Reopening::retry_after(nanoseconds wait) {
  next_try_ = monotonic_now() + wait;
  arm(timer_.get(), wait);
}

}  // namespace srfs::hw
