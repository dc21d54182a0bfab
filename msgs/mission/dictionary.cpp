// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "msgs/mission/dictionary.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <sstream>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/text.hpp"
#include "wire/pus.hpp"

namespace srfs::mission {
namespace {

std::size_t octets_of(FieldType type) {
  switch (type) {
    case FieldType::u8:
    case FieldType::i8:
    case FieldType::boolean:
      return 1;
    case FieldType::u16:
    case FieldType::i16:
      return 2;
    case FieldType::u32:
    case FieldType::i32:
    case FieldType::f32:
      return 4;
    case FieldType::u64:
    case FieldType::i64:
    case FieldType::f64:
    case FieldType::time:
      return 8;
    case FieldType::text:
    case FieldType::packet:
    case FieldType::parameter_value:
      return 0;
  }
  return 0;
}

bool is_signed(FieldType type) {
  return type == FieldType::i8 || type == FieldType::i16 || type == FieldType::i32 || type == FieldType::i64;
}
bool is_float(FieldType type) {
  return type == FieldType::f32 || type == FieldType::f64;
}

std::size_t size_of(const std::vector<Field>& fields) {
  std::size_t size = 0;
  for (const auto& field : fields) size += field.max_size();
  return size;
}

template <class T, class Matches>
const T* find(const std::vector<T>& entries, Matches matches) {
  const auto found = std::find_if(entries.begin(), entries.end(), matches);
  return found == entries.end() ? nullptr : &*found;
}

/// The octets of one element as they stand on the link; nullopt when they end early or are not valid.
std::optional<Value> take_raw(const Field& field, OctetReader& in) {
  switch (field.type) {
    case FieldType::f32:
      return Value(static_cast<double>(in.f32()));
    case FieldType::f64:
      return Value(in.f64());
    case FieldType::boolean:
      return Value(in.u8() != 0);
    case FieldType::text: {
      std::string text;
      if (!detail::take_text(in, text, field.max_text)) return std::nullopt;
      return Value(std::move(text));
    }
    case FieldType::packet: {
      Octets packet;
      if (!detail::take_packet(in, packet, field.max_text)) return std::nullopt;
      return Value(to_hex(packet));
    }
    case FieldType::time: {
      TaiTime time;
      if (!detail::take_time(in, time)) return std::nullopt;
      return Value(time);
    }
    case FieldType::parameter_value:  // its parameter's field stands for it
      return std::nullopt;
    default:
      break;
  }
  const std::size_t octets = octets_of(field.type);
  const std::uint64_t raw = in.get(octets);
  if (!is_signed(field.type)) return Value(raw);
  const unsigned shift = static_cast<unsigned>(64 - 8 * octets);
  return Value(static_cast<std::int64_t>(raw << shift) >> shift);
}

std::optional<std::int64_t> as_integer(const Value& value) {
  if (const auto* u = std::get_if<std::uint64_t>(&value)) return static_cast<std::int64_t>(*u);
  if (const auto* i = std::get_if<std::int64_t>(&value)) return *i;
  return std::nullopt;
}

std::optional<double> as_number(const Value& value) {
  if (const auto* u = std::get_if<std::uint64_t>(&value)) return static_cast<double>(*u);
  if (const auto* i = std::get_if<std::int64_t>(&value)) return static_cast<double>(*i);
  if (const auto* d = std::get_if<double>(&value)) return *d;
  return std::nullopt;
}

double evaluate(const std::vector<double>& coefficients, double x) {
  double y = 0;
  for (auto c = coefficients.rbegin(); c != coefficients.rend(); ++c) y = y * x + *c;
  return y;
}

LimitState judge(const Field& field, double v) {
  if (!field.soft && !field.hard) return LimitState::none;
  if (field.hard && !field.hard->contains(v)) return LimitState::red;
  if (field.soft && !field.soft->contains(v)) return LimitState::yellow;
  return LimitState::green;
}

bool has_none(Reference reference) {
  return reference == Reference::failure_code || reference == Reference::event_or_none ||
         reference == Reference::telemetry;
}

std::string element_name(const Field& field, std::size_t index) {
  if (field.count == 1) return field.name;
  return field.name + (field.labels.empty() ? fmt::format("[{}]", index) : "." + field.labels[index]);
}

std::string reference_name(const Dictionary& d, Reference reference, std::uint32_t number) {
  if (number == 0 && has_none(reference)) return "none";
  if (reference == Reference::telemetry) return d.telemetry_name(number);
  if (number > UINT16_MAX) return "";
  const auto id = static_cast<std::uint16_t>(number);
  switch (reference) {
    case Reference::structure:
      if (const auto* s = d.structure(id)) return s->name;
      break;
    case Reference::event:
    case Reference::event_or_none:
      if (const auto* e = d.event(id)) return e->name;
      break;
    case Reference::store:
      if (const auto* s = d.store(id)) return s->name;
      break;
    case Reference::failure_code:
      if (const auto* f = d.failure_code(id)) return f->name;
      break;
    case Reference::parameter:
      if (const auto* p = d.parameter(id)) return p->name;
      break;
    case Reference::telemetry:
    case Reference::none:
      break;
  }
  return "";
}

std::optional<std::uint32_t> reference_id(const Dictionary& d, Reference reference, std::string_view name) {
  switch (reference) {
    case Reference::telemetry:
      return name == "none" ? std::optional<std::uint32_t>(0) : d.telemetry(name);
    case Reference::structure:
      if (const auto* s = d.structure(name); s != nullptr && s->id != 0) return s->id;
      break;
    case Reference::event_or_none:
      if (name == "none") return 0;
      [[fallthrough]];
    case Reference::event:
      if (const auto* e = d.event(name)) return e->id;
      break;
    case Reference::store:
      if (const auto* s = d.store(name)) return s->id;
      break;
    case Reference::parameter:
      if (const auto* p = d.parameter(name)) return p->id;
      break;
    case Reference::failure_code:
    case Reference::none:
      break;
  }
  return std::nullopt;
}

std::string_view kind_of(Reference reference) {
  switch (reference) {
    case Reference::structure:
      return "housekeeping structure";
    case Reference::event:
    case Reference::event_or_none:
      return "event";
    case Reference::telemetry:
      return "element of a housekeeping structure (STRUCTURE.FIELD)";
    case Reference::store:
      return "packet store";
    case Reference::failure_code:
      return "failure code";
    case Reference::parameter:
      return "node parameter";
    case Reference::none:
      break;
  }
  return "number";
}

std::string text_of(const Dictionary& d, const Field& field, const Value& value) {
  if (const auto integer = as_integer(value)) {
    if (field.enumeration != nullptr) {
      const auto label = field.enumeration->labels.find(*integer);
      return label != field.enumeration->labels.end() ? label->second : fmt::format("{}?", *integer);
    }
    if (field.reference != Reference::none) {
      const std::string name = reference_name(d, field.reference, static_cast<std::uint32_t>(*integer));
      return name.empty() ? fmt::format("{}?", *integer) : name;
    }
    if (field.hex) return fmt::format("0x{:0{}x}", *integer, octets_of(field.type) * 2);
  }
  if (const auto* u = std::get_if<std::uint64_t>(&value)) return fmt::format("{}", *u);
  if (const auto* i = std::get_if<std::int64_t>(&value)) return fmt::format("{}", *i);
  if (const auto* number = std::get_if<double>(&value)) return fmt::format("{:.6g}", *number);
  if (const auto* truth = std::get_if<bool>(&value)) return *truth ? "true" : "false";
  if (const auto* time = std::get_if<TaiTime>(&value)) return to_iso8601(to_utc(*time));
  return std::get<std::string>(value);
}

/// The raw value is the one that stands for "not known".
bool says_unknown(const Field& field, const Value& raw) {
  if (!field.unknown) return false;
  if (const auto* time = std::get_if<TaiTime>(&raw)) return time->ns() == *field.unknown;
  return as_integer(raw) == field.unknown;
}

DecodedField interpret(const Dictionary& d, const Field& field, std::size_t index, Value value) {
  DecodedField out;
  out.name = element_name(field, index);
  out.unit = field.unit;
  out.known = !says_unknown(field, value);
  if (!field.calibration.empty())
    value = out.known ? evaluate(field.calibration, as_number(value).value_or(0))
                      : std::numeric_limits<double>::quiet_NaN();
  const auto* truth = std::get_if<bool>(&value);
  const auto number = truth != nullptr ? std::optional(*truth ? 1.0 : 0.0) : as_number(value);
  out.known = out.known && !(number && std::isnan(*number));
  if (number && out.known) out.limit = judge(field, *number);
  out.text = out.known ? text_of(d, field, value) : "unknown";
  out.value = std::move(value);
  return out;
}

/// Numbers of an argument may carry the unit of the dictionary directly or after a space.
std::string_view without_unit(std::string_view text, const std::string& unit) {
  if (!unit.empty() && text.size() > unit.size() && text.ends_with(unit)) {
    text.remove_suffix(unit.size());
    while (text.ends_with(' ')) text.remove_suffix(1);
  }
  return text;
}

std::string range_text(const Field& field, double lowest, double highest) {
  if (is_float(field.type)) return fmt::format("{:g}..{:g}", lowest, highest);
  return fmt::format("{:.0f}..{:.0f}", lowest, highest);
}

/// Reads text arguments of one command. Errors name command and argument.
class ArgumentText {
 public:
  ArgumentText(const Dictionary& d, const Command& command) : d_(d), command_(command) {}

  Result<void, CommandError> write(const Field& field, std::string_view text, OctetWriter& out) const {
    if (field.type == FieldType::text) return write_text(field, text, out);
    if (field.type == FieldType::time) return write_time(field, text, out);
    if (field.type == FieldType::packet) return write_packet(field, text, out);
    if (field.type == FieldType::boolean) return write_bool(field, text, out);
    if (field.enumeration != nullptr) return write_label(field, text, out);
    if (is_float(field.type)) return write_float(field, text, out);
    return write_integer(field, text, out);
  }

  template <class... A>
  [[nodiscard]] auto error(const Field& field, fmt::format_string<A...> f, A&&... a) const {
    return Err(CommandError{fmt::format("{}: argument '{}': {}", command_.name, field.name,
                                        fmt::format(f, std::forward<A>(a)...))});
  }

 private:
  Result<void, CommandError> write_text(const Field& field, std::string_view text, OctetWriter& out) const {
    if (text.size() > field.max_text)
      return error(field, "is {} octets long, at most {}", text.size(), field.max_text);
    detail::put_text(out, std::string(text), field.max_text);
    return {};
  }

  Result<void, CommandError> write_time(const Field& field, std::string_view text, OctetWriter& out) const {
    const auto utc = from_iso8601(std::string(text));
    if (!utc) return error(field, "'{}' is not a UTC time like 2026-11-21T08:00:00Z", text);
    const TaiTime tai = to_tai(*utc);
    if (tai.ns() < 0 || tai.since_epoch() >= seconds(std::int64_t{1} << 32)) {
      return error(field, "{} is outside the link's time, 1958 to 2094", text);
    }
    detail::put_time(out, tai);
    return {};
  }

  Result<void, CommandError> write_packet(const Field& field, std::string_view text, OctetWriter& out) const {
    auto octets = from_hex(text);
    if (!octets) {
      auto made = packet_of(text);
      if (!made) {
        return error(field, "is not a whole packet in hexadecimal, nor a telecommand: {}",
                     made.error().message);
      }
      octets = std::move(*made);
    }
    OctetReader in(octets ? OctetView(*octets) : OctetView{});
    Octets packet;
    if (!detail::take_packet(in, packet, field.max_text) || in.remaining() != 0)
      return error(field, "is not a whole packet in hexadecimal of at most {} octets", field.max_text);
    out.bytes(packet);
    return {};
  }

  /// A telecommand as it is written: its name and its arguments.
  [[nodiscard]] Result<Octets, CommandError> packet_of(std::string_view text) const {
    std::istringstream words{std::string(text)};
    std::string name;
    words >> name;
    const auto encoded = d_.encode(name, {std::istream_iterator<std::string>(words), {}});
    if (!encoded) return Err(encoded.error());
    return wire::make_tc_packet({.apid = encoded->command->apid,
                                 .service = encoded->command->service,
                                 .subtype = encoded->command->subtype,
                                 .application = encoded->data});
  }

  Result<void, CommandError> write_bool(const Field& field, std::string_view text, OctetWriter& out) const {
    const bool yes = text == "true" || text == "1" || text == "on" || text == "yes";
    const bool no = text == "false" || text == "0" || text == "off" || text == "no";
    if (!yes && !no) return error(field, "'{}' is not true or false", text);
    out.u8(yes ? 1 : 0);
    return {};
  }

  Result<void, CommandError> write_label(const Field& field, std::string_view text, OctetWriter& out) const {
    std::vector<std::string> known;
    for (const auto& [value, label] : field.enumeration->labels) {
      known.push_back(fmt::format("{} ({})", label, value));
      if (label == text || fmt::format("{}", value) == text) {
        out.put(static_cast<std::uint64_t>(value), octets_of(field.type));
        return {};
      }
    }
    return error(field, "'{}' is not one of {}", text, fmt::join(known, ", "));
  }

  Result<void, CommandError> write_float(const Field& field, std::string_view text, OctetWriter& out) const {
    const std::string_view digits = without_unit(text, field.unit);
    const double value = to_number<double>(digits).value_or(NAN);
    if (!std::isfinite(value)) {
      return error(field, "'{}' is not a number{}", text, field.unit.empty() ? "" : " of " + field.unit);
    }
    if (field.range && !field.range->contains(value)) {
      return error(
          field, "{} is out of range {}", text,
          range_text(field, field.range->low.value_or(-HUGE_VAL), field.range->high.value_or(HUGE_VAL)));
    }
    if (field.type == FieldType::f64) {
      out.f64(value);
    } else if (std::isfinite(static_cast<float>(value))) {
      out.f32(static_cast<float>(value));
    } else {
      return error(field, "{} is too large", text);
    }
    return {};
  }

  Result<void, CommandError> write_integer(const Field& field, std::string_view text,
                                           OctetWriter& out) const {
    if (const auto id = reference_id(d_, field.reference, text)) {
      out.put(*id, octets_of(field.type));
      return {};
    }
    const auto value = parse_integer(without_unit(text, field.unit));
    if (!value) {
      if (field.reference != Reference::none)
        return error(field, "no {} is called '{}'", kind_of(field.reference), text);
      return error(field, "'{}' is not a whole number{}", text,
                   field.unit.empty() ? "" : " of " + field.unit);
    }
    const unsigned bits = static_cast<unsigned>(8 * octets_of(field.type));
    // The largest magnitude below zero and from zero on.
    const std::uint64_t half = std::uint64_t{1} << (bits - 1);
    const std::uint64_t least = is_signed(field.type) ? half : 0;
    const std::uint64_t most = is_signed(field.type) ? half - 1 : half - 1 + half;
    const bool fits = value->magnitude <= (value->negative ? least : most);
    const double magnitude = static_cast<double>(value->magnitude);
    const double number = value->negative ? -magnitude : magnitude;
    if (!fits || (field.range && !field.range->contains(number))) {
      const double lowest = is_signed(field.type) ? -std::exp2(bits - 1) : 0;
      const double highest = std::exp2(is_signed(field.type) ? bits - 1 : bits) - 1;
      const Bounds bounds = field.range.value_or(Bounds{});
      return error(field, "{} is out of range {}", text,
                   range_text(field, bounds.low.value_or(lowest), bounds.high.value_or(highest)));
    }
    if (field.reference != Reference::none &&
        reference_name(d_, field.reference, static_cast<std::uint32_t>(value->magnitude)).empty()) {
      return error(field, "no {} has the number {}", kind_of(field.reference), text);
    }
    // Two's complement for negative numbers.
    out.put(value->negative ? ~value->magnitude + 1 : value->magnitude, octets_of(field.type));
    return {};
  }

  struct Integer {
    bool negative = false;
    std::uint64_t magnitude = 0;
  };
  /// Decimal, or hexadecimal with 0x. nullopt: not a whole number of 64 bits.
  static std::optional<Integer> parse_integer(std::string_view text) {
    Integer value;
    value.negative = text.starts_with('-');
    if (value.negative) text.remove_prefix(1);
    const int base = text.starts_with("0x") ? 16 : 10;
    if (base == 16) text.remove_prefix(2);
    const auto magnitude = to_number<decltype(value.magnitude)>(text, base);
    if (!magnitude) return std::nullopt;
    value.magnitude = *magnitude;
    return value;
  }

  const Dictionary& d_;
  const Command& command_;
};

/// The field of a parameter_value is that of the parameter whose number stands before it.
class ParameterValues {
 public:
  explicit ParameterValues(const Dictionary& d) : d_(d) {}

  /// nullptr: no parameter was named.
  [[nodiscard]] const Field* field_of(const Field& field) const {
    if (field.type != FieldType::parameter_value) return &field;
    return parameter_ == nullptr ? nullptr : &parameter_->field;
  }
  void on_value(const Field& field, const Value& value) {
    if (field.reference != Reference::parameter) return;
    parameter_ = d_.parameter(static_cast<std::uint16_t>(as_integer(value).value_or(0)));
  }
  void on_encoded(const Field& field, OctetView octets) {
    OctetReader in(octets);
    if (field.reference == Reference::parameter) parameter_ = d_.parameter(in.u16());
  }

 private:
  const Dictionary& d_;
  const Parameter* parameter_ = nullptr;
};

bool is_allowed(const Dictionary& d, const Field& field, const Value& value) {
  if (const auto integer = as_integer(value)) {
    if (field.enumeration != nullptr) return field.enumeration->labels.contains(*integer);
    if (field.reference != Reference::none &&
        reference_name(d, field.reference, static_cast<std::uint32_t>(*integer)).empty())
      return false;
  }
  const auto number = as_number(value);
  if (!number) return true;
  if (!std::isfinite(*number)) return false;
  if (!field.range) return true;
  if (field.type != FieldType::f32) return field.range->contains(*number);
  // The float nearest to a bound is inside: it is what a sender can send for the bound.
  const auto nearest = [](std::optional<double> v) {
    return v ? std::optional(static_cast<double>(static_cast<float>(*v))) : std::nullopt;
  };
  return Bounds{nearest(field.range->low), nearest(field.range->high)}.contains(*number);
}

}  // namespace

std::string_view to_text(LimitState state) {
  switch (state) {
    case LimitState::none:
      return "none";
    case LimitState::green:
      return "green";
    case LimitState::yellow:
      return "yellow";
    case LimitState::red:
      return "red";
  }
  return "?";
}

std::string to_text(const Bounds& bounds) {
  // Whole numbers with all their digits, others as short as they read back the same.
  const auto number = [](double v) {
    return v == std::trunc(v) && std::abs(v) < 1e18 ? fmt::format("{:.0f}", v) : fmt::format("{}", v);
  };
  if (!bounds.low && !bounds.high) return "any";
  if (!bounds.high) return "at least " + number(*bounds.low);
  if (!bounds.low) return "at most " + number(*bounds.high);
  return number(*bounds.low) + " to " + number(*bounds.high);
}

std::size_t Field::max_size() const {
  if (type == FieldType::packet) return max_text;
  if (type == FieldType::parameter_value) return 256;
  return type == FieldType::text ? 1 + max_text : octets_of(type) * count;
}
std::size_t Structure::max_size() const {
  return size_of(fields);
}
bool Command::allowed_in(std::uint8_t mode) const {
  return std::find(modes.begin(), modes.end(), mode) != modes.end();
}

const ApplicationProcess* Dictionary::apid(std::uint16_t number) const {
  return find(apids_, [&](const auto& a) { return a.apid == number; });
}
std::vector<std::string> Dictionary::nodes() const {
  std::vector<const ApplicationProcess*> processes;
  for (const ApplicationProcess& process : apids_) {
    if (!process.added) processes.push_back(&process);
  }
  std::sort(processes.begin(), processes.end(),
            [](const auto* a, const auto* b) { return a->apid < b->apid; });
  std::vector<std::string> names;
  for (const ApplicationProcess* process : processes) names.push_back(process->node);
  return names;
}

std::optional<std::size_t> Dictionary::offset_of(const Structure& structure, std::string_view field) {
  std::size_t offset = 0;
  for (const Field& each : structure.fields) {
    if (each.name == field) return offset;
    const bool varies = octets_of(each.type) == 0;
    if (varies) return std::nullopt;
    offset += each.max_size();
  }
  return std::nullopt;
}

std::optional<TelemetryElement> Dictionary::telemetry(std::uint32_t number) const {
  const Structure* const from = structure(static_cast<std::uint16_t>(number >> 16U));
  std::size_t element = number & 0xFFFFU;
  if (from == nullptr) return std::nullopt;
  for (const Field& field : from->fields) {
    if (element < field.count) return TelemetryElement{from, &field, element};
    element -= field.count;
  }
  return std::nullopt;
}

std::optional<std::uint32_t> Dictionary::telemetry(std::string_view name) const {
  const auto dot = name.find('.');
  const Structure* const from = structure(name.substr(0, dot));
  if (from == nullptr || from->id == 0 || dot == std::string_view::npos) return std::nullopt;
  std::uint32_t number = static_cast<std::uint32_t>(from->id) << 16U;
  for (const Field& field : from->fields) {
    for (std::size_t i = 0; i < field.count; ++i, ++number) {
      if (element_name(field, i) == name.substr(dot + 1)) return number;
    }
  }
  return std::nullopt;
}

std::string Dictionary::telemetry_name(std::uint32_t number) const {
  const auto element = telemetry(number);
  return element ? element->structure->name + "." + element_name(*element->field, element->index) : "";
}

std::optional<double> Dictionary::take_number(const Field& field, OctetReader& in) {
  const auto raw = take_raw(field, in);
  if (!raw || !in.ok() || says_unknown(field, *raw)) return std::nullopt;
  const auto* truth = std::get_if<bool>(&*raw);
  const auto number = truth != nullptr ? std::optional(*truth ? 1.0 : 0.0) : as_number(*raw);
  if (!number || std::isnan(*number)) return std::nullopt;
  const double value = field.calibration.empty() ? *number : evaluate(field.calibration, *number);
  return std::isnan(value) ? std::nullopt : std::optional(value);
}

const ApplicationProcess* Dictionary::apid_of_node(std::string_view node) const {
  return find(apids_, [&](const auto& a) { return a.node == node; });
}
const Structure* Dictionary::structure(std::uint16_t id) const {
  return id == 0 ? nullptr : find(structures_, [&](const auto& s) { return s.id == id; });
}
const Structure* Dictionary::structure(std::string_view name) const {
  return find(structures_, [&](const auto& s) { return s.name == name; });
}
const Structure* Dictionary::report(std::uint8_t service, std::uint8_t subtype) const {
  return find(structures_, [&](const auto& s) {
    return s.kind == StructureKind::report && s.service == service && s.subtype == subtype;
  });
}
const Parameter* Dictionary::parameter(std::uint16_t id) const {
  return find(parameters_, [&](const auto& p) { return p.id == id; });
}
const Parameter* Dictionary::parameter(std::string_view name) const {
  return find(parameters_, [&](const auto& p) { return p.name == name; });
}
const Event* Dictionary::event(std::uint16_t id) const {
  return find(events_, [&](const auto& e) { return e.id == id; });
}
const Event* Dictionary::event(std::string_view name) const {
  return find(events_, [&](const auto& e) { return e.name == name; });
}
const PacketStore* Dictionary::store(std::uint16_t id) const {
  return find(stores_, [&](const auto& s) { return s.id == id; });
}
const PacketStore* Dictionary::store(std::string_view name) const {
  return find(stores_, [&](const auto& s) { return s.name == name; });
}
const FailureCode* Dictionary::failure_code(std::uint16_t code) const {
  return find(failure_codes_, [&](const auto& f) { return f.code == code; });
}
const Command* Dictionary::command(std::string_view name) const {
  return find(commands_, [&](const auto& c) { return c.name == name; });
}
const Command* Dictionary::function(std::uint16_t target, std::uint16_t function_id) const {
  return find(commands_, [&](const auto& c) {
    return c.is_function() && c.apid == target && c.function_id == function_id;
  });
}
const Command* Dictionary::request(std::uint16_t target, std::uint8_t service, std::uint8_t subtype) const {
  return find(commands_, [&](const auto& c) {
    return !c.is_function() && c.apid == target && c.service == service && c.subtype == subtype;
  });
}
bool Dictionary::has_service(std::uint16_t target, std::uint8_t service) const {
  return find(commands_, [&](const auto& c) { return c.apid == target && c.service == service; }) != nullptr;
}

namespace {

using GivenArguments = std::map<std::string, std::string, std::less<>>;

/// What is given for the arguments of a telecommand. Those of its groups may be lists, which make as many
/// groups ("id=1,2,3"); one value holds for all groups. A text or a packet, which may have a comma, is none.
class GivenGroups {
 public:
  static Result<GivenGroups, CommandError> of(const Command& command, GivenArguments given) {
    GivenGroups groups(std::move(given));
    if (!command.repeated) return groups;
    bool any = false;
    for (std::size_t i = command.head; i < command.arguments.size(); ++i) {
      const Field& field = command.arguments[i];
      const auto found = groups.given_.find(field.name);
      if (found == groups.given_.end()) continue;
      any = true;
      if (!may_be_list(field)) continue;
      std::vector<std::string>& list = groups.lists_[field.name];
      list = split(found->second);
      if (list.size() == 1 || list.size() == groups.count_) continue;
      if (groups.count_ != 1)
        return Err(CommandError{fmt::format("{}: argument '{}' has {} values, another one {}", command.name,
                                            field.name, list.size(), groups.count_)});
      groups.count_ = list.size();
    }
    if (!any && command.min_groups == 0) groups.count_ = 0;
    if (groups.count_ > command.max_groups)
      return Err(CommandError{
          fmt::format("{}: {} groups, at most {}", command.name, groups.count_, command.max_groups)});
    return groups;
  }

  [[nodiscard]] std::size_t count() const { return count_; }
  /// nullopt: it is missing.
  [[nodiscard]] std::optional<std::string> text(const Field& field, std::size_t group) const {
    if (const auto list = lists_.find(field.name); list != lists_.end())
      return list->second[list->second.size() == 1 ? 0 : group];
    if (const auto found = given_.find(field.name); found != given_.end()) return found->second;
    return field.has_default ? std::optional(field.default_text) : std::nullopt;
  }

 private:
  explicit GivenGroups(GivenArguments given) : given_(std::move(given)) {}
  [[nodiscard]] static bool may_be_list(const Field& field) {
    return field.type != FieldType::text && field.type != FieldType::packet &&
           field.type != FieldType::parameter_value;
  }
  [[nodiscard]] static std::vector<std::string> split(std::string_view text) {
    std::vector<std::string> parts;
    for (;;) {
      const std::size_t comma = text.find(',');
      parts.emplace_back(text.substr(0, comma));
      if (comma == std::string_view::npos) return parts;
      text.remove_prefix(comma + 1);
    }
  }

  GivenArguments given_;
  std::map<std::string, std::vector<std::string>, std::less<>> lists_;
  std::size_t count_ = 1;
};

}  // namespace

Result<EncodedCommand, CommandError> Dictionary::encode(std::string_view name,
                                                        const std::vector<std::string>& arguments) const {
  const Command* command = this->command(name);
  if (command == nullptr)
    return Err(CommandError{fmt::format("no telecommand is called '{}' (srfs-ground list shows all)", name)});
  GivenArguments given;
  for (const auto& argument : arguments) {
    const auto equals = argument.find('=');
    if (equals == std::string::npos)
      return Err(CommandError{fmt::format("{}: '{}' is not key=value", name, argument)});
    const std::string key = argument.substr(0, equals);
    if (find(command->arguments, [&](const auto& f) { return f.name == key; }) == nullptr) {
      std::vector<std::string> known;
      known.reserve(command->arguments.size());
      for (const auto& field : command->arguments) known.push_back(field.name);
      return Err(
          CommandError{fmt::format("{}: has no argument '{}', it has {}", name, key,
                                   known.empty() ? "none" : fmt::format("{}", fmt::join(known, ", ")))});
    }
    if (!given.emplace(key, argument.substr(equals + 1)).second) {
      return Err(CommandError{fmt::format("{}: argument '{}' is given twice", name, key)});
    }
  }
  const auto groups = GivenGroups::of(*command, std::move(given));
  if (!groups) return Err(groups.error());
  OctetWriter out(1024);
  const ArgumentText text(*this, *command);
  ParameterValues values(*this);
  const auto write = [&](std::size_t first, std::size_t end,
                         std::size_t group) -> Result<void, CommandError> {
    for (std::size_t index = first; index < end; ++index) {
      const Field& field = command->arguments[index];
      const auto written_text = groups->text(field, group);
      if (!written_text)
        return Err(CommandError{
            fmt::format("{}: argument '{}' is missing ({})", name, field.name, field.description)});
      const Field* const form = values.field_of(field);
      if (form == nullptr) return text.error(field, "no node parameter is named before it");
      const std::size_t begin = out.size();
      if (auto written = text.write(*form, *written_text, out); !written) return written;
      values.on_encoded(field, out.view().subspan(begin));
    }
    return {};
  };
  if (command->is_function()) out.u16(command->function_id);
  const std::size_t head = command->repeated ? command->head : 0;
  if (auto written = write(0, head, 0); !written) return Err(written.error());
  if (command->repeated) out.u16(static_cast<std::uint16_t>(groups->count()));
  for (std::size_t group = 0; group < groups->count(); ++group) {
    if (auto written = write(head, command->arguments.size(), group); !written) return Err(written.error());
  }
  return EncodedCommand{command, out.take()};
}

Result<void, ArgumentError> Dictionary::check_arguments(const Command& command, OctetView arguments) const {
  OctetReader in(arguments);
  ParameterValues values(*this);
  const auto check = [&](std::size_t first, std::size_t end) -> Result<void, ArgumentError> {
    for (std::size_t index = first; index < end; ++index) {
      const Field& argument = command.arguments[index];
      const ArgumentError bad{static_cast<std::uint8_t>(index + 1)};
      const Field* const form = values.field_of(argument);
      if (form == nullptr) return Err(bad);
      const Field& field = *form;
      for (std::size_t i = 0; i < field.count; ++i) {
        const auto value = take_raw(field, in);
        if (!in.ok()) return Err(ArgumentError{0});
        const bool bad_bool =
            field.type == FieldType::boolean && arguments[arguments.size() - in.remaining() - 1] > 1;
        if (!value || bad_bool || !is_allowed(*this, field, *value)) return Err(bad);
        values.on_value(argument, *value);
      }
    }
    return {};
  };
  if (auto head = check(0, command.head); !head) return head;
  const std::size_t groups = command.repeated ? in.u16() : 1;
  if (!in.ok() || groups < command.min_groups || groups > command.max_groups) return Err(ArgumentError{0});
  for (std::size_t group = 0; group < groups; ++group) {
    if (auto checked = check(command.head, command.arguments.size()); !checked) return checked;
  }
  if (in.remaining() != 0) return Err(ArgumentError{0});
  return {};
}

std::optional<Value> Dictionary::take_parameter(const Parameter& parameter, OctetReader& in) const {
  auto value = take_raw(parameter.field, in);
  if (!value || !in.ok() || !is_allowed(*this, parameter.field, *value)) return std::nullopt;
  return value;
}

bool Dictionary::put_parameter(const Parameter& parameter, const Value& value, OctetWriter& out) const {
  const Field& field = parameter.field;
  if (field.type == FieldType::text) {
    const auto* text = std::get_if<std::string>(&value);
    if (text == nullptr || text->size() > field.max_text) return false;
    detail::put_text(out, *text, field.max_text);
    return true;
  }
  if (field.type == FieldType::boolean) {
    const auto* truth = std::get_if<bool>(&value);
    if (truth == nullptr) return false;
    out.u8(*truth ? 1 : 0);
    return true;
  }
  if (is_float(field.type)) {
    const auto* number = std::get_if<double>(&value);
    if (number == nullptr) return false;
    field.type == FieldType::f64 ? out.f64(*number) : out.f32(static_cast<float>(*number));
    return true;
  }
  const auto integer = as_integer(value);
  if (!integer) return false;
  OctetWriter raw;
  raw.put(static_cast<std::uint64_t>(*integer), octets_of(field.type));
  OctetReader written(raw.view());
  const auto back = take_raw(field, written);
  if (!back || as_integer(*back) != integer) return false;
  out.bytes(raw.view());
  return true;
}

std::optional<std::vector<DecodedField>> Dictionary::decode(const std::vector<Field>& fields,
                                                            OctetView data) const {
  OctetReader in(data);
  std::vector<DecodedField> out;
  for (const auto& field : fields) {
    for (std::size_t i = 0; i < field.count; ++i) {
      auto value = take_raw(field, in);
      if (!value || !in.ok()) return std::nullopt;
      out.push_back(interpret(*this, field, i, std::move(*value)));
    }
  }
  if (in.remaining() != 0) return std::nullopt;
  return out;
}

std::optional<std::vector<DecodedField>> Dictionary::decode(const Structure& structure,
                                                            OctetView data) const {
  return decode(structure.fields, data);
}

std::string Dictionary::render(const Event& event, OctetView data) const {
  std::map<std::string, std::string, std::less<>> values;
  OctetReader in(data);
  for (const auto& field : event.fields) {
    auto value = take_raw(field, in);
    if (!value || !in.ok()) break;
    values[field.name] = interpret(*this, field, 0, std::move(*value)).text;
  }
  std::string text;
  std::string_view rest = event.text;
  while (!rest.empty()) {
    const auto open = rest.find('{');
    text += rest.substr(0, open);
    if (open == std::string_view::npos) break;
    const auto close = rest.find('}', open);
    if (close == std::string_view::npos) return text + std::string(rest.substr(open));
    const auto found = values.find(rest.substr(open + 1, close - open - 1));
    text += found == values.end() ? "?" : found->second;
    rest.remove_prefix(close + 1);
  }
  return text;
}

}  // namespace srfs::mission
