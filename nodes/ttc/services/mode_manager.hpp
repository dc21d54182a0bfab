// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <mission/structures.hpp>

#include "base/time.hpp"

namespace srfs {

using mission::MissionMode;
using mission::ModeCause;

/// What start-up found where the mode is kept.
enum class StoredModeState : std::uint8_t {
  first_start,  ///< this deployment never ran: no mode was ever stored
  missing,      ///< it ran before and the mode is not there
  present,
};

/// Why the satellite is in a mode.
struct ModeWhy {
  ModeCause cause = ModeCause::command;
  std::string source{};  ///< name of the measurement in the deployment; empty: none
  std::string reason{};  ///< for people
};

/// Owns the mode. A change counts when it is on disk: change() gives the text to store, publishing it is the
/// caller's.
class ModeManager {
 public:
  static constexpr seconds publish_period{2};
  /// The beacon's room for it; the event and /mode, which have more, say the same.
  static constexpr std::size_t longest_reason = 54;

  /// Missing or damaged means safe; only a deployment that never ran starts in @p initial.
  /// @param lost_change  number of the change when the stored one is lost: above any that was given out
  ModeManager(StoredModeState state, std::string_view stored, MissionMode initial,
              std::uint32_t lost_change = 0);

  [[nodiscard]] MissionMode mode() const { return mode_; }
  /// Why the mode is what it is, for people, at most longest_reason characters.
  [[nodiscard]] const std::string& reason() const { return why_.reason; }
  [[nodiscard]] const ModeWhy& why() const { return why_; }
  /// Counts the changes; 0: the mode of the first start.
  [[nodiscard]] std::uint32_t change_count() const { return change_; }
  /// nullopt: the time was not valid when it began.
  [[nodiscard]] std::optional<UtcTime> since() const { return since_; }
  /// The mode that was commanded last: what on-board causes go back to.
  [[nodiscard]] MissionMode commanded() const { return commanded_; }

  /// @param utc  nullopt: not valid  @return the file content that makes it last
  [[nodiscard]] std::string change(MissionMode mode, ModeWhy why, std::optional<UtcTime> utc = {});
  /// The measurements that are a cause now, apart from why(): a restart must find them. Without comma.
  [[nodiscard]] const std::vector<std::string>& present() const { return present_; }
  void set_present(std::vector<std::string> names) { present_ = std::move(names); }
  /// The file content of the mode as it is.
  [[nodiscard]] std::string stored_text() const;

 private:
  /// @return false: not what stored_text() gives
  bool read(std::string_view text);

  MissionMode mode_ = MissionMode::safe;
  MissionMode commanded_ = MissionMode::safe;
  ModeWhy why_{.cause = ModeCause::storage};
  std::uint32_t change_ = 0;
  std::optional<UtcTime> since_;
  std::vector<std::string> present_;
};

}  // namespace srfs
