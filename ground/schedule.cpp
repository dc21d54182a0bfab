// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/schedule.hpp"

#include <fmt/format.h>

#include "ground/terminal_text.hpp"
#include "wire/cuc.hpp"
#include "wire/pus.hpp"

namespace srfs::ground {
namespace {

constexpr std::uint8_t detail_report = 10;
constexpr std::uint8_t summary_report = 13;
constexpr std::uint8_t group_status_report = 27;

/// "eps.switch_load load=2 state=on"; without arguments when they come in groups or are not whole.
std::string command_text(const mission::Dictionary& dictionary, const wire::TcPacket& packet) {
  const bool is_function = packet.service == 8 && packet.subtype == 1;
  OctetReader in(packet.application);
  const mission::Command* command = is_function
                                        ? dictionary.function(packet.apid, in.u16())
                                        : dictionary.request(packet.apid, packet.service, packet.subtype);
  if (command == nullptr)
    return fmt::format("apid {} service {},{}", packet.apid, packet.service, packet.subtype);
  std::string text = command->name;
  if (command->repeated) return text;
  for (const auto& field :
       dictionary.decode(command->arguments, in.rest()).value_or(std::vector<mission::DecodedField>{}))
    text += fmt::format(" {}={}{}", field.name, field.text, field.unit);
  return text;
}

bool read_packet(const mission::Dictionary& dictionary, OctetReader& in, ScheduledEntry& entry) {
  OctetReader ahead = in;
  const OctetView header = ahead.bytes(wire::packet_header_octets);
  if (!ahead.ok()) return false;
  const OctetView octets = in.bytes(wire::packet_octets(header));
  const auto packet = wire::parse_tc_packet(octets);
  if (!in.ok() || !packet) return false;
  entry.source = packet->source_id;
  entry.apid = packet->apid;
  entry.sequence = packet->sequence_count;
  entry.packet.assign(octets.begin(), octets.end());
  entry.command = command_text(dictionary, *packet);
  return true;
}

}  // namespace

std::optional<ScheduleReport> decode_schedule(const mission::Dictionary& dictionary, std::uint8_t subtype,
                                              OctetView source) {
  using Kind = ScheduleReport::Kind;
  ScheduleReport report;
  if (subtype != detail_report && subtype != summary_report && subtype != group_status_report)
    return std::nullopt;
  report.kind = subtype == detail_report    ? Kind::detail
                : subtype == summary_report ? Kind::summary
                                            : Kind::groups;
  OctetReader in(source);
  for (std::size_t count = in.u16(); count > 0 && in.ok(); --count) {
    if (report.kind == Kind::groups) {
      const std::uint8_t group = in.u8();
      report.groups.emplace_back(group, in.u8() != 0);
      continue;
    }
    ScheduledEntry entry;
    entry.group = in.u8();
    const auto release = wire::decode_cuc(in.bytes(wire::cuc_octets));
    if (!release) return std::nullopt;
    entry.release = *release;
    if (report.kind == Kind::detail) {
      if (!read_packet(dictionary, in, entry)) return std::nullopt;
    } else {
      entry.source = in.u16();
      entry.apid = in.u16();
      entry.sequence = in.u16();
    }
    report.activities.push_back(std::move(entry));
  }
  if (!in.ok() || in.remaining() != 0) return std::nullopt;
  return report;
}

nlohmann::json to_json(const ScheduleReport& report) {
  if (report.kind == ScheduleReport::Kind::groups) {
    nlohmann::json groups = nlohmann::json::array();
    for (const auto& [group, enabled] : report.groups)
      groups.push_back({{"group", group}, {"enabled", enabled}});
    return {{"report", "groups"}, {"groups", std::move(groups)}};
  }
  const bool detail = report.kind == ScheduleReport::Kind::detail;
  nlohmann::json activities = nlohmann::json::array();
  for (const ScheduledEntry& entry : report.activities) {
    nlohmann::json json{{"release", to_iso8601(to_utc(entry.release))},
                        {"group", entry.group},
                        {"source", entry.source},
                        {"apid", entry.apid},
                        {"sequence", entry.sequence}};
    if (detail) {
      json["command"] = entry.command;
      json["octets"] = to_hex(entry.packet);
    }
    activities.push_back(std::move(json));
  }
  return {{"report", detail ? "detail" : "summary"}, {"activities", std::move(activities)}};
}

std::string to_lines(const ScheduleReport& report) {
  std::string lines;
  for (const auto& [group, enabled] : report.groups)
    lines += fmt::format("    group {:<3} {}\n", group, enabled ? "enabled" : "disabled");
  for (const ScheduledEntry& entry : report.activities) {
    lines += fmt::format("    {}  {:<10} apid {:<4} count {:<5}{}{}\n", to_iso8601(to_utc(entry.release)),
                         entry.group == 0 ? "" : fmt::format("group {}", entry.group), entry.apid,
                         entry.sequence, entry.source == 0 ? "" : fmt::format(" source {}", entry.source),
                         entry.command.empty() ? "" : "  " + for_terminal(entry.command));
  }
  return lines;
}

}  // namespace srfs::ground
