#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"

namespace srfs {

/// The spacecraft time reference status field of every telemetry packet (ECSS-E-ST-70-41C 7.4.3.1 d, values
/// ours).
enum class TimeReference : std::uint8_t { invalid = 0, locked = 1, holdover = 2, set_unlocked = 3 };

/// Time of packets: the mission's tick carried on by the monotonic clock.
class SpacecraftClock {
 public:
  /// @param start what the machine's own clock said at @p now; used, as invalid, until the first tick
  SpacecraftClock(UtcTime start, MonotonicTime now) : utc_(start), monotonic_(now) {}

  /// @param utc of the tick, which was due at @p due. @param time_valid as the timing node says
  void on_tick(UtcTime utc, MonotonicTime due, bool time_valid, std::uint8_t sync_state);

  [[nodiscard]] UtcTime utc_at(MonotonicTime t) const { return utc_ + (t - monotonic_); }
  [[nodiscard]] TaiTime tai_at(MonotonicTime t) const { return to_tai(utc_at(t)); }
  [[nodiscard]] TimeReference reference() const { return reference_; }
  [[nodiscard]] bool valid() const { return reference_ != TimeReference::invalid; }

 private:
  UtcTime utc_;
  MonotonicTime monotonic_;
  TimeReference reference_ = TimeReference::invalid;
};

}  // namespace srfs
