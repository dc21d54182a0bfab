// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "ground/archive/archive.hpp"
#include "ground/latest_values.hpp"
#include "ground/station_link.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::ground {

/// What a server says of itself and its line.
struct ServerStatus {
  std::size_t clients = 0;
  bool line_open = false;
  bool locked = false;
  DownlinkCounters counters;
  CopReport cop;
  std::string archive_problem = {};  ///< why the server records nothing now; empty: it does
};

/// The station at a glance.
struct StationStatus {
  std::optional<ServerStatus> server;  ///< nullopt: none runs
  LatestValues latest;
  std::optional<StoredTelecommand> last_telecommand;
  std::optional<Pass> last_pass;
  std::size_t open_gaps = 0;
};

/// What the archive knows of it. The error is ready to print.
[[nodiscard]] Result<StationStatus, std::string> read_status(Archive& archive,
                                                             const mission::Dictionary& dictionary);

[[nodiscard]] std::string to_lines(const StationStatus& status, const mission::Dictionary& dictionary,
                                   UtcTime now);
/// {"type": "station", server {...} | null, beacon {...} | null, limits_out [{parameter, value, limit}],
/// last_telecommand, last_contact, open_gaps}
[[nodiscard]] nlohmann::json to_json(const StationStatus& status, const mission::Dictionary& dictionary,
                                     UtcTime now);

}  // namespace srfs::ground
