// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include <mission/structures.hpp>

#include "base/time.hpp"

namespace srfs {

using mission::MissionMode;

/// What start-up found where the mode is kept.
enum class StoredModeState : std::uint8_t {
  first_start,  ///< this deployment never ran: no mode was ever stored
  missing,      ///< it ran before and the mode is not there
  present,
};

/// Owns the mode. A change counts when it is on disk: change() gives the text to store, publishing it is the
/// caller's.
class ModeManager {
 public:
  static constexpr seconds publish_period{10};
  /// The beacon's room for it; the event and /mode, which have more, say the same.
  static constexpr std::size_t longest_reason = 60;

  /// Missing or damaged means safe; only a deployment that never ran starts in @p initial.
  ModeManager(StoredModeState state, std::string_view stored, MissionMode initial);

  [[nodiscard]] MissionMode mode() const { return mode_; }
  /// Why the mode is what it is, for people, at most longest_reason characters.
  [[nodiscard]] const std::string& reason() const { return reason_; }
  /// @return the file content that makes it last
  [[nodiscard]] std::string change(MissionMode mode, std::string reason);
  /// The file content of the mode as it is.
  [[nodiscard]] std::string stored_text() const;

 private:
  MissionMode mode_ = MissionMode::safe;
  std::string reason_;
};

}  // namespace srfs
