// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/station_status.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "ground/archive/archive_report.hpp"
#include "ground/terminal_text.hpp"

namespace srfs::ground {
namespace {

constexpr std::size_t limits_shown = 8;

/// The text of a field of the newest report of a structure; empty: it has none, or there is no report.
std::string field_text(const StationStatus& status, const char* structure, const std::string& field) {
  const auto* newest = status.latest.structure(structure);
  if (newest == nullptr) return "";
  for (const auto& of : newest->report.fields) {
    if (of.name == field) return for_terminal(of.text);
  }
  return "";
}

std::string beacon_text(const StationStatus& status, const std::string& field) {
  return field_text(status, "beacon", field);
}

/// What the suite was started with; whether srfs_rescue speaks in its place.
std::string step_line(const StationStatus& status, UtcTime now) {
  const auto* newest = status.latest.structure("boot_step");
  if (newest == nullptr) return "";
  const auto text = [&](const char* field) { return field_text(status, "boot_step", field); };
  const bool in_rescue = text("in_rescue") == "true";
  std::string line =
      fmt::format("{:<18} {}{}, cause {}", "start", in_rescue ? "SRFS_RESCUE SPEAKS, step " : "step ",
                  text("step"), text("cause"));
  if (const auto starts = text("unhealthy_starts"); starts != "0")
    line += fmt::format(", {} unhealthy starts", starts);
  if (const auto detail = text("detail"); !detail.empty()) line += fmt::format(": {}", detail);
  if (in_rescue) line += fmt::format("; it tries the suite in {} s", text("suite_in_s"));
  return line + fmt::format(" ({} ago)\n", age_text(now - newest->received));
}

std::string server_lines(const ServerStatus& server) {
  std::string lines = fmt::format("{:<18} {} clients\n", "server", server.clients);
  lines += fmt::format("{:<18} {}, {}; {} frames, {} bad, {} lost\n", "line",
                       server.line_open ? "open" : "closed", server.locked ? "frames in step" : "no frames",
                       server.counters.frames, server.counters.bad_frames, server.counters.lost_frames);
  lines += fmt::format("{:<18} {}\n", "telemetry", authenticity_text(server.counters));
  std::string cop = fmt::format("AD service {}, {} outstanding, {} queued", to_text(server.cop.phase),
                                server.cop.outstanding, server.cop.queued);
  if (server.cop.clcw) {
    cop += fmt::format("; FARM-1 V(R) {}", server.cop.clcw->report_value);
    if (server.cop.clcw->lockout) cop += ", LOCKOUT";
    if (server.cop.clcw->wait) cop += ", wait";
  }
  lines += fmt::format("{:<18} {}\n", "COP-1", cop);
  if (!server.archive_problem.empty())
    lines += fmt::format("{:<18} FAILS, nothing is recorded: {}\n", "archive",
                         for_terminal(server.archive_problem));
  return lines;
}

}  // namespace

Result<StationStatus, std::string> read_status(Archive& archive, const mission::Dictionary& dictionary) {
  StationStatus status;
  for (const auto& structure : dictionary.structures()) {
    if (structure.kind != mission::StructureKind::housekeeping) continue;
    PacketFilter filter;
    filter.service = std::uint8_t{3};
    filter.structure = structure.id;
    filter.latest_live = true;
    filter.most = 1;
    const auto read = archive.packets(filter, [&](const StoredPacket& stored) {
      status.latest.take(decode_telemetry(dictionary, stored.packet), stored.received);
      return true;
    });
    if (!read) return Err(read.error());
  }
  const auto telecommands = archive.telecommands({}, 1);
  if (!telecommands) return Err(telecommands.error());
  if (!telecommands->empty()) status.last_telecommand = telecommands->back();
  const auto passes = archive.passes({});
  if (!passes) return Err(passes.error());
  if (!passes->empty()) status.last_pass = passes->back();
  const auto gaps = archive.gaps({}, true);
  if (!gaps) return Err(gaps.error());
  status.open_gaps = gaps->size();
  return status;
}

std::string to_lines(const StationStatus& status, const mission::Dictionary& dictionary, UtcTime now) {
  std::string lines = status.server ? server_lines(*status.server)
                                    : fmt::format("{:<18} none runs (srfs-ground serve)\n", "server");
  const std::string contact = status.last_pass
                                  ? fmt::format("{} ago, since {}", age_text(now - status.last_pass->ended),
                                                to_iso8601(status.last_pass->began, 0))
                                  : "never";
  lines += fmt::format("{:<18} {}\n", "last contact", contact);
  if (const auto* beacon = status.latest.structure("beacon")) {
    const std::string reason = beacon_text(status, "mode_reason");
    lines += fmt::format("{:<18} {}{} (beacon {} ago)\n", "mode", beacon_text(status, "mode"),
                         reason.empty() ? "" : ", " + reason, age_text(now - beacon->received));
    lines += fmt::format("{:<18} SPI {}, counter {}\n", "keys", beacon_text(status, "sdls_spi.bd"),
                         beacon_text(status, "sdls_counter.bd"));
  } else {
    lines += fmt::format("{:<18} no beacon yet\n", "mode");
  }
  lines += step_line(status, now);
  const auto out = status.latest.rows("", true);
  lines += fmt::format("{:<18} {}\n", "limits out", out.empty() ? "none" : std::to_string(out.size()));
  for (std::size_t i = 0; i < std::min(out.size(), limits_shown); ++i)
    lines += fmt::format("  {:<46} {} {} ({}, {} ago)\n", out[i].parameter, for_terminal(out[i].field.text),
                         out[i].field.unit, to_text(out[i].field.limit), age_text(now - out[i].received));
  if (out.size() > limits_shown) lines += "  ... srfs-ground watch --limits shows all\n";
  if (status.last_telecommand)
    lines += fmt::format("{:<18} {}: {}, {} ago\n", "last telecommand", status.last_telecommand->entry.name,
                         verdict_of(*status.last_telecommand, dictionary, now).text,
                         age_text(now - status.last_telecommand->entry.sent));
  return lines + fmt::format("{:<18} {}\n", "open gaps", status.open_gaps);
}

nlohmann::json to_json(const StationStatus& status, const mission::Dictionary& dictionary, UtcTime now) {
  nlohmann::json json{{"type", "station"},
                      {"server", nullptr},
                      {"beacon", nullptr},
                      {"boot_step", nullptr},
                      {"limits_out", nlohmann::json::array()},
                      {"last_telecommand", nullptr},
                      {"last_contact", nullptr},
                      {"open_gaps", status.open_gaps}};
  if (status.server)
    json["server"] = {{"clients", status.server->clients},  {"line_open", status.server->line_open},
                      {"locked", status.server->locked},    {"stats", to_json(status.server->counters)},
                      {"cop", to_json(status.server->cop)}, {"archive_problem", nullptr}};
  if (status.server && !status.server->archive_problem.empty())
    json["server"]["archive_problem"] = status.server->archive_problem;
  if (const auto* beacon = status.latest.structure("beacon")) {
    json["beacon"] = to_json(beacon->report);
    json["beacon"]["received"] = to_iso8601(beacon->received);
  }
  if (const auto* step = status.latest.structure("boot_step")) {
    json["boot_step"] = to_json(step->report);
    json["boot_step"]["received"] = to_iso8601(step->received);
  }
  for (const auto& row : status.latest.rows("", true))
    json["limits_out"].push_back({{"parameter", row.parameter},
                                  {"value", row.field.text},
                                  {"unit", row.field.unit},
                                  {"limit", to_text(row.field.limit)},
                                  {"received", to_iso8601(row.received)}});
  if (status.last_telecommand) json["last_telecommand"] = to_json(*status.last_telecommand, dictionary, now);
  if (status.last_pass) json["last_contact"] = to_iso8601(status.last_pass->ended);
  return json;
}

}  // namespace srfs::ground
