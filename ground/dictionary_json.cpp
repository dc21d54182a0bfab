// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/dictionary_json.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/format.h>

namespace srfs::ground {
namespace {

using mission::Field;

constexpr std::array field_types{"u8",   "u16",  "u32",  "u64",    "i8",
                                 "i16",  "i32",  "i64",  "f32",    "f64",
                                 "bool", "text", "time", "packet", "parameter_value"};
constexpr std::array references{"",      "structure",    "event",     "event_or_none",
                                "store", "failure_code", "parameter", "telemetry"};
constexpr std::array severities{"?", "info", "low", "medium", "high"};

std::string_view repeat_text(mission::RepeatClass repeat) {
  switch (repeat) {
    case mission::RepeatClass::idempotent:
      return "idempotent";
    case mission::RepeatClass::by_id:
      return "by_id";
    case mission::RepeatClass::at_most_once:
      return "at_most_once";
  }
  return "?";
}

/// Name, type, unit, description, enumeration and reference of a field.
nlohmann::json common_of(const Field& field) {
  nlohmann::json json{{"name", field.name},
                      {"type", field_types.at(static_cast<std::size_t>(field.type))},
                      {"unit", field.unit},
                      {"description", field.description}};
  if (field.enumeration != nullptr) {
    for (const auto& [value, label] : field.enumeration->labels) json["enum"][label] = value;
  }
  if (field.reference != mission::Reference::none)
    json["reference"] = references.at(static_cast<std::size_t>(field.reference));
  if (field.hex) json["hex"] = true;
  return json;
}

void put_bound(nlohmann::json& json, const char* name, const std::optional<double>& bound) {
  if (!bound) return;
  constexpr double exact = 9.0e15;  // an integer is written as one
  if (std::abs(*bound) < exact && std::trunc(*bound) == *bound)
    json[name] = static_cast<std::int64_t>(*bound);
  else
    json[name] = *bound;
}

nlohmann::json argument_json(const Field& field) {
  nlohmann::json json = common_of(field);
  if (field.count > 1) json["count"] = field.count;
  if (field.max_text > 0) json["length"] = field.max_text;
  if (field.range) {
    put_bound(json, "min", field.range->low);
    put_bound(json, "max", field.range->high);
  }
  if (field.has_default) json["default"] = field.default_text;
  return json;
}

nlohmann::json limits_json(const Field& field) {
  nlohmann::json limits = nlohmann::json::object();
  if (field.soft) {
    put_bound(limits, "yellow_low", field.soft->low);
    put_bound(limits, "yellow_high", field.soft->high);
  }
  if (field.hard) {
    put_bound(limits, "red_low", field.hard->low);
    put_bound(limits, "red_high", field.hard->high);
  }
  return limits;
}

/// Each element of an array under the name that its values have.
void put_parameters(nlohmann::json& list, const std::vector<Field>& fields) {
  for (const Field& field : fields) {
    nlohmann::json json = common_of(field);
    if (field.soft || field.hard) json["limits"] = limits_json(field);
    json["calibrated"] = !field.calibration.empty();
    if (!field.calibration.empty()) json["calibration"] = field.calibration;
    if (field.unknown) json["unknown"] = *field.unknown;
    for (std::size_t i = 0; i < field.count; ++i) {
      if (field.count > 1)
        json["name"] = field.name + (field.labels.empty() ? fmt::format("[{}]", i) : "." + field.labels[i]);
      list.push_back(json);
    }
  }
}

nlohmann::json structure_json(const mission::Structure& structure, const mission::Dictionary& dictionary) {
  const auto* process = dictionary.apid(structure.apid);
  nlohmann::json json{{"name", structure.name},
                      {"id", structure.id},
                      {"kind", structure.kind == mission::StructureKind::report ? "report" : "housekeeping"},
                      {"subsystem", process == nullptr ? structure.node : process->name},
                      {"node", structure.node},
                      {"description", structure.description},
                      {"interval_s", static_cast<double>(structure.interval.count()) / 1000.0},
                      {"parameters", nlohmann::json::array()}};
  if (structure.kind == mission::StructureKind::report)
    json.update({{"service", structure.service}, {"subtype", structure.subtype}});
  put_parameters(json["parameters"], structure.fields);
  return json;
}

nlohmann::json event_json(const mission::Event& event) {
  nlohmann::json json{{"name", event.name},
                      {"id", event.id},
                      {"severity", severities.at(static_cast<std::size_t>(event.severity))},
                      {"text", event.text},
                      {"parameters", nlohmann::json::array()}};
  put_parameters(json["parameters"], event.fields);
  return json;
}

nlohmann::json reports_json(const mission::OrderedReports& reports) {
  nlohmann::json json{{"service", reports.service},
                      {"subtype", reports.subtype},
                      {"several", reports.several},
                      {"may_be_none", reports.may_be_none}};
  if (!reports.structure.empty()) json["structure"] = reports.structure;
  if (!reports.argument.empty()) json["argument"] = reports.argument;
  return json;
}

std::string mode_name(std::uint8_t mode, const mission::Dictionary& dictionary) {
  if (const auto* beacon = dictionary.structure("beacon")) {
    for (const Field& field : beacon->fields) {
      if (field.name != "mode" || field.enumeration == nullptr) continue;
      const auto label = field.enumeration->labels.find(mode);
      if (label != field.enumeration->labels.end()) return label->second;
    }
  }
  return std::to_string(mode);
}

}  // namespace

nlohmann::json to_json(const mission::Command& command, const mission::Dictionary& dictionary) {
  nlohmann::json json{{"type", "command"},
                      {"name", command.name},
                      {"node", command.node},
                      {"apid", command.apid},
                      {"service", command.service},
                      {"subtype", command.subtype},
                      {"function", command.function_id},
                      {"description", command.description},
                      {"timeout_s", static_cast<double>(command.timeout.count()) / 1000.0},
                      {"hazardous", command.hazardous},
                      {"recovery", command.recovery},
                      {"modes", nlohmann::json::array()},
                      {"repeat", repeat_text(command.repeat_class)},
                      {"reports", nullptr},
                      {"groups", nullptr},
                      {"arguments", nlohmann::json::array()}};
  for (const std::uint8_t mode : command.modes) json["modes"].push_back(mode_name(mode, dictionary));
  if (command.reports) json["reports"] = reports_json(*command.reports);
  if (command.repeated)
    json["groups"] = {{"min", command.min_groups}, {"max", command.max_groups}, {"after", command.head}};
  for (const Field& field : command.arguments) json["arguments"].push_back(argument_json(field));
  return json;
}

nlohmann::json to_json(const mission::Dictionary& dictionary) {
  nlohmann::json json{{"mission",
                       {{"spacecraft_id", dictionary.spacecraft_id()},
                        {"payloads", dictionary.payloads()},
                        {"nodes", dictionary.nodes()}}},
                      {"telecommands", nlohmann::json::array()},
                      {"structures", nlohmann::json::array()},
                      {"events", nlohmann::json::array()},
                      {"parameters", nlohmann::json::array()},
                      {"stores", nlohmann::json::array()},
                      {"failure_codes", nlohmann::json::array()}};
  for (const auto& command : dictionary.commands())
    json["telecommands"].push_back(to_json(command, dictionary));
  for (const auto& structure : dictionary.structures()) {
    if (structure.kind == mission::StructureKind::housekeeping ||
        structure.kind == mission::StructureKind::report)
      json["structures"].push_back(structure_json(structure, dictionary));
  }
  for (const auto& event : dictionary.events()) json["events"].push_back(event_json(event));
  for (const auto& parameter : dictionary.parameters()) {
    nlohmann::json each = argument_json(parameter.field);
    each.update({{"name", parameter.name},
                 {"id", parameter.id},
                 {"node", parameter.node},
                 {"list", parameter.list},
                 {"guarded", parameter.guarded}});
    json["parameters"].push_back(each);
  }
  for (const auto& store : dictionary.stores())
    json["stores"].push_back({{"name", store.name},
                              {"id", store.id},
                              {"quota_mib", store.quota_mib},
                              {"services", store.services},
                              {"description", store.description}});
  for (const auto& code : dictionary.failure_codes())
    json["failure_codes"].push_back({{"name", code.name}, {"code", code.code}, {"text", code.text}});
  return json;
}

}  // namespace srfs::ground
