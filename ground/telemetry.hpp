// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "ground/ad_service.hpp"
#include "ground/commanding.hpp"
#include "ground/downlink.hpp"
#include "ground/schedule.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::ground {

enum class TelemetryKind : std::uint8_t {
  housekeeping,
  beacon,
  event,
  pong,
  verification,
  schedule,     ///< 11,10 11,13 11,27
  time_report,  ///< 9,2
  report,       ///< what another PUS service answers, as the dictionary describes it
  other
};

/// One telemetry packet as people and programs read it.
struct TelemetryReport {
  TelemetryKind kind = TelemetryKind::other;
  std::uint8_t vc = 0;
  std::uint16_t apid = 0;
  std::string source;  ///< name of the application process, or "apid 99"
  std::uint8_t service = 0;
  std::uint8_t subtype = 0;
  std::uint16_t sequence_count = 0;
  TaiTime time;
  std::uint8_t time_reference = 0;  ///< 0: the spacecraft's time is not valid
  std::string name;                 ///< structure or event
  std::string text;                 ///< event: rendered; other: why it could not be decoded
  std::vector<mission::DecodedField> fields;
  std::optional<ScheduleReport> schedule;
  Octets undecoded;             ///< source data that the dictionary does not explain
  std::int64_t archive_id = 0;  ///< as ReceivedPacket
  Authenticity authenticity = Authenticity::not_judged;
};

/// Decodes one packet with the dictionary. Never fails: what is unknown comes as octets.
[[nodiscard]] TelemetryReport decode_telemetry(const mission::Dictionary& dictionary,
                                               const ReceivedPacket& received);

/// {"type": "tm_packet" | "beacon" | "event" | "pong" | "schedule" | "time_report", vc, apid, source,
/// service, subtype, sequence, time, structure | event, fields {name: value}, units {name: unit}, limits
/// {name: yellow | red}}, and verified (bool) on a link with authentication. Unknown values are null, enum
/// values their labels.
[[nodiscard]] nlohmann::json to_json(const TelemetryReport& report);
/// {"type": "tc_stage", id, command, stage, success, elapsed_ms, code, name, text, step}
[[nodiscard]] nlohmann::json to_json(const StageReport& report);
/// {"type": "stats", ...}
[[nodiscard]] nlohmann::json to_json(const DownlinkCounters& counters);

/// {"type": "cop", service, state, vs, nnr, outstanding, queued, repeated, clcw {...} | null, bad_clcws,
/// problem}
[[nodiscard]] nlohmann::json to_json(const CopReport& report);

/// Lines for people. @param colour limit states as terminal colours, else "(yellow)" behind the value
[[nodiscard]] std::string to_lines(const TelemetryReport& report, bool colour);
[[nodiscard]] std::string to_lines(const StageReport& report, bool colour);
[[nodiscard]] std::string to_lines(const DownlinkCounters& counters);
/// What was verified, in a line without newline.
[[nodiscard]] std::string authenticity_text(const DownlinkCounters& counters);
[[nodiscard]] std::string to_lines(const CopReport& report, bool colour);

/// "1811c003": the request id as verification reports carry it.
[[nodiscard]] std::string request_text(const wire::RequestId& request);

}  // namespace srfs::ground
