// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/mission_clock.hpp"

#include <algorithm>
#include <cmath>

namespace srfs {
namespace {

constexpr nanoseconds shortest_slew = seconds(1);

nanoseconds part(nanoseconds d, double ppm) {
  return nanoseconds(std::llround(static_cast<double>(d.count()) * ppm * 1e-6));
}

}  // namespace

UtcTime ReferenceTime::utc_at(MonotonicTime t) const {
  return utc + (t - at) + part(t - at, rate_ppm);
}

UtcTime MissionClock::Piece::utc_at(MonotonicTime t) const {
  const nanoseconds elapsed = t - start;
  return utc + elapsed + part(elapsed, rate_ppm) + part(std::min(elapsed, slew_time), slew_ppm);
}

MissionClock::MissionClock(UtcTime utc, MonotonicTime now) {
  step_to(utc, now);
}

UtcTime MissionClock::utc_at(MonotonicTime t) const {
  for (std::size_t i = 0; i + 1 < count_; ++i) {
    if (t >= pieces_[i].start) return pieces_[i].utc_at(t);
  }
  return pieces_[count_ - 1].utc_at(t);
}

double MissionClock::follow(const ReferenceTime& reference, MonotonicTime now) {
  Piece next;
  next.start = std::max(now, pieces_[0].start);
  next.utc = utc_at(next.start);
  next.rate_ppm = std::clamp(reference.rate_ppm, -rate_limit_ppm, rate_limit_ppm);
  const nanoseconds behind = reference.utc_at(next.start) - next.utc;
  const auto behind_ns = static_cast<double>(behind.count());
  // ns / ppm is milliseconds
  next.slew_time = std::max<nanoseconds>(
      shortest_slew, nanoseconds(std::llround(std::abs(behind_ns) / slew_limit_ppm * 1e6)));
  next.slew_ppm = std::clamp(behind_ns / static_cast<double>(next.slew_time.count()) * 1e6, -slew_limit_ppm,
                             slew_limit_ppm);
  std::move_backward(pieces_.begin(), pieces_.end() - 1, pieces_.end());
  pieces_[0] = next;
  count_ = std::min(count_ + 1, pieces_held);
  return 0;
}

void MissionClock::step_to(UtcTime utc, MonotonicTime now) {
  pieces_[0] = {.start = now, .utc = utc, .rate_ppm = 0, .slew_ppm = 0, .slew_time = nanoseconds(0)};
  count_ = 1;
}

}  // namespace srfs
