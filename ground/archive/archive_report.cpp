// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/archive/archive_report.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "base/text.hpp"
#include "ground/telemetry.hpp"
#include "ground/terminal_text.hpp"
#include "ground/time_tag.hpp"

namespace srfs::ground {
namespace {

constexpr seconds report_margin{30};  ///< beyond the telecommand's own timeout

/// By the subtype of PUS 1.
constexpr std::array<std::string_view, 9> stages{
    "?",        "accepted",        "rejected",  "started", "start_failed",
    "progress", "progress_failed", "completed", "failed"};

std::string_view stage_of(std::uint8_t subtype) {
  return subtype < stages.size() ? stages.at(subtype) : stages.front();
}

bool is_failure(std::uint8_t subtype) {
  return subtype != 0 && subtype % 2 == 0;
}

/// The failure code of a report, by its name.
std::string failure_in(const StoredTelecommand::Report& report, const mission::Dictionary& dictionary) {
  OctetReader in(report.source);
  static_cast<void>(in.u32());
  constexpr std::uint8_t progress_failed = 6;
  if (report.subtype == progress_failed) static_cast<void>(in.u8());
  const std::uint16_t code = in.u16();
  if (!in.ok()) return "no code";
  const auto* known = dictionary.failure_code(code);
  return known == nullptr ? fmt::format("code {}", code) : known->name;
}

std::string cell_of(const nlohmann::json& value) {
  if (value.is_null()) return "";
  if (value.is_string()) return value.get<std::string>();
  if (!value.is_array()) return value.dump();
  std::string joined;
  for (const auto& entry : value) joined += (joined.empty() ? "" : " ") + cell_of(entry);
  return joined;
}

}  // namespace

Verdict verdict_of(const StoredTelecommand& telecommand, const mission::Dictionary& dictionary, UtcTime now) {
  constexpr std::uint8_t progress_failed = 6;
  constexpr std::uint8_t completed = 7;
  Verdict verdict;
  std::uint8_t furthest = 0;
  for (const auto& report : telecommand.reports) {
    if (is_failure(report.subtype) && report.subtype != progress_failed)
      return {fmt::format("{}: {}", stage_of(report.subtype), failure_in(report, dictionary)), true, true};
    furthest = std::max(furthest, report.subtype);
  }
  if (furthest == completed) return {"completed", false, true};
  verdict.text = furthest == 0 ? telecommand.entry.scheduled ? "scheduled" : "sent" : stage_of(furthest);
  const auto* command = dictionary.command(telecommand.entry.name);
  const auto patience = (command == nullptr ? milliseconds(0) : command->timeout) + report_margin;
  const bool late = now - telecommand.entry.sent > patience;
  if (late && !telecommand.entry.scheduled) {
    verdict.text = furthest == 0 ? "no report" : verdict.text + ", no final report";
    verdict.failed = true;
  }
  return verdict;
}

nlohmann::json to_json(const StoredTelecommand& telecommand, const mission::Dictionary& dictionary,
                       UtcTime now) {
  const Verdict verdict = verdict_of(telecommand, dictionary, now);
  const TelecommandEntry& entry = telecommand.entry;
  nlohmann::json json{{"type", "command"},
                      {"id", telecommand.id},
                      {"request", request_text(entry.request)},
                      {"sent", to_iso8601(entry.sent)},
                      {"who", entry.who},
                      {"name", entry.name},
                      {"arguments", entry.arguments},
                      {"ad", entry.ad},
                      {"scheduled", entry.scheduled},
                      {"verdict", verdict.text},
                      {"failed", verdict.failed},
                      {"final", verdict.final},
                      {"stages", nlohmann::json::array()}};
  for (const auto& report : telecommand.reports) {
    nlohmann::json stage{{"time", to_iso8601(report.time)}, {"stage", stage_of(report.subtype)}};
    if (is_failure(report.subtype)) stage["name"] = failure_in(report, dictionary);
    json["stages"].push_back(stage);
  }
  return json;
}

std::string to_line(const StoredTelecommand& telecommand, const mission::Dictionary& dictionary,
                    UtcTime now) {
  std::string line = fmt::format("{}  {:<22}  {}", to_iso8601(telecommand.entry.sent),
                                 verdict_of(telecommand, dictionary, now).text, telecommand.entry.name);
  for (const auto& argument : telecommand.entry.arguments) line += " " + for_terminal(argument);
  return line + fmt::format("  ({})\n", for_terminal(telecommand.entry.who));
}

nlohmann::json to_json(const Point& point, const std::string& parameter) {
  return {{"type", "point"},
          {"parameter", parameter},
          {"time", to_iso8601(point.time)},
          {"count", point.values.count},
          {"min", point.values.min},
          {"mean", point.values.mean},
          {"max", point.values.max},
          {"worst", to_text(point.values.worst)}};
}

nlohmann::json to_json(const StoredGap& stored, const mission::Dictionary& dictionary) {
  const auto* process = dictionary.apid(stored.gap.apid);
  nlohmann::json json{
      {"type", "gap"},
      {"apid", stored.gap.apid},
      {"source", process == nullptr ? fmt::format("apid {}", stored.gap.apid) : process->name},
      {"first", stored.gap.first},
      {"count", nullptr},
      {"from", to_iso8601(stored.gap.from)},
      {"to", to_iso8601(stored.gap.to)},
      {"missing", stored.missing},
      {"attempts", stored.attempts},
      {"state", to_text(stored.state)}};
  if (stored.gap.count) json["count"] = *stored.gap.count;
  return json;
}

nlohmann::json to_json(const Pass& pass) {
  return {{"type", "pass"},
          {"began", to_iso8601(pass.began)},
          {"ended", to_iso8601(pass.ended)},
          {"packets", pass.packets}};
}

nlohmann::json to_json(const FileEntry& file) {
  nlohmann::json json{{"type", "transfer"},     {"time", to_iso8601(file.time)},
                      {"id", file.transaction}, {"direction", file.direction},
                      {"name", file.name},      {"event", file.event},
                      {"octets", nullptr}};
  if (file.octets) json["octets"] = *file.octets;
  return json;
}

std::string csv_line(const std::vector<std::string>& cells) {
  std::string line;
  for (const std::string& cell : cells) {
    if (&cell != &cells.front()) line += ',';
    const std::string shown = for_terminal(cell);
    if (shown.find_first_of(",\"") == std::string::npos) {
      line += shown;
      continue;
    }
    line += '"';
    for (const char c : shown) line += c == '"' ? std::string("\"\"") : std::string(1, c);
    line += '"';
  }
  return line + "\r\n";
}

std::string csv_line(const nlohmann::json& object, const std::vector<std::string>& columns) {
  std::vector<std::string> cells;
  for (const std::string& column : columns)
    cells.push_back(object.contains(column) ? cell_of(object.at(column)) : "");
  return csv_line(cells);
}

std::optional<UtcTime> parse_moment(const std::string& text, UtcTime now) {
  if (const auto time = from_iso8601(text)) return time;
  if (text.ends_with('d')) {
    constexpr int hours_a_day = 24;
    const auto days = to_number<std::uint16_t>(std::string_view(text).substr(0, text.size() - 1));
    return days ? std::optional(now - std::chrono::hours(hours_a_day * *days)) : std::nullopt;
  }
  const auto ago = parse_duration(text);
  return ago ? std::optional(now - *ago) : std::nullopt;
}

}  // namespace srfs::ground
