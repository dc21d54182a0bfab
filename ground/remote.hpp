// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "base/time.hpp"
#include "ground/commanding.hpp"
#include "ground/telemetry.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::ground {

/// What `srfs-ground remote ACTION WORD...` asks of the folder of files on board (PUS 23).
struct RemoteRequest {
  std::vector<TelecommandText> telecommands;  ///< one after another
  std::string awaited_file;                   ///< is to arrive here; empty: none
  bool lists = false;                         ///< go on behind the last name while some are left
};

/// @param utc  makes the id of a copy. The error is ready to print.
[[nodiscard]] Result<RemoteRequest, std::string> remote_request(const std::string& action,
                                                                const std::vector<std::string>& words,
                                                                UtcTime utc);
/// The actions, for the help text.
[[nodiscard]] std::string remote_actions();

/// The text of a field; empty: the report has none.
[[nodiscard]] std::string field_text(const TelemetryReport& report, std::string_view field);
/// The SHA-256 in a report of a file's attributes, 64 digits.
[[nodiscard]] std::string reported_sha256(const TelemetryReport& report);

/// The page behind the last entry of @p answers; nullopt: that was all.
[[nodiscard]] std::optional<TelecommandText> next_page(const TelecommandText& page,
                                                       const std::vector<TelemetryReport>& answers);

/// All answers to @p telecommand have come; what was lost on the way is seen by their numbers. A completed
/// one whose answers are not whole is asked again.
/// @param left_before  what was left according to the page before; nullopt: there was none
[[nodiscard]] bool is_whole(const TelecommandText& telecommand, const std::vector<TelemetryReport>& answers,
                            std::optional<std::uint64_t> left_before);
/// The "left" of the last answer.
[[nodiscard]] std::optional<std::uint64_t> left_behind(const std::vector<TelemetryReport>& answers);

/// Node parameters that @p words name: "NODE.PARAMETER", or "NODE" for all of it; none: all. The error is
/// ready to print.
[[nodiscard]] Result<std::vector<const mission::Parameter*>, std::string> parameters_named(
    const mission::Dictionary& dictionary, const std::vector<std::string>& words);
/// What `srfs-ground param ACTION WORD...` sends for keep, confirm, history, restore and reset. The error is
/// ready to print.
[[nodiscard]] Result<TelecommandText, std::string> keeping_command(const std::string& action,
                                                                   const std::vector<std::string>& words);
/// What `srfs-ground param set NODE.PARAMETER=VALUE` sends. The error is ready to print.
[[nodiscard]] Result<TelecommandText, std::string> setting_command(const std::string& change);
/// "NODE.PARAMETER=VALUE" again.
[[nodiscard]] std::string to_line(const TelecommandText& setting);
/// "timing.late_tick_ms   10 to 60000 ms, guarded   what it is"
[[nodiscard]] std::string to_line(const mission::Parameter& parameter);

/// A report of the services 20 and 23, or a set of kept values, as one or more lines.
[[nodiscard]] std::string answer_lines(const TelemetryReport& report);

}  // namespace srfs::ground
