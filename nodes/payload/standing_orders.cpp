// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/standing_orders.hpp"

#include <utility>

namespace srfs {

void StandingOrders::set(std::vector<StandingOrder> once, std::vector<StandingOrder> hold, nanoseconds repeat,
                         MonotonicTime now) {
  once_ = std::move(once);
  hold_ = std::move(hold);
  repeat_ = repeat;
  once_done_ = 0;
  unreported_ = size() > 0;
  report_ = !unreported_;  // nothing to do is done
  begin_round();
  again_ = now;
}

void StandingOrders::begin_round() {
  next_ = 0;
  hold_done_ = 0;
  silent_ = 0;
}

void StandingOrders::on_peripheral_restarted(MonotonicTime now) {
  begin_round();
  again_ = now;
}

const StandingOrder* StandingOrders::next(MonotonicTime now) const {
  if (next_ < size()) return &at(next_);
  return size() > 0 && now >= again_ ? &at(0) : nullptr;
}

void StandingOrders::advance(Answer answer, MonotonicTime now) {
  if (size() == 0) return;
  if (next_ >= size()) begin_round();  // it was the first of a new round
  silent_ = 0;
  const bool is_once = next_ < once_.size();
  if (answer == Answer::done) ++(is_once ? once_done_ : hold_done_);
  if (is_once && answer != Answer::refused) {
    once_.erase(once_.begin() + static_cast<std::ptrdiff_t>(next_));
  } else {
    ++next_;
  }
  if (next_ < size()) return;
  again_ = now + repeat_;
  if (once_.empty() && std::exchange(unreported_, false)) report_ = true;
}

bool StandingOrders::on_silence(MonotonicTime now) {
  if (size() == 0) return false;
  if (next_ >= size()) begin_round();
  if (++silent_ < longest_silence) return false;
  advance(Answer::refused, now);
  return true;
}

std::optional<std::uint8_t> StandingOrders::take_first_round() {
  if (!std::exchange(report_, false)) return std::nullopt;
  return static_cast<std::uint8_t>(once_done_ + hold_done_);
}

}  // namespace srfs
