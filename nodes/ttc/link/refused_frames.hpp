// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"
#include "nodes/ttc/link/uplink_chain.hpp"

namespace srfs {

/// What security refused, summed up: the first frame is reported at once, and what follows once in a period,
/// however much a stranger sends. Pure.
class RefusedFrames {
 public:
  static constexpr seconds period{60};

  struct Sum {
    std::uint32_t not_authentic = 0;
    std::uint32_t replayed = 0;
    std::uint32_t too_old = 0;
    std::uint32_t counter_out_of_range = 0;
    std::uint64_t newest_counter = 0;
    seconds since{0};  ///< the last sum; 0: longer than a period
  };

  /// @param counters  of the uplink, which only grow. @return what is to be reported now
  [[nodiscard]] std::optional<Sum> take_due(const UplinkCounters& counters, MonotonicTime now) {
    const auto due = next_due(counters);
    if (!due || now < *due) return std::nullopt;
    const bool quiet = !reported_at_ || now - *reported_at_ >= 2 * period;
    // Forged frames have no counter of their own.
    const bool with_counter = counters.replayed != reported_.replayed ||
                              counters.too_old != reported_.too_old ||
                              counters.counter_out_of_range != reported_.counter_out_of_range;
    const Sum sum{.not_authentic = counters.not_authentic - reported_.not_authentic,
                  .replayed = counters.replayed - reported_.replayed,
                  .too_old = counters.too_old - reported_.too_old,
                  .counter_out_of_range = counters.counter_out_of_range - reported_.counter_out_of_range,
                  .newest_counter = with_counter ? counters.refused_counter : 0,
                  .since = quiet ? seconds(0) : std::chrono::duration_cast<seconds>(now - *reported_at_)};
    reported_ = counters;
    reported_at_ = now;
    return sum;
  }
  [[nodiscard]] std::optional<MonotonicTime> next_due(const UplinkCounters& counters) const {
    if (total(counters) == total(reported_)) return std::nullopt;
    return reported_at_ ? *reported_at_ + period : MonotonicTime{};
  }

 private:
  static std::uint64_t total(const UplinkCounters& c) {
    return std::uint64_t{c.not_authentic} + c.replayed + c.too_old + c.counter_out_of_range;
  }
  UplinkCounters reported_;
  std::optional<MonotonicTime> reported_at_;
};

}  // namespace srfs
