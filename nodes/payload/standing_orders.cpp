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
  next_ = 0;
  done_ = 0;
  again_ = now;
  first_round_ = size() > 0;
  report_ = !first_round_;  // nothing to do is done
}

void StandingOrders::on_peripheral_restarted(MonotonicTime now) {
  if (next_ >= once_.size()) next_ = once_.size();
  again_ = now;
}

const StandingOrder* StandingOrders::next(MonotonicTime now) const {
  if (next_ < size()) return &at(next_);
  return !hold_.empty() && now >= again_ ? &hold_.front() : nullptr;
}

void StandingOrders::advance(bool done, MonotonicTime now) {
  if (size() == 0) return;
  if (next_ >= size()) next_ = once_.size();  // it was the first of a new round
  ++next_;
  if (first_round_ && done) ++done_;
  if (next_ < size()) return;
  again_ = now + repeat_;
  if (std::exchange(first_round_, false)) report_ = true;
}

std::optional<std::uint8_t> StandingOrders::take_first_round() {
  return std::exchange(report_, false) ? std::optional(done_) : std::nullopt;
}

}  // namespace srfs
