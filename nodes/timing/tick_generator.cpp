// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/tick_generator.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace srfs {
namespace {

constexpr nanoseconds second = seconds(1);
constexpr int slew_percent = 1;

std::int64_t positive_remainder(std::int64_t value, std::int64_t divisor) {
  const std::int64_t r = value % divisor;
  return r < 0 ? r + divisor : r;
}

}  // namespace

bool is_tick_period(nanoseconds period) {
  if (period < milliseconds(1) || period > seconds(60)) return false;
  return period <= second ? second % period == nanoseconds(0) : period % second == nanoseconds(0);
}

TickGenerator::TickGenerator(nanoseconds period, MissionCycle first_cycle, MonotonicTime first_due)
    : period_(period), next_cycle_(first_cycle), next_due_(first_due) {
  assert(is_tick_period(period));
}

nanoseconds TickGenerator::local_period() const {
  if (!grid_) return period_;
  return nanoseconds(std::llround(static_cast<double>(period_.count()) * (grid_->second_ns / 1e9)));
}

nanoseconds TickGenerator::phase_error(MonotonicTime due) const {
  if (!grid_) return nanoseconds(0);
  // Reference time of `due`, counted from a point of the grid where a tick belongs: exact integers first, so
  // that a long time since the edge costs no precision, then the remainder within one period.
  const double elapsed_s = static_cast<double>((due - grid_->edge).count()) / grid_->second_ns;
  const double whole_s = std::floor(elapsed_s);
  const auto fraction_ns = static_cast<std::int64_t>(std::llround((elapsed_s - whole_s) * 1e9));
  const std::int64_t period_s = std::max<std::int64_t>(1, period_ / second);
  const std::int64_t second_in_period =
      positive_remainder(grid_->index + static_cast<std::int64_t>(whole_s), period_s);
  std::int64_t error = (second_in_period * second.count() + fraction_ns) % period_.count();
  if (error > period_.count() / 2) error -= period_.count();
  return nanoseconds(error);
}

nanoseconds TickGenerator::interval_after(MonotonicTime due) const {
  const nanoseconds wanted = local_period() - phase_error(due);
  const nanoseconds slew = period_ * slew_percent / 100;
  return std::clamp(wanted, period_ - slew, period_ + slew);
}

std::optional<Tick> TickGenerator::on_wakeup(MonotonicTime now) {
  if (now < next_due_) return std::nullopt;

  Tick tick;
  const auto missed = static_cast<std::uint64_t>((now - next_due_) / local_period());
  tick.skipped = missed;
  tick.cycle = next_cycle_ + missed;
  tick.due = next_due_ + local_period() * static_cast<std::int64_t>(missed);
  tick.late = now - tick.due;
  tick.phase_error = phase_error(tick.due);

  skipped_total_ += missed;
  next_cycle_ = tick.cycle + 1;
  next_due_ = tick.due + interval_after(tick.due);
  // The slewed interval may be 1 % shorter than the local period that counted the missed ticks.
  if (next_due_ <= now) next_due_ = now + nanoseconds(1);
  assert(next_due_ > now);
  return tick;
}

}  // namespace srfs
