// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/telemetry.hpp"

#include <cmath>

#include <fmt/format.h>
#include <mission/structures.hpp>

#include "ground/terminal_text.hpp"

namespace srfs::ground {
namespace {

constexpr std::string_view red = "\033[31;1m";
constexpr std::string_view yellow = "\033[33;1m";
constexpr std::string_view green = "\033[32m";
constexpr std::string_view faint = "\033[2m";
constexpr std::string_view plain = "\033[0m";

std::string coloured(std::string_view colour_code, std::string_view text, bool colour) {
  return colour ? fmt::format("{}{}{}", colour_code, text, plain) : std::string(text);
}

void decode_housekeeping(const mission::Dictionary& dictionary, OctetReader in, TelemetryReport& report) {
  const auto* structure = dictionary.structure(in.u16());
  if (structure == nullptr) {
    report.text = "structure unknown to the dictionary";
    return;
  }
  report.name = structure->name;
  auto fields = dictionary.decode(*structure, in.rest());
  if (!fields) {
    report.text = "octets do not match the structure";
    return;
  }
  report.fields = std::move(*fields);
  report.undecoded.clear();
  report.kind =
      structure->id == mission::structure::beacon ? TelemetryKind::beacon : TelemetryKind::housekeeping;
}

void decode_event(const mission::Dictionary& dictionary, OctetReader in, TelemetryReport& report) {
  const std::uint16_t id = in.u16();
  const auto* event = dictionary.event(id);
  report.kind = TelemetryKind::event;
  if (event == nullptr) {
    report.text = fmt::format("event {} unknown to the dictionary", id);
    return;
  }
  const OctetView data = in.rest();
  report.name = event->name;
  report.text = dictionary.render(*event, data);
  if (auto fields = dictionary.decode(event->fields, data)) {
    report.fields = std::move(*fields);
    report.undecoded.clear();
  }
}

void decode_report(const mission::Dictionary& dictionary, const mission::Structure& structure, OctetView data,
                   TelemetryReport& report) {
  report.name = structure.name;
  auto fields = dictionary.decode(structure, data);
  if (!fields) {
    report.text = "octets do not match the report";
    return;
  }
  report.fields = std::move(*fields);
  report.undecoded.clear();
  report.kind = TelemetryKind::report;
}

/// TM 20,2: a count, always 1, the number of the parameter, its value.
void decode_parameter(const mission::Dictionary& dictionary, OctetReader in, TelemetryReport& report) {
  const std::uint16_t count = in.u16();
  const auto* parameter = dictionary.parameter(in.u16());
  if (count != 1 || parameter == nullptr) {
    report.text = "parameter unknown to the dictionary";
    return;
  }
  mission::Field field = parameter->field;
  field.name = parameter->name;
  auto fields = dictionary.decode(std::vector<mission::Field>{field}, in.rest());
  if (!fields) {
    report.text = "octets do not match the parameter";
    return;
  }
  report.name = "parameter_value";
  report.fields = std::move(*fields);
  report.undecoded.clear();
  report.kind = TelemetryKind::report;
}

nlohmann::json json_of(const mission::DecodedField& field) {
  if (!field.known) return nullptr;
  // A label or name says more than its number.
  const bool number =
      field.text.empty() || field.text.find_first_not_of("0123456789+-.e") == std::string::npos;
  if (const auto* u = std::get_if<std::uint64_t>(&field.value))
    return number ? nlohmann::json(*u) : nlohmann::json(field.text);
  if (const auto* i = std::get_if<std::int64_t>(&field.value))
    return number ? nlohmann::json(*i) : nlohmann::json(field.text);
  if (const auto* b = std::get_if<bool>(&field.value)) return *b;
  if (const auto* d = std::get_if<double>(&field.value); d != nullptr && std::isfinite(*d)) return *d;
  return field.text;
}

std::string_view type_text(TelemetryKind kind) {
  switch (kind) {
    case TelemetryKind::beacon:
      return "beacon";
    case TelemetryKind::event:
      return "event";
    case TelemetryKind::pong:
      return "pong";
    case TelemetryKind::schedule:
      return "schedule";
    case TelemetryKind::time_report:
      return "time_report";
    default:
      return "tm_packet";
  }
}

std::string_view severity_text(std::uint8_t subtype) {
  switch (subtype) {
    case 1:
      return "info";
    case 2:
      return "low";
    case 3:
      return "medium";
    case 4:
      return "high";
    default:
      return "?";
  }
}

std::string field_line(const mission::DecodedField& field, bool colour) {
  std::string value = for_terminal(field.text) + (field.unit.empty() || !field.known ? "" : " " + field.unit);
  switch (field.limit) {
    case mission::LimitState::red:
      value = colour ? coloured(red, value, true) : value + " (red)";
      break;
    case mission::LimitState::yellow:
      value = colour ? coloured(yellow, value, true) : value + " (yellow)";
      break;
    case mission::LimitState::green:
      value = coloured(green, value, colour);
      break;
    case mission::LimitState::none:
      break;
  }
  return fmt::format("    {:<32} {}\n", field.name, value);
}

/// JSON has no octets but UTF-8: anything else a text field carries is replaced.
nlohmann::json clean(const nlohmann::json& json) {
  return nlohmann::json::parse(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
}

}  // namespace

TelemetryReport decode_telemetry(const mission::Dictionary& dictionary, const ReceivedPacket& received) {
  const auto& packet = received.packet;
  TelemetryReport report;
  report.vc = received.vc;
  report.apid = packet.apid;
  report.service = packet.service;
  report.subtype = packet.subtype;
  report.sequence_count = packet.sequence_count;
  report.time = packet.time;
  report.time_reference = packet.time_reference;
  report.undecoded = packet.source;
  report.archive_id = received.archive_id;
  report.authenticity = received.authenticity;
  const auto* process = dictionary.apid(packet.apid);
  report.source = process == nullptr ? fmt::format("apid {}", packet.apid) : process->name;
  const OctetReader in(packet.source);
  if (packet.service == 3 && packet.subtype == 25) decode_housekeeping(dictionary, in, report);
  if (packet.service == 5 && packet.subtype >= 1 && packet.subtype <= 4) decode_event(dictionary, in, report);
  if (packet.service == 17 && packet.subtype == 2) report.kind = TelemetryKind::pong;
  if (packet.service == 1) report.kind = TelemetryKind::verification;
  if (packet.service == 9 && packet.subtype == 2) {
    report.kind = TelemetryKind::time_report;
    report.source = "time";
  }
  if (packet.service == 11) {
    report.schedule = decode_schedule(dictionary, packet.subtype, packet.source);
    if (report.schedule) {
      report.kind = TelemetryKind::schedule;
      report.undecoded.clear();
    }
  }
  if (packet.service == 20 && packet.subtype == 2) decode_parameter(dictionary, in, report);
  if (const auto* structure = dictionary.report(packet.service, packet.subtype))
    decode_report(dictionary, *structure, packet.source, report);
  return report;
}

nlohmann::json to_json(const TelemetryReport& report) {
  nlohmann::json json{{"type", type_text(report.kind)},
                      {"vc", report.vc},
                      {"apid", report.apid},
                      {"source", report.source},
                      {"service", report.service},
                      {"subtype", report.subtype},
                      {"sequence", report.sequence_count},
                      {"time", to_iso8601(to_utc(report.time))},
                      {"time_reference", report.time_reference}};
  if (report.authenticity != Authenticity::not_judged)
    json["verified"] = report.authenticity == Authenticity::verified;
  if (report.kind == TelemetryKind::event) {
    json["event"] = report.name;
    json["severity"] = severity_text(report.subtype);
  } else if (!report.name.empty()) {
    json["structure"] = report.name;
  }
  if (!report.text.empty()) json["text"] = report.text;
  if (report.schedule) json.update(to_json(*report.schedule));
  if (!report.undecoded.empty()) json["octets"] = to_hex(report.undecoded);
  if (report.fields.empty()) return clean(json);
  json["units"] = nlohmann::json::object();
  json["limits"] = nlohmann::json::object();
  for (const auto& field : report.fields) {
    json["fields"][field.name] = json_of(field);
    if (!field.unit.empty()) json["units"][field.name] = field.unit;
    if (field.limit == mission::LimitState::yellow || field.limit == mission::LimitState::red) {
      json["limits"][field.name] = to_text(field.limit);
    }
  }
  return clean(json);
}

nlohmann::json to_json(const StageReport& report) {
  nlohmann::json json{{"type", "tc_stage"},
                      {"id", request_text(report.request)},
                      {"command", report.command->name},
                      {"line", report.tag},
                      {"stage", to_text(report)},
                      {"success", !report.is_failure()},
                      {"final", report.is_final()},
                      {"elapsed_ms", static_cast<double>(report.elapsed / microseconds(1)) / 1000.0}};
  if (report.insertion) json["insertion"] = true;
  if (report.late) json["late"] = true;
  if (report.stage == Stage::progress) json["step"] = report.step;
  if (report.is_failure()) {
    json["code"] = report.failure_code;
    json["name"] = report.failure_name;
    json["text"] = report.failure_text;
  }
  return json;
}

nlohmann::json to_json(const DownlinkCounters& c) {
  return {{"type", "stats"},
          {"octets", c.octets},
          {"frames", c.frames},
          {"idle_frames", c.idle_frames},
          {"bad_frames", c.bad_frames},
          {"lost_frames", c.lost_frames},
          {"corrected_octets", c.corrected_octets},
          {"noise_octets", c.noise_octets},
          {"packets", c.packets},
          {"packet_octets", c.packet_octets},
          {"bad_packets", c.bad_packets},
          {"authenticated", c.authenticated},
          {"forged_frames", c.forged_frames},
          {"replayed_frames", c.replayed_frames},
          {"old_frames", c.old_frames}};
}

std::string authenticity_text(const DownlinkCounters& c) {
  if (!c.authenticated) return "not authenticated (link.tm.sdls of the deployment)";
  return fmt::format("authentic: {} verified; refused {} forged, {} replayed, {} too old", c.frames,
                     c.forged_frames, c.replayed_frames, c.old_frames);
}

std::string to_lines(const TelemetryReport& report, bool colour) {
  const std::string_view invalid = report.time_reference == 0 ? "?" : "";
  std::string head = fmt::format("{}{} {}", to_iso8601(to_utc(report.time)), invalid, report.source);
  if (report.vc == tm_channel::playback) head += " (stored)";
  if (report.authenticity == Authenticity::unverified) head += coloured(red, " UNVERIFIED", colour);
  switch (report.kind) {
    case TelemetryKind::event: {
      const std::string line = fmt::format("{}  event {} [{}] {}", head, report.name,
                                           severity_text(report.subtype), for_terminal(report.text));
      const std::string_view code = report.subtype >= 4 ? red : report.subtype >= 3 ? yellow : plain;
      return coloured(code, line, colour && report.subtype >= 3) + "\n";
    }
    case TelemetryKind::pong:
      return head + "  are-you-alive report (17,2)\n";
    case TelemetryKind::schedule: {
      const bool groups = report.schedule->kind == ScheduleReport::Kind::groups;
      return fmt::format("{}  schedule: {} {}\n{}", head,
                         groups ? report.schedule->groups.size() : report.schedule->activities.size(),
                         groups ? "groups" : "activities", to_lines(*report.schedule));
    }
    case TelemetryKind::time_report:
      return head + "  time report (9,2)\n";
    case TelemetryKind::housekeeping:
    case TelemetryKind::beacon:
    case TelemetryKind::report:
      break;
    case TelemetryKind::verification:
    case TelemetryKind::other:
      return fmt::format("{}  {},{} {} {}\n", head, report.service, report.subtype, report.text,
                         coloured(faint, to_hex(report.undecoded), colour));
  }
  std::string lines = fmt::format("{}  {} (count {})\n", head, report.name, report.sequence_count);
  for (const auto& field : report.fields) lines += field_line(field, colour);
  return lines;
}

std::string to_lines(const StageReport& report, bool colour) {
  std::string line = fmt::format("{:>9.3f} s  {} {} {}", static_cast<double>(report.elapsed.count()) * 1e-9,
                                 request_text(report.request), report.command->name, to_text(report));
  if (report.stage == Stage::progress) line += fmt::format(" step {}", report.step);
  if (report.late) line += " (late)";
  if (report.is_failure()) {
    if (report.outcome == Outcome::failed)
      line += fmt::format(": code {} {}", report.failure_code, report.failure_name);
    line = coloured(red, line + ": " + report.failure_text, colour);
  } else if (report.is_completed()) {
    line = coloured(green, line, colour);
  }
  return line + "\n";
}

std::string to_lines(const DownlinkCounters& c) {
  std::string line = fmt::format(
      "{} octets, {} frames ({} idle, {} bad, {} lost, {} octets corrected), {} packets ({} bad)\n", c.octets,
      c.frames, c.idle_frames, c.bad_frames, c.lost_frames, c.corrected_octets, c.packets, c.bad_packets);
  if (c.authenticated) line += "frames " + authenticity_text(c) + "\n";
  return line;
}

nlohmann::json to_json(const CopReport& report) {
  nlohmann::json json{{"type", "cop"},
                      {"service", to_text(report.phase)},
                      {"state", wire::to_string(report.state)},
                      {"vs", report.vs},
                      {"nnr", report.nnr},
                      {"outstanding", report.outstanding},
                      {"queued", report.queued},
                      {"repeated", report.repeated},
                      {"clcw", nullptr},
                      {"bad_clcws", report.bad_clcws},
                      {"problem", report.problem}};
  if (report.clcw) {
    json["clcw"] = {{"vc", report.clcw->vc},
                    {"vr", report.clcw->report_value},
                    {"lockout", report.clcw->lockout},
                    {"wait", report.clcw->wait},
                    {"retransmit", report.clcw->retransmit},
                    {"farm_b", report.clcw->farm_b_counter},
                    {"no_rf_available", report.clcw->no_rf_available},
                    {"no_bit_lock", report.clcw->no_bit_lock}};
  }
  return json;
}

std::string to_lines(const CopReport& report, bool colour) {
  std::string line =
      fmt::format("AD service {}: FOP-1 {} V(S) {} NN(R) {}, {} outstanding, {} queued, {} repeated",
                  to_text(report.phase), wire::to_string(report.state), report.vs, report.nnr,
                  report.outstanding, report.queued, report.repeated);
  if (!report.clcw) {
    line += "; no CLCW yet";
  } else {
    line += fmt::format("; CLCW VC {} V(R) {} FARM-B {}", report.clcw->vc, report.clcw->report_value,
                        report.clcw->farm_b_counter);
    if (report.clcw->retransmit) line += " retransmit";
    if (report.clcw->wait) line += " wait";
    if (report.clcw->lockout) line = line + " " + coloured(red, "LOCKOUT", colour);
  }
  if (!report.problem.empty()) line = line + "; " + coloured(red, report.problem, colour);
  return line + "\n";
}

std::string request_text(const wire::RequestId& request) {
  return fmt::format("{:04x}{:04x}", request.packet_identification, request.packet_sequence_control);
}

}  // namespace srfs::ground
