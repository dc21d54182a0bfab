// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <mission/structures.hpp>

#include "base/time.hpp"
#include "wire/boot_record.hpp"

namespace srfs {

/// What distinguishes this start of the computer from others.
struct BootFacts {
  std::string boot_id;                    ///< another one at each start
  std::optional<bool> reset_by_watchdog;  ///< as the watchdog reports; nullopt: it cannot
};

// What the recorder decides; carried out by the adapter in the given order.

/// This process is the first of a new boot.
struct ReportBoot {
  std::uint32_t count = 0;
  mission::ResetCause cause = mission::ResetCause::unknown;
};
/// Write the record. If that does not work, call on_write_failed().
struct SaveBootRecord {
  wire::BootRecord record;
};

/// The watchdog has been fed for Settings::healthy_after without a gap, the first time in this process.
struct NoteHealthySuite {};

using BootAction = std::variant<ReportBoot, SaveBootRecord, NoteHealthySuite>;
using BootActions = std::vector<BootAction>;

/// Keeps the boot record: whether this is a new boot and why, and when it became healthy. Pure; one thread.
class BootRecorder {
 public:
  struct Settings {
    nanoseconds healthy_after;   ///< the watchdog fed for so long without a gap: healthy
    nanoseconds withheld_after;  ///< not fed for so long: recorded, in case the watchdog bites
  };

  /// @param before  what stands on disk; nullopt: nothing
  BootRecorder(const std::optional<wire::BootRecord>& before, const BootFacts& facts, Settings settings);

  /// Once.
  [[nodiscard]] BootActions begin();
  [[nodiscard]] const wire::BootRecord& record() const { return record_; }
  [[nodiscard]] mission::ResetCause cause() const {
    return static_cast<mission::ResetCause>(record_.reset_cause);
  }

  /// The watchdog was due. @param utc  now; nullopt while the time is not valid
  [[nodiscard]] BootActions on_feeding(bool fed, MonotonicTime now, std::optional<UtcTime> utc);
  /// The watchdog is not fed from now on.
  [[nodiscard]] BootActions on_feeding_ended();
  /// The node ends because it was asked to.
  [[nodiscard]] BootActions on_end();
  /// The record is written again with the next call.
  void on_write_failed() { unwritten_ = true; }

 private:
  void change();
  void withhold();
  void note_feeding(bool fed, MonotonicTime now, std::optional<UtcTime> utc);
  [[nodiscard]] BootActions save();
  [[nodiscard]] static mission::ResetCause cause_of(const std::optional<wire::BootRecord>& before,
                                                    const BootFacts& facts);

  Settings settings_;
  wire::BootRecord record_;
  bool new_boot_ = false;
  bool unwritten_ = false;
  bool healthy_here_ = false;  ///< in this process: the boot may have been before it
  std::optional<MonotonicTime> fed_since_;
  MonotonicTime last_fed_;
  std::optional<MonotonicTime> not_fed_since_;
};

}  // namespace srfs
