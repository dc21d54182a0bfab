// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "msgs/mission/fields.hpp"

/// The mission dictionary as data: what ttc and the ground tools load at run time. Flight nodes use the
/// structs that are generated from the same files (<mission/structures.hpp>).
namespace srfs::mission {

/// packet: a whole space packet, as long as its header says. parameter_value: an argument whose type is that
/// of the node parameter named before it.
enum class FieldType : std::uint8_t {
  u8,
  u16,
  u32,
  u64,
  i8,
  i16,
  i32,
  i64,
  f32,
  f64,
  boolean,
  text,
  time,
  packet,
  parameter_value
};

/// What a number in a field names, so that people write and read the name.
enum class Reference : std::uint8_t {
  none,
  structure,
  event,
  event_or_none,  ///< 0: none
  store,
  failure_code,
  parameter,
  telemetry,  ///< an element of a housekeeping structure, as Dictionary::telemetry; 0: none
};

/// Bounds of which either may be missing. Inclusive: a value on the bound is inside.
struct Bounds {
  std::optional<double> low;
  std::optional<double> high;
  [[nodiscard]] bool contains(double v) const { return !(low && v < *low) && !(high && v > *high); }
};
/// "1 to 4294967295", "at least 0.5", "at most 3"
[[nodiscard]] std::string to_text(const Bounds& bounds);

struct Enumeration {
  std::string name;
  std::string description;
  std::map<std::int64_t, std::string> labels;
};

/// One field of a structure or event, or one argument of a command.
struct Field {
  std::string name;
  FieldType type = FieldType::u8;
  std::string unit;  ///< empty: none
  std::string description;
  std::size_t count = 1;            ///< elements of an array
  std::vector<std::string> labels;  ///< names of the elements; empty: [0], [1], ...
  std::size_t max_text = 0;         ///< largest number of octets of a text or packet
  bool hex = false;                 ///< shown as hexadecimal
  const Enumeration* enumeration = nullptr;
  Reference reference = Reference::none;
  std::vector<double> calibration;  ///< polynomial, constant first; empty: the raw value is the value
  std::optional<std::int64_t>
      unknown;                  ///< raw value that says "not known", of a u64 its 64 bits; of a time 0
  std::optional<Bounds> soft;   ///< telemetry: outside is yellow
  std::optional<Bounds> hard;   ///< telemetry: outside is red
  std::optional<Bounds> range;  ///< argument: outside is refused
  std::string default_text;     ///< argument: used when it is not given
  bool has_default = false;

  [[nodiscard]] std::size_t max_size() const;
};

struct ApplicationProcess {
  std::string name;
  std::uint16_t apid = 0;
  std::string node;
  std::string description;
  bool added = false;  ///< of a fragment
};

struct FailureCode {
  std::uint16_t code = 0;
  std::string name;
  std::string text;
  std::string parameter;  ///< what follows the code in the report; empty: nothing
};

struct PacketStore {
  std::uint16_t id = 0;
  std::string name;
  std::uint32_t quota_mib = 0;
  std::vector<std::uint8_t> services;  ///< reports of these services go into it
  std::string description;
};

enum class StructureKind : std::uint8_t { housekeeping, raw, group, report };

/// A parameter of a node that the ground may read and change (PUS 20).
struct Parameter {
  std::uint16_t id = 0;
  std::string name;  ///< "NODE.PARAMETER"
  std::string node;
  std::string node_parameter;  ///< its name at the node
  Field field;                 ///< how its value stands on the link; its range and enumeration bind
  bool list = false;           ///< a text that is a list at the node, its elements separated by commas
  bool guarded = false;        ///< a change of it is on trial until it is confirmed
};

struct Structure {
  std::string name;
  StructureKind kind = StructureKind::housekeeping;
  std::uint16_t id = 0;      ///< PUS 3 structure id; 0: not housekeeping
  std::uint8_t service = 0;  ///< of a report
  std::uint8_t subtype = 0;
  std::uint16_t apid = 0;
  std::string node;
  milliseconds interval{0};
  std::string description;
  std::vector<Field> fields;  ///< included structures are laid out in place

  [[nodiscard]] std::size_t max_size() const;
};

struct Event {
  std::string name;
  std::uint16_t id = 0;
  EventSeverity severity = EventSeverity::info;
  std::string text;  ///< "{field}" stands for the field's value
  std::vector<Field> fields;
};

/// Service and subtype of the reports that carry a housekeeping structure.
inline constexpr std::pair<std::uint8_t, std::uint8_t> housekeeping_report{3, 25};

/// What a telecommand orders down, beside its verification reports.
struct OrderedReports {
  std::uint8_t service = 0;
  std::uint8_t subtype = 0;
  std::string structure;  ///< the structure of these reports; empty: they have none, or the argument names it
  std::string argument;   ///< of the telecommand: names the structure
  bool several = false;   ///< how many there are is not known before they came
  bool may_be_none = false;  ///< there may be nothing to report
};

struct Command {
  std::string name;
  std::string node;  ///< executes it
  std::uint16_t apid = 0;
  std::uint8_t service = 8;
  std::uint8_t subtype = 1;
  std::uint16_t function_id = 0;  ///< 0: a request of a PUS service, not a function
  std::optional<std::uint8_t>
      peripheral_function;  ///< the node passes it on to its peripheral under this number
  std::string description;
  RepeatClass repeat_class = RepeatClass::at_most_once;
  bool hazardous = false;
  bool recovery = false;       ///< runs without storage too
  bool repeated = false;       ///< a u16 count stands before the arguments; the group may come several times
  std::size_t min_groups = 1;  ///< 0: the count may be zero
  std::size_t max_groups = 1;  ///< bound of that count; a request with more is refused
  std::size_t head = 0;        ///< that many arguments stand before the count, once
  std::vector<std::uint8_t> modes;  ///< allowed mission modes
  milliseconds timeout{0};          ///< acceptance to completion
  std::vector<Field> arguments;
  std::optional<OrderedReports> reports;

  [[nodiscard]] bool is_function() const { return function_id != 0; }
  [[nodiscard]] bool allowed_in(std::uint8_t mode) const;
};

/// One decoded element. The variant: integers as they are, calibrated and floating values as double, text (a
/// packet in hexadecimal), or a time.
using Value = std::variant<std::uint64_t, std::int64_t, double, bool, std::string, TaiTime>;

enum class LimitState : std::uint8_t { none, green, yellow, red };
[[nodiscard]] std::string_view to_text(LimitState state);

struct DecodedField {
  std::string name;  ///< "body_rate_rad_s.x" for an element of an array
  Value value;
  std::string text;  ///< for people: label of an enum, name of a reference, ISO time, "unknown"; without unit
  std::string unit;
  LimitState limit = LimitState::none;  ///< none: the dictionary states no limits, or the value is unknown
  bool known = true;  ///< false: the satellite says that it does not know; the value is NaN or the raw one
};

/// Why a text command cannot be sent, for people: "eps.switch_load: argument 'load': 7 is out of range 0..3".
struct CommandError {
  std::string message;
};

/// A command ready to be put into a packet.
struct EncodedCommand {
  const Command* command = nullptr;
  Octets data;  ///< packet data after the PUS header: function id for service 8, count, arguments
};

/// What an added node brings into the dictionary: YAML like a file of it, about one node alone. Exactly one
/// entry in `apids`, which names the node; enums, structures, functions (PUS 8), events and parameters of
/// that node. Ids and names must be new; structures of the dictionary may be included.
struct Fragment {
  static constexpr std::size_t octets_max = 32768;
  std::string name;  ///< for messages: a file or a node
  std::string text;

  /// The node that it is about; nullopt: cannot be determined.
  [[nodiscard]] std::optional<std::string> node() const;
};

/// An f32, or several, at a fixed place of a housekeeping structure.
struct TelemetryPlace {
  std::string node;
  std::uint16_t structure_id = 0;
  std::size_t offset = 0;  ///< octets before it
};
/// Where a value of the beacon comes from.
struct BeaconSource {
  std::string value;  ///< field of the beacon
  TelemetryPlace from;
  float scale = 1;
};

/// An element of a housekeeping structure: what a monitor watches. Its number is the structure's id (16
/// bits), then the number of the element, from 0; its name is STRUCTURE.ELEMENT, as DecodedField names it.
struct TelemetryElement {
  const Structure* structure = nullptr;
  const Field* field = nullptr;
  std::size_t index = 0;  ///< in an array
};

struct RefusedFragment {
  std::string name;
  std::string why;
};

class Dictionary {
 public:
  /// Reads files(folder), then the fragments. Throws ConfigError (file, line, key, expected), also for a
  /// fragment that does not fit. Blocks on the disk.
  static Dictionary load(const std::filesystem::path& folder, const std::vector<Fragment>& fragments = {});
  /// The same, without fragments that do not fit: the dictionary of the mission is read whatever they are.
  static Dictionary load_fitting(const std::filesystem::path& folder, const std::vector<Fragment>& fragments,
                                 std::vector<RefusedFragment>& refused);
  /// The files of a dictionary. Of a mission, whose mission.yaml has `include`: SRFS' own part
  /// (core_folder()), mission.yaml, what it includes. Else every *.yaml of the folder, mission.yaml first.
  static std::vector<std::filesystem::path> files(const std::filesystem::path& folder);
  /// Where the mission's dictionary stands: $SRFS_MISSION_DIR, else share/srfs/mission of the installation of
  /// this library when it exists, else the folder in the source tree this was built from.
  static std::filesystem::path default_folder();
  /// The same of SRFS' own part: share/srfs/core.
  static std::filesystem::path core_folder();
  /// payloads() of the dictionary of this folder, from its mission.yaml alone. Throws ConfigError.
  static std::vector<std::string> payloads_of(const std::filesystem::path& folder);

  Dictionary(Dictionary&&) = default;
  Dictionary& operator=(Dictionary&&) = default;
  Dictionary(const Dictionary&) = delete;  // fields point into enums_
  Dictionary& operator=(const Dictionary&) = delete;

  [[nodiscard]] std::uint16_t spacecraft_id() const { return spacecraft_id_; }
  [[nodiscard]] const std::vector<ApplicationProcess>& apids() const { return apids_; }
  [[nodiscard]] const std::vector<Structure>& structures() const { return structures_; }
  [[nodiscard]] const std::vector<Command>& commands() const { return commands_; }
  [[nodiscard]] const std::vector<Event>& events() const { return events_; }
  [[nodiscard]] const std::vector<PacketStore>& stores() const { return stores_; }
  [[nodiscard]] const std::vector<FailureCode>& failure_codes() const { return failure_codes_; }
  [[nodiscard]] const std::vector<Parameter>& parameters() const { return parameters_; }
  /// In slot order: the elements of fields per payload (`count: payloads`).
  [[nodiscard]] const std::vector<std::string>& payloads() const { return payloads_; }
  /// In APID order, without added ones: the elements of fields per node (`count: nodes`).
  [[nodiscard]] std::vector<std::string> nodes() const;
  [[nodiscard]] const std::vector<BeaconSource>& beacon_sources() const { return beacon_sources_; }
  /// The attitude, body to inertial, a quaternion with the scalar last; nothing: this mission measures none.
  [[nodiscard]] const std::optional<TelemetryPlace>& attitude() const { return attitude_; }
  /// What the mission's file watches and does by itself at first: arguments of the telecommands monitor.add
  /// and event_action.add, which are good.
  using Arguments = std::vector<std::string>;
  [[nodiscard]] const std::vector<Arguments>& monitors() const { return monitors_; }
  [[nodiscard]] const std::vector<Arguments>& event_actions() const { return event_actions_; }
  /// nullopt: there is none.
  [[nodiscard]] std::optional<TelemetryElement> telemetry(std::uint32_t number) const;
  [[nodiscard]] std::optional<std::uint32_t> telemetry(std::string_view name) const;
  /// "STRUCTURE.ELEMENT"; empty: there is none.
  [[nodiscard]] std::string telemetry_name(std::uint32_t number) const;
  /// Takes one element off @p in. @return its value, calibrated; nullopt: it is unknown, no number, or not
  /// there
  [[nodiscard]] static std::optional<double> take_number(const Field& field, OctetReader& in);
  /// Octets before a field, when nothing before it varies in length; of an array, of its first element.
  [[nodiscard]] static std::optional<std::size_t> offset_of(const Structure& structure,
                                                            std::string_view field);

  // Lookups: nullptr when there is none. Pointers live as long as the dictionary.
  [[nodiscard]] const ApplicationProcess* apid(std::uint16_t apid) const;
  [[nodiscard]] const ApplicationProcess* apid_of_node(std::string_view node) const;
  [[nodiscard]] const Structure* structure(std::uint16_t id) const;
  [[nodiscard]] const Structure* structure(std::string_view name) const;
  /// A report of another PUS service than 3.
  [[nodiscard]] const Structure* report(std::uint8_t service, std::uint8_t subtype) const;
  [[nodiscard]] const Parameter* parameter(std::uint16_t id) const;
  [[nodiscard]] const Parameter* parameter(std::string_view name) const;
  [[nodiscard]] const Event* event(std::uint16_t id) const;
  [[nodiscard]] const Event* event(std::string_view name) const;
  [[nodiscard]] const PacketStore* store(std::uint16_t id) const;
  [[nodiscard]] const PacketStore* store(std::string_view name) const;
  [[nodiscard]] const FailureCode* failure_code(std::uint16_t code) const;
  [[nodiscard]] const Command* command(std::string_view name) const;
  /// A function (PUS 8,1) of an application process.
  [[nodiscard]] const Command* function(std::uint16_t apid, std::uint16_t function_id) const;
  /// A request of another PUS service.
  [[nodiscard]] const Command* request(std::uint16_t apid, std::uint8_t service, std::uint8_t subtype) const;
  /// The service has any request for this application process.
  [[nodiscard]] bool has_service(std::uint16_t apid, std::uint8_t service) const;

  // Ground side: text to octets.
  /// @param arguments "key=value"; values are numbers (decimal, 0x...), enum labels, names of references,
  /// true/false, ISO 8601 times, or packets in hexadecimal or as telecommands ("eps.switch_load load=2
  /// state=off"); a unit may follow a number directly ("1000ms").
  /// One group of a repeated one, or none if none is given and none need be; several where an argument of the
  /// group is a list ("id=1,2,3"), one value of another argument then holds for all.
  [[nodiscard]] Result<EncodedCommand, CommandError> encode(std::string_view command,
                                                            const std::vector<std::string>& arguments) const;

  // Board side: octets to a verdict.
  /// Checks encoded arguments (after the function id): length, ranges, enum values. References are checked
  /// for existence.
  [[nodiscard]] Result<void, ArgumentError> check_arguments(const Command& command,
                                                            OctetView arguments) const;

  /// The value of a node parameter: number, text or truth as it stands on the link. nullopt: the octets end
  /// early, or the value is not allowed.
  [[nodiscard]] std::optional<Value> take_parameter(const Parameter& parameter, OctetReader& in) const;
  /// @return false: the value is of another type, or does not fit the parameter's; nothing is written
  [[nodiscard]] bool put_parameter(const Parameter& parameter, const Value& value, OctetWriter& out) const;

  // Octets to text.
  /// All fields of a structure; nullopt when the octets are too short or too long.
  [[nodiscard]] std::optional<std::vector<DecodedField>> decode(const Structure& structure,
                                                                OctetView data) const;
  [[nodiscard]] std::optional<std::vector<DecodedField>> decode(const std::vector<Field>& fields,
                                                                OctetView data) const;
  /// The text of an event with its values filled in; fields that are missing in @p data read "?".
  [[nodiscard]] std::string render(const Event& event, OctetView data) const;

 private:
  friend class DictionaryLoader;
  Dictionary() = default;

  std::uint16_t spacecraft_id_ = 0;
  std::vector<ApplicationProcess> apids_;
  std::map<std::string, Enumeration, std::less<>> enums_;
  std::vector<Structure> structures_;
  std::vector<Command> commands_;
  std::vector<Event> events_;
  std::vector<PacketStore> stores_;
  std::vector<FailureCode> failure_codes_;
  std::vector<Parameter> parameters_;
  std::vector<std::string> payloads_;
  std::vector<BeaconSource> beacon_sources_;
  std::vector<Arguments> monitors_;
  std::vector<Arguments> event_actions_;
  std::optional<TelemetryPlace> attitude_;
};

}  // namespace srfs::mission
