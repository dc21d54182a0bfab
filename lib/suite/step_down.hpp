// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "base/fd.hpp"
#include "base/state_file.hpp"
#include "base/time.hpp"
#include "suite/step_policy.hpp"
#include "wire/boot_record.hpp"

namespace srfs::suite {

/// Starts of the suite that do not become healthy step it down. Values as in the enumerations boot_step and
/// boot_step_cause of the mission dictionary.
enum class BootStep : std::uint8_t {
  normal,     ///< everything as it was left
  last_good,  ///< last good versions
  golden,     ///< golden versions, factory parameters; schedule and stores set aside; safe mode
  rescue,     ///< srfs_rescue instead of the suite
};
enum class StepCause : std::uint8_t {
  none,
  unhealthy_starts,
  start_failed,    ///< the program that starts the suite could not, and no room is left for another try
  commanded,       ///< by telecommand or by hand
  no_contact,      ///< srfs_rescue was not commanded for long: the suite gets another try
  calm,            ///< healthy for long enough: one step up
  record_damaged,  ///< both copies of the record were lost
};
[[nodiscard]] std::string_view to_text(BootStep step);
[[nodiscard]] std::string_view to_text(StepCause cause);

/// What is on disk about it: VAR/state/boot/step_a and step_b, written by what starts the suite.
struct StepRecord {
  BootStep step = BootStep::normal;
  StepCause cause = StepCause::none;    ///< why the step changed last
  std::uint32_t starts = 0;             ///< in a row, this one included, since one that became healthy
  std::uint32_t healthy_boot = 0;       ///< number of the last boot that is known to have become healthy
  BootStep applied = BootStep::normal;  ///< the deepest step in this row whose measures were taken
  std::uint32_t set_aside = 0;          ///< number of the newest VAR/set_aside/NUMBER
  bool reported = true;                 ///< the ground was sent the event of this step
  std::uint32_t revision = 0;           ///< counts the writes: of two copies the higher one is the newer
  std::string detail = {};              ///< what failed last, for people; one line of most_detail octets

  static constexpr std::size_t most_detail = 60;
  /// Starts before this one.
  [[nodiscard]] std::uint32_t unhealthy_starts() const { return starts > 0 ? starts - 1 : 0; }
  friend bool operator==(const StepRecord&, const StepRecord&) = default;
};

/// The step that so many starts in a row ask for.
[[nodiscard]] BootStep step_after(std::uint32_t unhealthy_starts, const StepPolicy& policy);

/// One more start is about to be made. @param last  boot record of the boot before; nullopt: none
[[nodiscard]] StepRecord on_start(StepRecord before, const std::optional<wire::BootRecord>& last,
                                  const StepPolicy& policy);
/// The next measures to take before the suite is started; nullopt: none. Measures are taken once in a row of
/// starts, the shallower ones first, and may be taken twice where a power loss falls between an act and its
/// record.
[[nodiscard]] std::optional<BootStep> next_measures(const StepRecord& record, const StepPolicy& policy);
[[nodiscard]] StepRecord on_measures_taken(StepRecord record, BootStep step);
/// The suite is healthy, or was ended in order: the starts begin anew, the step stays, also an ordered
/// rescue.
[[nodiscard]] StepRecord on_healthy(StepRecord record);
/// The suite was healthy for the calm time: the next start is one step up.
[[nodiscard]] StepRecord on_calm(StepRecord record);
/// From now on this step, by command; the starts begin anew. normal, last_good or golden.
[[nodiscard]] StepRecord on_commanded(StepRecord record, BootStep step);
/// The next start, and each after it, is srfs_rescue, until that is told to start the suite. The starts are
/// counted as before.
[[nodiscard]] StepRecord on_order_into_rescue(StepRecord record);
/// The suite gets one more try; if it does not become healthy, the next start is rescue again. A suite that
/// was ordered into rescue runs as it did before.
[[nodiscard]] StepRecord on_no_contact(StepRecord record, const StepPolicy& policy);

/// One line with its CRC-32C.
[[nodiscard]] std::string encode(const StepRecord& record);
/// nullopt: damaged.
[[nodiscard]] std::optional<StepRecord> decode_step_record(std::string_view text);

/// The record on disk. Blocks on it.
class StepStore : public StateFile<StepRecord> {
 public:
  /// @param boot_folder  VAR/state/boot
  explicit StepStore(const std::filesystem::path& boot_folder);
  /// The record as it is; where both copies are damaged a new one that says so.
  [[nodiscard]] StepRecord read();
  /// Where no room is left for a new file, a copy is overwritten in place: a full disk must not keep starts
  /// from being counted. A cut then costs that copy alone.
  [[nodiscard]] Stored store(const StepRecord& record);
  static constexpr milliseconds lock_patience{5000};
  /// Changes it; several processes do, one after the other. Blocks at most lock_patience longer than the
  /// disk: where one of them hangs, a change that may undo its own is better than none.
  /// @return what went wrong; empty: it is on disk, or nothing changes
  template <class Change>
  [[nodiscard]] std::string change(Change modify) {
    const Fd lock = lock_folder();
    const StepRecord before = read();
    StepRecord after = modify(before);
    if (after == before) return "";
    ++after.revision;
    const Stored stored = store(after);
    return stored.durable() ? "" : stored.problem;
  }

 private:
  /// Empty: it could not be had.
  [[nodiscard]] Fd lock_folder() const;

  std::filesystem::path folder_;
};

}  // namespace srfs::suite
