// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::ground {

/// An activity of the schedule on board.
struct ScheduledEntry {
  TaiTime release;
  std::uint8_t group = 0;  ///< 0: none
  std::uint16_t source = 0;
  std::uint16_t apid = 0;
  std::uint16_t sequence = 0;
  std::string command;  ///< of a detail report: "eps.switch_load load=2 state=on"
  Octets packet;        ///< of a detail report
};

/// What the schedule on board holds, as one report says; long lists come in several.
struct ScheduleReport {
  enum class Kind : std::uint8_t { detail, summary, groups };
  Kind kind = Kind::summary;
  std::vector<ScheduledEntry> activities;
  std::vector<std::pair<std::uint8_t, bool>> groups;  ///< whether each is enabled
};

/// Reports 11,10 11,13 and 11,27; nullopt: none of them, or not whole.
[[nodiscard]] std::optional<ScheduleReport> decode_schedule(const mission::Dictionary& dictionary,
                                                            std::uint8_t subtype, OctetView source);
/// {report: detail | summary | groups, activities [{release, group, source, apid, sequence, command, octets}]
/// | groups [{group, enabled}]}
[[nodiscard]] nlohmann::json to_json(const ScheduleReport& report);
/// A line an activity or group.
[[nodiscard]] std::string to_lines(const ScheduleReport& report);

}  // namespace srfs::ground
