// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <mission/structures.hpp>

#include "msgs/mission/encoded_event.hpp"
#include "update/update_journal.hpp"

namespace srfs {

/// Where an update stands, as the ground gets it; what the structure has no room for is cut. Pure.
[[nodiscard]] mission::UpdateStatusHousekeeping to_mission(const update::Update& update);

/// Longest text of an event `update.*`, octets.
inline constexpr std::size_t longest_update_text = 120;

/// That an update reached its present step.
struct UpdateNews {
  bool is_bad = false;  ///< it failed, or was cancelled
  std::string line;     ///< for the log
  EncodedEvent event;
};
/// Pure.
[[nodiscard]] UpdateNews news_of(const update::Update& update);

}  // namespace srfs
