// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <set>
#include <system_error>
#include <tuple>
#include <utility>

#include <dlfcn.h>
#include <fmt/format.h>
#include <unistd.h>

#include "base/config.hpp"
#include "msgs/mission/dictionary.hpp"
#include "msgs/mission/dictionary_parts.hpp"

namespace srfs::mission {
namespace {

constexpr int most_groups = 16;  // of one request with a repeated group
// Values of the beacon that come from a mission's payloads (nodes/ttc/report/beacon_builder.cpp).
constexpr std::array<std::string_view, 5> beacon_values{
    "battery_voltage_v", "battery_charge", "battery_temperature_k", "temperature_min_k", "temperature_max_k"};
// Of what a fragment brings; the mission's own files are held to them when the structs are generated.
constexpr std::uint16_t highest_apid = 2039;      // CCSDS keeps those above
constexpr std::size_t event_octets_max = 200;     // srfs_msgs/Event.data
constexpr std::size_t argument_octets_max = 512;  // srfs_msgs/Telecommand.arguments

constexpr std::array<std::pair<std::string_view, FieldType>, 15> type_names{
    {{"u8", FieldType::u8},
     {"u16", FieldType::u16},
     {"u32", FieldType::u32},
     {"u64", FieldType::u64},
     {"i8", FieldType::i8},
     {"i16", FieldType::i16},
     {"i32", FieldType::i32},
     {"i64", FieldType::i64},
     {"f32", FieldType::f32},
     {"f64", FieldType::f64},
     {"bool", FieldType::boolean},
     {"text", FieldType::text},
     {"time", FieldType::time},
     {"packet", FieldType::packet},
     {"parameter_value", FieldType::parameter_value}}};

FieldType parse_type(const ConfigSection& section) {
  const std::string name = section.text("type");
  for (const auto& [text, type] : type_names) {
    if (text == name) return type;
  }
  throw section.bad("type",
                    "one of u8 u16 u32 u64 i8 i16 i32 i64 f32 f64 bool text time packet parameter_value");
}

/// [low, high], either may be null.
std::optional<Bounds> parse_bounds(const ConfigSection& section, std::string_view key) {
  const YAML::Node node = section.raw(key);
  if (!node.IsDefined()) return std::nullopt;
  static constexpr std::string_view expected = "a list [low, high] of two numbers, either may be ~";
  if (!node.IsSequence() || node.size() != 2) throw section.bad(key, expected);
  Bounds bounds;
  for (const auto& [index, bound] :
       {std::pair<std::size_t, std::optional<double>*>{0, &bounds.low}, {1, &bounds.high}}) {
    if (node[index].IsNull()) continue;
    double value = 0;
    if (!YAML::convert<double>::decode(node[index], value)) throw section.bad(key, expected);
    *bound = value;
  }
  if (bounds.low && bounds.high && *bounds.low > *bounds.high) throw section.bad(key, "low not above high");
  return bounds;
}

std::vector<double> parse_calibration(const ConfigSection& field) {
  if (!field.has("calibration")) return {};
  const ConfigSection section = field.section("calibration");
  const std::string_view key = section.has("linear") ? "linear" : "polynomial";
  const YAML::Node node = section.raw(key);
  std::vector<double> coefficients;
  if (node.IsDefined() && node.IsSequence()) {
    for (const auto& item : node) {
      double value = 0;
      if (!YAML::convert<double>::decode(item, value))
        throw section.bad(key, "a list of numbers, constant first");
      coefficients.push_back(value);
    }
  }
  if (coefficients.size() < 2 || (key == "linear" && coefficients.size() != 2)) {
    throw field.bad("calibration", "{ linear: [offset, scale] } or { polynomial: [c0, c1, ...] }");
  }
  section.finish();
  return coefficients;
}

/// Only integers and times have a raw value to spare; a float says it with not-a-number, an enum with a
/// label.
std::optional<std::int64_t> parse_unknown(const ConfigSection& section, const Field& field) {
  if (!section.has("unknown")) return std::nullopt;
  switch (field.enumeration != nullptr ? FieldType::text : field.type) {
    case FieldType::u8:
      return section.integer("unknown", 0, UINT8_MAX);
    case FieldType::u16:
      return section.integer("unknown", 0, UINT16_MAX);
    case FieldType::u32:
      return section.integer("unknown", 0, UINT32_MAX);
    case FieldType::u64: {
      std::uint64_t value = 0;
      if (!YAML::convert<std::uint64_t>::decode(section.raw("unknown"), value))
        throw section.bad("unknown", "an integer of 64 bits, not negative");
      return static_cast<std::int64_t>(value);
    }
    case FieldType::i8:
      return section.integer("unknown", INT8_MIN, INT8_MAX);
    case FieldType::i16:
      return section.integer("unknown", INT16_MIN, INT16_MAX);
    case FieldType::i32:
      return section.integer("unknown", INT32_MIN, INT32_MAX);
    case FieldType::i64:
      return section.integer("unknown", INT64_MIN, INT64_MAX);
    case FieldType::time:  // all octets behind the P-field are zero
      return section.integer("unknown", 0, 0);
    default:
      throw section.bad("unknown", "nothing: only integers that are no enum, and times, have it");
  }
}

Reference parse_reference(const ConfigSection& section) {
  const std::string name = section.choice(
      "reference",
      {"none", "structure", "event", "event_or_none", "store", "failure_code", "parameter", "telemetry"},
      "none");
  if (name == "structure") return Reference::structure;
  if (name == "event") return Reference::event;
  if (name == "event_or_none") return Reference::event_or_none;
  if (name == "telemetry") return Reference::telemetry;
  if (name == "store") return Reference::store;
  if (name == "failure_code") return Reference::failure_code;
  if (name == "parameter") return Reference::parameter;
  return Reference::none;
}

EventSeverity parse_severity(const ConfigSection& section) {
  const std::string name = section.text("severity");
  if (name == "info") return EventSeverity::info;
  if (name == "low") return EventSeverity::low;
  if (name == "medium") return EventSeverity::medium;
  if (name == "high") return EventSeverity::high;
  throw section.bad("severity", "one of info, low, medium, high");
}

RepeatClass parse_repeat(const ConfigSection& section) {
  const std::string name = section.text("repeat");
  if (name == "idempotent") return RepeatClass::idempotent;
  if (name == "by_id") return RepeatClass::by_id;
  if (name == "at_most_once") return RepeatClass::at_most_once;
  throw section.bad("repeat", "one of idempotent, by_id, at_most_once");
}

}  // namespace

/// Reads all files first, so that entries may name what stands in a later file.
class DictionaryLoader {
 public:
  Dictionary load(const std::filesystem::path& folder, const std::vector<Fragment>& fragments) {
    for (const auto& file : Dictionary::files(folder)) files_.push_back(ConfigSection::load(file));
    const std::size_t own = files_.size();
    for (const Fragment& fragment : fragments) {
      if (fragment.text.size() > Fragment::octets_max)
        throw ConfigError(fmt::format("{}: more than {} octets", fragment.name, Fragment::octets_max));
      files_.push_back(ConfigSection::parse(fragment.text, fragment.name));
    }
    for (std::size_t i = 0; i < files_.size(); ++i) {
      if (i >= own) check_keys(files_[i]);
      read_shared(files_[i]);
      if (i >= own) d_.apids_.back().added = true;
    }
    for (std::size_t i = 0; i < own; ++i) read_mission(files_[i]);
    for (const auto& file : files_) index_structures(file);
    for (std::size_t i = 0; i < files_.size(); ++i) {
      if (i < own) {
        read_entries(files_[i]);
      } else {
        read_fragment(files_[i]);
        files_[i].finish();
      }
    }
    for (std::size_t i = 0; i < own; ++i) read_sources(files_[i]);
    for (std::size_t i = 0; i < own; ++i) {
      read_telecommands(files_[i], "monitors", "monitor.add", d_.monitors_);
      read_telecommands(files_[i], "event_actions", "event_action.add", d_.event_actions_);
    }
    for (std::size_t i = 0; i < own; ++i) files_[i].finish();
    check_unique();
    return std::move(d_);
  }

  static DictionaryParts parts_of(Dictionary& d) {
    return {d.enums_,          d.spacecraft_id_, d.apids_,         d.structures_, d.commands_,
            d.events_,         d.stores_,        d.failure_codes_, d.parameters_, d.payloads_,
            d.beacon_sources_, d.monitors_,      d.event_actions_, d.attitude_};
  }
  static Dictionary empty() { return {}; }

 private:
  void read_shared(const ConfigSection& file) {
    static_cast<void>(file.text("subsystem", ""));
    if (file.has("spacecraft")) {
      const ConfigSection craft = file.section("spacecraft");
      static_cast<void>(craft.text("name"));
      d_.spacecraft_id_ = static_cast<std::uint16_t>(craft.integer("id", 0, 1023));
      craft.finish();
    }
    for (const auto& section : file.sections("apids")) {
      d_.apids_.push_back({section.text("name"), static_cast<std::uint16_t>(section.integer("apid", 1, 2046)),
                           section.text("node"), section.text("description", "")});
      section.finish();
    }
    for (const auto& section : file.sections("services")) {
      static_cast<void>(section.integer("service", 1, 255));
      static_cast<void>(section.text("name"));
      static_cast<void>(section.text("description", ""));
      section.finish();
    }
    for (const auto& section : file.sections("stores")) read_store(section);
    for (const auto& section : file.sections("failure_codes")) {
      d_.failure_codes_.push_back({static_cast<std::uint16_t>(section.integer("code", 1, 65535)),
                                   section.text("name"), section.text("text"),
                                   section.text("parameter", "")});
      section.finish();
    }
    const ConfigSection enums = file.section("enums");
    for (const auto& name : enums.keys()) read_enum(enums, name);
  }

  /// What the mission's own file says beside entries.
  void read_mission(const ConfigSection& file) {
    (void)file.texts("include");  // files() has read it
    for (const std::string& payload : file.texts("payloads")) {
      if (d_.apid_of_node(payload) == nullptr) throw file.bad("payloads", "nodes of the list apids");
      d_.payloads_.push_back(payload);
    }
    if (d_.payloads_.size() > most_payloads)
      throw file.bad("payloads", fmt::format("{} names at most", most_payloads));
    const ConfigSection modes = file.section("modes");
    for (const std::string& name : modes.keys()) add_mode(modes, name);
    const ConfigSection ids = file.section("parameter_ids");
    for (const std::string& name : ids.keys()) parameter_ids_[name] = ids.integer(name, 1, 65535);
  }

  /// A mode beside those of SRFS.
  void add_mode(const ConfigSection& modes, const std::string& name) {
    auto& labels = d_.enums_["mission_mode"].labels;
    const std::int64_t number = modes.integer(name, 1, 31);
    const bool known =
        std::any_of(labels.begin(), labels.end(), [&](const auto& l) { return l.second == name; });
    if (known || labels.contains(number)) throw modes.bad(name, "a new name, and a new number");
    labels[number] = name;
  }

  /// { structure: NAME, field: NAME }, beside what the caller reads
  [[nodiscard]] TelemetryPlace read_place(const ConfigSection& section, std::size_t elements) const {
    const Structure* const from = d_.structure(section.text("structure"));
    if (from == nullptr || from->id == 0) throw section.bad("structure", "a housekeeping structure");
    const std::string name = section.text("field");
    const auto offset = Dictionary::offset_of(*from, name);
    const auto field = std::find_if(from->fields.begin(), from->fields.end(),
                                    [&](const Field& f) { return f.name == name; });
    if (!offset || field->type != FieldType::f32 || field->count != elements || !field->calibration.empty())
      throw section.bad("field",
                        fmt::format("{} x f32 of that structure, uncalibrated, no text before it", elements));
    return {from->node, from->id, *offset};
  }

  /// beacon: { VALUE: { structure: NAME, field: NAME, scale: 1 } }, attitude: { structure: NAME, field: NAME
  /// }
  void read_sources(const ConfigSection& file) {
    const ConfigSection beacon = file.section("beacon");
    for (const std::string& value : beacon.keys()) {
      if (std::find(beacon_values.begin(), beacon_values.end(), value) == beacon_values.end())
        throw beacon.bad(value, fmt::format("one of {}", fmt::join(beacon_values, ", ")));
      const ConfigSection section = beacon.section(value);
      TelemetryPlace place = read_place(section, 1);
      const auto scale = static_cast<float>(section.number("scale", -1e6, 1e6, 1));
      section.finish();
      d_.beacon_sources_.push_back({value, std::move(place), scale});
    }
    if (!file.has("attitude")) return;
    const ConfigSection attitude = file.section("attitude");
    d_.attitude_ = read_place(attitude, 4);
    attitude.finish();
  }

  /// Arguments of a telecommand, once for each entry.
  void read_telecommands(const ConfigSection& file, std::string_view key, std::string_view command,
                         std::vector<Dictionary::Arguments>& into) const {
    for (const ConfigSection& section : file.sections(key)) {
      Dictionary::Arguments arguments;
      for (const std::string& argument : section.keys())
        arguments.push_back(argument + "=" + section.raw(argument).as<std::string>(""));
      if (const auto encoded = d_.encode(command, arguments); !encoded)
        throw file.bad(key, fmt::format("arguments of {}: {}", command, encoded.error().message));
      section.finish();
      into.push_back(std::move(arguments));
    }
  }

  void read_store(const ConfigSection& section) {
    PacketStore store;
    store.name = section.text("name");
    store.id = static_cast<std::uint16_t>(section.integer("id", 1, 65535));
    store.quota_mib = static_cast<std::uint32_t>(section.integer("quota_mib", 1, 1 << 20));
    for (const auto service : section.integers("services", 1, 255))
      store.services.push_back(static_cast<std::uint8_t>(service));
    store.description = section.text("description", "");
    section.finish();
    d_.stores_.push_back(std::move(store));
  }

  void read_enum(const ConfigSection& enums, const std::string& name) {
    if (d_.enums_.contains(name)) throw enums.bad(name, "a name that no other enum has");
    const ConfigSection section = enums.section(name);
    Enumeration& e = d_.enums_[name];
    e.name = name;
    e.description = section.text("description", "");
    static_cast<void>(section.choice("type", {"u8", "u16", "u32"}, "u8"));
    const ConfigSection labels = section.section("labels");
    for (const auto& label : labels.keys()) e.labels[labels.integer(label, 0, 0xffffffff)] = label;
    section.finish();
  }

  /// What the whole spacecraft shares is none of a fragment's business.
  static void check_keys(const ConfigSection& fragment) {
    for (const std::string_view key : {"spacecraft", "services", "stores", "failure_codes"}) {
      if (fragment.has(key)) throw fragment.bad(key, "nothing: a fragment has none");
    }
    if (fragment.sections("apids").size() != 1)
      throw fragment.bad("apids", "one entry, of the fragment's node");
    (void)fragment.sections("apids").front().integer("apid", 1, highest_apid);
  }

  void read_fragment(const ConfigSection& file) {
    const std::size_t structures = d_.structures_.size();
    const std::size_t commands = d_.commands_.size();
    const std::size_t events = d_.events_.size();
    const std::size_t parameters = d_.parameters_.size();
    read_entries(file);
    const std::string node = file.sections("apids").front().text("node");
    const auto require = [&](bool fine, const std::string& entry, std::string_view expected) {
      if (!fine) throw ConfigError(fmt::format("{}: {}: expected {}", file.file(), entry, expected));
    };
    const std::string of_the_node = fmt::format("an entry of the node {}, whose fragment this is", node);
    for (std::size_t i = structures; i < d_.structures_.size(); ++i) {
      const Structure& s = d_.structures_[i];
      require(s.kind == StructureKind::group || s.node == node, s.name, of_the_node);
      require(s.kind != StructureKind::report, s.name, "no report of a PUS service: ttc provides them");
    }
    for (std::size_t i = commands; i < d_.commands_.size(); ++i) {
      const Command& c = d_.commands_[i];
      require(c.node == node, c.name, of_the_node);
      require(c.is_function(), c.name, "a function: ttc provides the PUS services");
      require(octets_of(c.arguments) <= argument_octets_max, c.name,
              fmt::format("arguments of {} octets at most", argument_octets_max));
    }
    for (std::size_t i = events; i < d_.events_.size(); ++i) {
      require(octets_of(d_.events_[i].fields) <= event_octets_max, d_.events_[i].name,
              fmt::format("fields of {} octets at most", event_octets_max));
    }
    for (std::size_t i = parameters; i < d_.parameters_.size(); ++i)
      require(d_.parameters_[i].node == node, d_.parameters_[i].name, of_the_node);
  }

  static std::size_t octets_of(const std::vector<Field>& fields) {
    std::size_t octets = 0;
    for (const Field& field : fields) octets += field.max_size();
    return octets;
  }

  void index_structures(const ConfigSection& file) {
    for (const auto& section : file.sections("structures")) {
      if (!by_name_.emplace(section.text("name"), section).second)
        throw section.bad("name", "a name that no other structure has");
    }
  }

  void read_entries(const ConfigSection& file) {
    for (const auto& section : file.sections("structures")) read_structure(section);
    for (const auto& section : file.sections("commands")) read_command(section);
    for (const auto& section : file.sections("events")) read_event(section);
    for (const auto& section : file.sections("parameters")) read_parameter(section);
  }

  void read_structure(const ConfigSection& section) {
    Structure s;
    s.name = section.text("name");
    const std::string kind = kind_of(section);
    s.kind = kind == "raw"      ? StructureKind::raw
             : kind == "group"  ? StructureKind::group
             : kind == "report" ? StructureKind::report
                                : StructureKind::housekeeping;
    s.description = section.text("description", "");
    if (s.kind != StructureKind::group) {
      s.node = section.text("node");
      s.apid = apid_of(section);
    }
    if (s.kind == StructureKind::housekeeping) {
      s.id = static_cast<std::uint16_t>(section.integer("id", 1, 65535));
      s.interval = milliseconds(section.integer("interval_ms", 100, 3'600'000));
    }
    if (s.kind == StructureKind::report) std::tie(s.service, s.subtype) = read_service(section);
    const auto limit = static_cast<std::size_t>(section.integer("max_size", 1, 1024, 1024));
    s.fields = read_fields(section, "fields", 0);
    if (s.max_size() > limit)
      throw section.bad("fields", fmt::format("at most {} octets (it is {})", limit, s.max_size()));
    section.finish();
    d_.structures_.push_back(std::move(s));
  }

  void read_event(const ConfigSection& section) {
    Event e;
    e.name = section.text("name");
    e.id = static_cast<std::uint16_t>(section.integer("id", 1, 65535));
    e.severity = parse_severity(section);
    e.text = section.text("text");
    e.fields = read_fields(section, "fields", 0);
    section.finish();
    d_.events_.push_back(std::move(e));
  }

  static std::pair<std::uint8_t, std::uint8_t> read_service(const ConfigSection& section) {
    const auto pair = section.integers("service", 1, 255);
    if (pair.size() != 2) throw section.bad("service", "a list [service, subtype]");
    return {static_cast<std::uint8_t>(pair[0]), static_cast<std::uint8_t>(pair[1])};
  }

  /// One entry for each node that has it, with ids that count up from the entry's.
  void read_parameter(const ConfigSection& section) {
    Parameter p;
    const std::vector<std::string> nodes = nodes_of(section);
    p.node_parameter = section.text("name");
    p.list = section.boolean("list", false);
    p.guarded = section.boolean("guarded", false);
    const std::int64_t last_id = 65535 - static_cast<std::int64_t>(nodes.size());
    auto id = section.integer("id", 1, last_id);
    const auto own = parameter_ids_.find(p.node_parameter);
    if (own != parameter_ids_.end() && section.raw("nodes").IsDefined()) id = own->second;
    if (id > last_id) throw section.bad("id", fmt::format("ids up to 65535, parameter_ids says {}", id));
    p.field = read_field(section);
    const bool sendable = p.field.count == 1 && p.field.type != FieldType::parameter_value &&
                          p.field.type != FieldType::time && p.field.type != FieldType::packet &&
                          p.field.calibration.empty() && (!p.list || p.field.type == FieldType::text);
    if (!sendable) throw section.bad("type", "a number, bool or text; a list is a text");
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (d_.apid_of_node(nodes[i]) == nullptr) throw section.bad("node", "a node of the list apids");
      p.id = static_cast<std::uint16_t>(id + static_cast<std::int64_t>(i));
      p.node = nodes[i];
      p.name = p.node + "." + p.node_parameter;
      d_.parameters_.push_back(p);
    }
  }

  /// `nodes` is a list, `all` or `payloads`; or there is one `node`.
  [[nodiscard]] std::vector<std::string> nodes_of(const ConfigSection& section) const {
    const YAML::Node raw = section.raw("nodes");
    if (!raw.IsDefined()) return {section.text("node")};
    if (!raw.IsScalar()) return section.texts("nodes");
    return section.choice("nodes", {"all", "payloads"}, "all") == "all" ? d_.nodes() : d_.payloads_;
  }

  void read_command(const ConfigSection& section) {
    Command c;
    c.name = section.text("name");
    c.node = section.text("node");
    c.apid = apid_of(section);
    c.description = section.text("description", "");
    if (section.has("service")) {
      std::tie(c.service, c.subtype) = read_service(section);
    } else {
      c.function_id = static_cast<std::uint16_t>(section.integer("function", 1, 65535));
    }
    if (section.has("peripheral_function")) {
      c.peripheral_function = static_cast<std::uint8_t>(section.integer("peripheral_function", 1, 255));
    }
    c.repeat_class = parse_repeat(section);
    c.hazardous = section.boolean("hazardous", false);
    c.recovery = section.boolean("recovery", false);
    c.repeated = section.boolean("repeated", false);
    if (c.repeated) {
      c.max_groups = static_cast<std::size_t>(section.integer("max_groups", 1, most_groups, most_groups));
      c.min_groups = static_cast<std::size_t>(section.integer("min_groups", 0, 1, 1));
      c.head = static_cast<std::size_t>(section.integer("head", 0, 16, 0));
    }
    c.timeout = milliseconds(section.integer("timeout_ms", 100, 86'400'000, 10'000));
    c.modes = read_modes(section);
    c.arguments = read_fields(section, "arguments", 0);
    if (c.head >= std::max<std::size_t>(c.arguments.size(), 1))
      throw section.bad("head", "fewer than there are arguments");
    c.reports = read_reports(section, c);
    section.finish();
    d_.commands_.push_back(std::move(c));
  }

  /// By structure, by the argument that names a structure, or, of reports that are none, by service.
  std::optional<OrderedReports> read_reports(const ConfigSection& command, const Command& c) const {
    if (!command.has("reports")) return std::nullopt;
    const ConfigSection section = command.section("reports");
    OrderedReports reports;
    reports.several = section.boolean("several", false);
    reports.may_be_none = section.boolean("may_be_none", false);
    std::tie(reports.service, reports.subtype) = housekeeping_report;
    if (section.has("structure")) {
      reports.structure = section.text("structure");
      const auto found = by_name_.find(reports.structure);
      const std::string kind = found == by_name_.end() ? "none" : kind_of(found->second);
      if (kind != "housekeeping" && kind != "report")
        throw section.bad("structure", "a structure that is sent: of the kind housekeeping or report");
      if (kind == "report") std::tie(reports.service, reports.subtype) = read_service(found->second);
    } else if (section.has("argument")) {
      reports.argument = section.text("argument");
      const bool names_it = std::any_of(c.arguments.begin(), c.arguments.end(), [&](const Field& field) {
        return field.name == reports.argument && field.reference == Reference::structure;
      });
      if (!names_it || c.head > 0)
        throw section.bad("argument",
                          "an argument of this command, which has no head, that names a structure");
    } else {
      std::tie(reports.service, reports.subtype) = read_service(section);
    }
    section.finish();
    return reports;
  }

  static std::string kind_of(const ConfigSection& structure) {
    return structure.choice("kind", {"housekeeping", "raw", "group", "report"}, "housekeeping");
  }

  std::vector<std::uint8_t> read_modes(const ConfigSection& section) const {
    const auto found = d_.enums_.find("mission_mode");
    if (found == d_.enums_.end()) throw section.bad("modes", "the enum mission_mode in mission.yaml");
    const std::vector<std::string> wanted = section.texts("modes");
    std::vector<std::uint8_t> modes;
    for (const auto& [value, label] : found->second.labels) {
      const bool allowed = wanted.empty() || std::find(wanted.begin(), wanted.end(), label) != wanted.end();
      if (allowed) modes.push_back(static_cast<std::uint8_t>(value));
    }
    if (!wanted.empty() && modes.size() != wanted.size())
      throw section.bad("modes", "labels of the enum mission_mode");
    return modes;
  }

  /// Included structures are laid out in place. @param depth guards against structures that include each
  /// other
  std::vector<Field> read_fields(const ConfigSection& owner, std::string_view key, int depth) {
    std::vector<Field> fields;
    std::set<std::string> names;
    for (const auto& section : owner.sections(key)) {
      std::vector<Field> added;
      if (section.has("structure")) {
        const auto found = by_name_.find(section.text("structure"));
        if (found == by_name_.end() || depth > 3)
          throw section.bad("structure", "the name of another structure");
        static_cast<void>(section.text("as"));
        added = read_fields(found->second, "fields", depth + 1);
        section.finish();
      } else {
        added.push_back(read_field(section));
      }
      for (auto& field : added) {
        if (!names.insert(field.name).second) {
          throw section.bad(section.has("structure") ? "structure" : "name",
                            fmt::format("'{}' once in one structure", field.name));
        }
        fields.push_back(std::move(field));
      }
    }
    fields.shrink_to_fit();  // they stay for the life of the process
    return fields;
  }

  Field read_field(const ConfigSection& section) const {
    Field f;
    f.name = section.text("name");
    f.type = parse_type(section);
    f.unit = section.text("unit", "");
    f.description = section.text("description", "");
    const YAML::Node count = section.raw("count");
    const std::string per = count.IsDefined() && count.IsScalar() ? count.as<std::string>() : "";
    if (per == "payloads" || per == "nodes") {
      f.labels = per == "nodes" ? d_.nodes() : d_.payloads_;
      f.count = f.labels.size();
      if (f.count == 0) throw section.bad("count", "payloads in the mission's file");
    } else {
      f.count = static_cast<std::size_t>(section.integer("count", 1, 256, 1));
      f.labels = section.texts("labels");
    }
    if (!f.labels.empty() && f.labels.size() != f.count)
      throw section.bad("labels", fmt::format("{} names, as count says", f.count));
    if (f.type == FieldType::packet) f.max_text = static_cast<std::size_t>(section.integer("max", 7, 1000));
    if (f.type == FieldType::text) f.max_text = static_cast<std::size_t>(section.integer("max", 1, 255));
    f.hex = section.choice("format", {"decimal", "hex"}, "decimal") == "hex";
    if (section.has("enum")) {
      const auto found = d_.enums_.find(section.text("enum"));
      if (found == d_.enums_.end()) throw section.bad("enum", "the name of an enum of the dictionary");
      f.enumeration = &found->second;
    }
    f.reference = parse_reference(section);
    f.calibration = parse_calibration(section);
    f.unknown = parse_unknown(section, f);
    const ConfigSection limits = section.section("limits");
    f.soft = parse_bounds(limits, "soft");
    f.hard = parse_bounds(limits, "hard");
    limits.finish();
    f.range = parse_bounds(section, "range");
    f.has_default = section.has("default");
    f.default_text = section.text("default", "");
    section.finish();
    return f;
  }

  std::uint16_t apid_of(const ConfigSection& section) const {
    const auto* process = d_.apid_of_node(section.text("node"));
    if (process == nullptr) throw section.bad("node", "a node of the list apids");
    return process->apid;
  }

  template <class T, class Key>
  static void require_unique(const std::vector<T>& entries, Key key, std::string_view what) {
    std::set<decltype(key(entries.front()))> seen;
    for (const auto& entry : entries) {
      if (!seen.insert(key(entry)).second)
        throw ConfigError(fmt::format("mission dictionary: {} {} stands twice", what, key(entry)));
    }
  }

  void check_unique() const {
    require_unique(
        d_.apids_, [](const auto& a) { return a.apid; }, "APID");
    require_unique(
        d_.apids_, [](const auto& a) { return a.node; }, "APID of the node");
    require_unique(
        d_.failure_codes_, [](const auto& f) { return f.code; }, "failure code");
    require_unique(
        d_.stores_, [](const auto& s) { return s.id; }, "store id");
    require_unique(
        d_.events_, [](const auto& e) { return e.id; }, "event id");
    require_unique(
        d_.events_, [](const auto& e) { return e.name; }, "event");
    require_unique(
        d_.commands_, [](const auto& c) { return c.name; }, "command");
    require_unique(
        d_.commands_,
        [](const auto& c) {
          return fmt::format("apid {} service {},{} function {}", c.apid, c.service, c.subtype,
                             c.function_id);
        },
        "command");
    require_unique(
        d_.parameters_, [](const auto& p) { return p.id; }, "parameter id");
    require_unique(
        d_.parameters_, [](const auto& p) { return p.name; }, "parameter");
    std::set<std::uint16_t> ids;
    for (const auto& s : d_.structures_) {
      if (s.id != 0 && !ids.insert(s.id).second)
        throw ConfigError(fmt::format("mission dictionary: structure id {} stands twice", s.id));
    }
  }

  Dictionary d_;
  std::vector<ConfigSection> files_;
  std::map<std::string, ConfigSection> by_name_;
  std::map<std::string, std::int64_t> parameter_ids_;  ///< first ids that the mission chose
};

DictionaryParts parts_of(Dictionary& dictionary) {
  return DictionaryLoader::parts_of(dictionary);
}

Dictionary empty_dictionary() {
  return DictionaryLoader::empty();
}

std::optional<std::string> Fragment::node() const {
  try {
    const auto apids = ConfigSection::parse(text, name).sections("apids");
    if (apids.size() == 1) return apids.front().text("node");
  } catch (const ConfigError&) {
    // Its loader says what is wrong with it.
  }
  return std::nullopt;
}

Dictionary Dictionary::load(const std::filesystem::path& folder, const std::vector<Fragment>& fragments) {
  return DictionaryLoader().load(folder, fragments);
}

Dictionary Dictionary::load_fitting(const std::filesystem::path& folder,
                                    const std::vector<Fragment>& fragments,
                                    std::vector<RefusedFragment>& refused) {
  try {
    return load(folder, fragments);
  } catch (const ConfigError&) {
    if (fragments.empty()) throw;
  }
  std::vector<Fragment> fitting;
  Dictionary dictionary = load(folder);
  for (const Fragment& fragment : fragments) {
    fitting.push_back(fragment);
    try {
      dictionary = load(folder, fitting);
    } catch (const ConfigError& e) {
      fitting.pop_back();
      refused.push_back({fragment.name, e.what()});
    }
  }
  return dictionary;
}

namespace {

/// The folder of the installation that the running program or this library belongs to; nothing: the source
/// tree's.
std::filesystem::path installed_or(const char* installed, const char* in_source) {
  std::error_code error;
  std::vector<std::filesystem::path> files{std::filesystem::read_symlink("/proc/self/exe", error)};
  Dl_info self{};
  if (dladdr(reinterpret_cast<const void*>(&installed_or), &self) != 0 && self.dli_fname != nullptr)
    files.push_back(std::filesystem::absolute(self.dli_fname, error));
  for (const auto& file : files) {
    const auto prefix = file.parent_path().parent_path();
    for (const auto& each : {prefix, prefix.parent_path()}) {  // lib may have a folder for the architecture
      auto folder = each / "share" / "srfs" / installed;
      if (std::filesystem::exists(folder, error)) return folder;
    }
  }
  return std::filesystem::path(SRFS_SOURCE_TREE) / in_source;
}

bool includes_others(const std::filesystem::path& mission_file) {
  std::error_code error;
  return std::filesystem::exists(mission_file, error) && ConfigSection::load(mission_file).has("include");
}

std::vector<std::filesystem::path> yaml_files_of(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    if (entry.path().extension() == ".yaml") files.push_back(entry.path());
  }
  if (error)
    throw ConfigError(
        fmt::format("{}: cannot read the mission dictionary: {}", folder.string(), error.message()));
  if (files.empty())
    throw ConfigError(fmt::format("{}: no mission dictionary here (no *.yaml)", folder.string()));
  std::sort(files.begin(), files.end(), [](const auto& a, const auto& b) {
    return std::pair(a.filename() != "mission.yaml", a.filename()) <
           std::pair(b.filename() != "mission.yaml", b.filename());
  });
  return files;
}

}  // namespace

std::vector<std::filesystem::path> Dictionary::files(const std::filesystem::path& folder) {
  const auto own = folder / "mission.yaml";
  if (!includes_others(own)) return yaml_files_of(folder);
  std::vector<std::filesystem::path> files{own};
  for (auto& file : yaml_files_of(core_folder())) files.push_back(std::move(file));
  const ConfigSection mission = ConfigSection::load(own);
  for (const std::string& file : mission.texts("include")) {
    // What is built, installed and read at run time is the same: one folder a payload.
    const std::filesystem::path path(file);
    if (path != path.parent_path().filename() / "dictionary.yaml" || file.starts_with(".."))
      throw mission.bad("include", fmt::format("FOLDER/dictionary.yaml, not '{}'", file));
    files.push_back(folder / file);
  }
  return files;
}

std::vector<std::string> Dictionary::payloads_of(const std::filesystem::path& folder) {
  return ConfigSection::load(folder / "mission.yaml").texts("payloads");
}

std::filesystem::path Dictionary::default_folder() {
  if (const char* folder = std::getenv("SRFS_MISSION_DIR"); folder != nullptr && *folder != '\0')
    return folder;
  return installed_or("mission", "mission");
}

std::filesystem::path Dictionary::core_folder() {
  return installed_or("core", "msgs/mission");
}

}  // namespace srfs::mission
