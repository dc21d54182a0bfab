// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs {

/// What the timing node keeps across restarts.
struct TimingRecord {
  MissionCycle cycle_ceiling = 0;  ///< no cycle at or above it was ever published
  UtcTime utc;                     ///< mission time...
  MonotonicTime at;                ///< ...at this instant of the boot...
  std::string boot_id = "-";       ///< ...with this id (no spaces)
  bool utc_valid = false;
  nanoseconds error{0};                            ///< of utc; only with utc_valid
  std::optional<double> drift_ppm = std::nullopt;  ///< of the monotonic clock, where it was measured
};

enum class TimingRecordError : std::uint8_t { not_a_record, damaged };

/// The stored mission time carried on to @p now, when the record is of this boot; else the stored time as it
/// is.
struct CarriedTime {
  UtcTime utc;
  bool valid = false;  ///< the record was valid, of this boot and not older than ten minutes
  nanoseconds error{0};
  std::optional<double> drift_ppm;  ///< of this boot
};
[[nodiscard]] CarriedTime carry_on(const TimingRecord& record, const std::string& boot_id, MonotonicTime now);

/// A small text ending in a CRC-16 of all before it.
[[nodiscard]] std::string encode_timing_record(const TimingRecord& record);
[[nodiscard]] Result<TimingRecord, TimingRecordError> decode_timing_record(const std::string& text);

/// Write the timing record with this ceiling and the present time. Answer with on_written().
struct SaveCycles {
  MissionCycle ceiling = 0;
};
/// What the reservation decides; carried out by the adapter.
using ReservationAction = std::variant<SaveCycles>;
using ReservationActions = std::vector<ReservationAction>;

/// Sees to it that a restarted timing node never repeats a cycle, with one write per `step` cycles: cycles
/// below the stored ceiling may be published, and a restart begins at the ceiling (so at most `step` cycles
/// are lost). Pure.
class CycleReservation {
 public:
  static constexpr MissionCycle step = 1000;
  /// Asked for while so many are left: time enough for any write (ten seconds at the 100 ms tick).
  static constexpr MissionCycle margin = 100;

  /// @param stored  the ceiling found on disk (0: nothing found)
  explicit CycleReservation(MissionCycle stored) : first_(stored), stored_(stored) {}

  [[nodiscard]] MissionCycle first_cycle() const { return first_; }
  /// One write at a time. @param next  the next cycle to be published
  [[nodiscard]] ReservationActions reserve(MissionCycle next);
  /// Writes the stored ceiling again with the present time, unless a write runs.
  [[nodiscard]] ReservationActions renew();
  /// Outcome of the write. After a failure the next reserve() asks again.
  void on_written(MissionCycle ceiling, bool ok);
  /// Counts a published cycle that no stored ceiling covers: the disk fails, and the tick goes on all the
  /// same.
  void on_published(MissionCycle cycle);

  [[nodiscard]] std::uint64_t unreserved() const { return unreserved_; }
  [[nodiscard]] std::uint64_t failed_writes() const { return failed_writes_; }

 private:
  MissionCycle first_;
  MissionCycle stored_;
  bool writing_ = false;
  std::uint64_t unreserved_ = 0;
  std::uint64_t failed_writes_ = 0;
};

}  // namespace srfs
