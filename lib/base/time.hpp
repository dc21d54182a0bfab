// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <compare>
#include <cstdint>
#include <optional>
#include <string>

namespace srfs {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::nanoseconds;
using std::chrono::seconds;

/// A point on one time scale. Scales do not mix: a MonotonicTime cannot be compared with a TaiTime.
template <class Scale>
class TimePoint {
 public:
  constexpr TimePoint() = default;
  constexpr explicit TimePoint(nanoseconds since_epoch) : since_epoch_(since_epoch) {}
  [[nodiscard]] constexpr nanoseconds since_epoch() const { return since_epoch_; }
  [[nodiscard]] constexpr std::int64_t ns() const { return since_epoch_.count(); }

  constexpr TimePoint& operator+=(nanoseconds d) {
    since_epoch_ += d;
    return *this;
  }
  friend constexpr TimePoint operator+(TimePoint t, nanoseconds d) { return TimePoint(t.since_epoch_ + d); }
  friend constexpr TimePoint operator-(TimePoint t, nanoseconds d) { return TimePoint(t.since_epoch_ - d); }
  friend constexpr nanoseconds operator-(TimePoint a, TimePoint b) { return a.since_epoch_ - b.since_epoch_; }
  friend constexpr auto operator<=>(TimePoint,
                                    TimePoint) = default;  // NOLINT(modernize-use-nullptr): a false alarm

 private:
  nanoseconds since_epoch_{0};
};

struct MonotonicScale {};
struct UtcScale {};
struct TaiScale {};

/// CLOCK_MONOTONIC: deadlines and intervals. Epoch: boot. Never steps.
using MonotonicTime = TimePoint<MonotonicScale>;
/// UTC as POSIX counts it (no leap seconds), epoch 1970-01-01.
using UtcTime = TimePoint<UtcScale>;
/// TAI, epoch 1958-01-01 (the epoch of CUC on the link, CCSDS 301.0-B).
using TaiTime = TimePoint<TaiScale>;

/// Ticks of the mission: never goes back, also across a restart of the timing node.
using MissionCycle = std::uint64_t;

/// Seconds from the TAI epoch 1958-01-01 to the POSIX epoch 1970-01-01.
inline constexpr std::int64_t posix_epoch_in_tai1958_s = 378'691'200;
/// TAI - UTC since 2017-01-01. The value in force is a parameter of the timing node; this is its default.
inline constexpr int default_leap_seconds = 37;

[[nodiscard]] constexpr TaiTime to_tai(UtcTime t, int leap_seconds = default_leap_seconds) {
  return TaiTime(t.since_epoch() + seconds(posix_epoch_in_tai1958_s + leap_seconds));
}
[[nodiscard]] constexpr UtcTime to_utc(TaiTime t, int leap_seconds = default_leap_seconds) {
  return UtcTime(t.since_epoch() - seconds(posix_epoch_in_tai1958_s + leap_seconds));
}

/// The only two readings of the machine's clocks; adapters and tools call them, pure logic never does.
[[nodiscard]] MonotonicTime monotonic_now();
[[nodiscard]] UtcTime system_utc_now();

/// "2026-11-21T08:00:00.123Z", with @p decimals digits of the second (0-9).
[[nodiscard]] std::string to_iso8601(UtcTime t, int decimals = 3);
/// Reads what to_iso8601 writes, with or without fraction; nullopt for anything else.
[[nodiscard]] std::optional<UtcTime> from_iso8601(const std::string& text);

}  // namespace srfs
