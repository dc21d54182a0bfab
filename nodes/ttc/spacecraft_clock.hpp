// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"

namespace srfs {

/// The spacecraft time reference status field of every telemetry packet (ECSS-E-ST-70-41C 7.4.3.1 d, values
/// ours).
enum class TimeReference : std::uint8_t { invalid = 0, locked = 1, holdover = 2, set_unlocked = 3 };

/// A tick as it came from another process: nothing is taken for granted.
struct ReceivedTick {
  std::uint32_t utc_s = 0;  ///< the message's seconds read without a sign: to 2106
  std::uint32_t utc_ns = 0;
  std::uint64_t monotonic_ns = 0;  ///< when it was due
  std::uint32_t period_us = 0;
  bool time_valid = false;  ///< as the timing node says
  std::uint8_t sync_state = 0;
};

/// Time of packets: the mission's tick carried on by the monotonic clock.
class SpacecraftClock {
 public:
  /// @param start what the machine's own clock said at @p now; used, as invalid, until the first tick
  SpacecraftClock(UtcTime start, MonotonicTime now) : utc_(start), monotonic_(now) {}

  /// A tick further from now than this is not believed.
  static constexpr seconds tick_age_max{10};
  static constexpr milliseconds period_max{10'000};
  static constexpr int missed_ticks_max = 5;

  /// @return false: the tick cannot be true and was ignored
  [[nodiscard]] bool on_tick(const ReceivedTick& tick, MonotonicTime now);

  [[nodiscard]] UtcTime utc_at(MonotonicTime t) const { return utc_ + (t - monotonic_); }
  [[nodiscard]] TaiTime tai_at(MonotonicTime t) const { return to_tai(utc_at(t)); }
  /// A locked clock without ticks for more than missed_ticks_max periods is in holdover.
  [[nodiscard]] TimeReference reference_at(MonotonicTime t) const;
  [[nodiscard]] bool valid() const { return reference_ != TimeReference::invalid; }

 private:
  UtcTime utc_;
  MonotonicTime monotonic_;
  nanoseconds period_ = milliseconds(100);
  TimeReference reference_ = TimeReference::invalid;
};

}  // namespace srfs
