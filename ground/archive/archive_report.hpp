// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "ground/archive/archive.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::ground {

/// What became of a telecommand, by the reports that name it.
struct Verdict {
  std::string text;  ///< "completed", "rejected: not_armed", "no report", ...
  bool failed = false;
  bool final = false;
};
/// @param now  a telecommand without a final report long after its timeout has "no final report"
[[nodiscard]] Verdict verdict_of(const StoredTelecommand& telecommand, const mission::Dictionary& dictionary,
                                 UtcTime now);

/// {"type": "command", id, request, sent, who, name, arguments, ad, scheduled, verdict, failed, final, stages
/// [{time, stage, code, name}]}
[[nodiscard]] nlohmann::json to_json(const StoredTelecommand& telecommand,
                                     const mission::Dictionary& dictionary, UtcTime now);
[[nodiscard]] std::string to_line(const StoredTelecommand& telecommand, const mission::Dictionary& dictionary,
                                  UtcTime now);
/// {"type": "point", parameter, time, count, min, mean, max, worst}
[[nodiscard]] nlohmann::json to_json(const Point& point, const std::string& parameter);
/// {"type": "gap", apid, source, first, count, from, to, missing, attempts, state}
[[nodiscard]] nlohmann::json to_json(const StoredGap& gap, const mission::Dictionary& dictionary);
/// {"type": "pass", began, ended, packets}
[[nodiscard]] nlohmann::json to_json(const Pass& pass);
/// {"type": "transfer", time, id, direction, name, event, octets}
[[nodiscard]] nlohmann::json to_json(const FileEntry& file);

/// One line of comma-separated values (RFC 4180); members of an object in this order, arrays joined by
/// spaces; as for_terminal() writes them.
[[nodiscard]] std::string csv_line(const nlohmann::json& object, const std::vector<std::string>& columns);
[[nodiscard]] std::string csv_line(const std::vector<std::string>& cells);

/// "2026-11-21T08:00:00Z", or how long ago: "90s", "10m", "2h", "3d". nullopt: neither.
[[nodiscard]] std::optional<UtcTime> parse_moment(const std::string& text, UtcTime now);

}  // namespace srfs::ground
