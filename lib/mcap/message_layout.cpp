// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "mcap/message_layout.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "mcap/message_line.hpp"

namespace srfs::mcap {
namespace {

using Json = nlohmann::ordered_json;
using Field = MessageLayout::Field;
using Message = MessageLayout::Message;
using Primitive = MessageLayout::Primitive;

constexpr std::size_t deepest = 32;  // parts of parts

std::optional<Primitive> primitive_of(std::string_view type) {
  static const std::map<std::string_view, Primitive> primitives{
      {"bool", Primitive::boolean}, {"byte", Primitive::octet},  {"char", Primitive::octet},
      {"uint8", Primitive::octet},  {"int8", Primitive::i8},     {"int16", Primitive::i16},
      {"int32", Primitive::i32},    {"int64", Primitive::i64},   {"uint16", Primitive::u16},
      {"uint32", Primitive::u32},   {"uint64", Primitive::u64},  {"float32", Primitive::f32},
      {"float64", Primitive::f64},  {"string", Primitive::text}, {"wstring", Primitive::wide_text}};
  const auto found = primitives.find(type);
  return found == primitives.end() ? std::nullopt : std::optional(found->second);
}

/// The sections of a definition by type: "package/Name" -> its lines.
std::map<std::string, std::string_view> sections_of(const std::string& own, std::string_view definition) {
  static const std::string separator = std::string(80, '=') + "\nMSG: ";
  std::map<std::string, std::string_view> sections;
  std::string name = own;
  while (true) {
    const std::size_t end = definition.find(separator);
    sections.emplace(name, definition.substr(0, end));
    if (end == std::string_view::npos) return sections;
    definition.remove_prefix(end + separator.size());
    const std::size_t line = std::min(definition.find('\n'), definition.size());
    const TypeName type = type_name(definition.substr(0, line), "");
    name = type.package + "/" + type.name;
    definition.remove_prefix(std::min(line + 1, definition.size()));
  }
}

/// Why a definition is none.
struct WrongDefinition {
  std::string why;
};

/// Builds the layouts of a type and its parts; throws WrongDefinition.
class Parser {
 public:
  Parser(const std::string& own, std::string_view definition) : sections_(sections_of(own, definition)) {}

  /// @return its index
  std::size_t add(const TypeName& type, std::size_t depth) {
    const std::string name = type.package + "/" + type.name;
    if (const auto known = indices_.find(name); known != indices_.end()) {
      if (!known->second) throw WrongDefinition{name + " has itself as a part"};
      return *known->second;
    }
    const auto section = sections_.find(name);
    if (section == sections_.end()) throw WrongDefinition{"the definition lacks " + name};
    if (depth > deepest) throw WrongDefinition{name + " is too deep inside"};
    indices_[name] = std::nullopt;  // under way
    Message message;
    for (std::string_view text = section->second; !text.empty();) {
      const std::size_t end = std::min(text.find('\n'), text.size());
      if (const auto line = field_of(text.substr(0, end)))
        message.push_back(field(*line, type.package, depth));
      text.remove_prefix(std::min(end + 1, text.size()));
    }
    messages_.push_back(std::move(message));
    indices_[name] = messages_.size() - 1;
    return messages_.size() - 1;
  }
  std::vector<Message> take() { return std::move(messages_); }

 private:
  Field field(const MessageLine& line, const std::string& package, std::size_t depth) {
    Field field;
    field.name = std::string(line.name);
    if (const auto primitive = primitive_of(line.type)) {
      field.primitive = *primitive;
    } else {
      if (is_primitive(line.type)) throw WrongDefinition{fmt::format("{} is no type of ROS 2", line.type)};
      field.primitive = Primitive::message;
      field.message = add(type_name(line.type, package), depth + 1);
    }
    field.is_array = !line.array.empty();
    if (field.is_array && line.array != "[]" && !line.array.starts_with("[<=")) {
      std::size_t length = 0;
      const char* const last = line.array.data() + line.array.size() - 1;
      const auto [end, error] = std::from_chars(line.array.data() + 1, last, length);
      if (error != std::errc() || end != last || length == 0)
        throw WrongDefinition{fmt::format("'{}' is no length of an array", line.array)};
      field.length = length;
    }
    return field;
  }

  std::map<std::string, std::string_view> sections_;
  std::map<std::string, std::optional<std::size_t>> indices_;
  std::vector<Message> messages_;
};

/// Reads plain CDR (OMG DDS-XTypes 1.3, 7.4.1); throws EndOfSample.
struct EndOfSample {};
class Cdr {
 public:
  Cdr(OctetView body, bool little_endian) : body_(body), little_endian_(little_endian) {}

  template <class T>
  T number() {
    used_ = (used_ + sizeof(T) - 1) / sizeof(T) * sizeof(T);
    const OctetView octets = take(sizeof(T));
    std::uint64_t bits = 0;
    for (std::size_t i = 0; i < sizeof(T); ++i)
      bits = bits << 8U | octets[little_endian_ ? sizeof(T) - 1 - i : i];
    if constexpr (std::is_same_v<T, float>) {
      return std::bit_cast<float>(static_cast<std::uint32_t>(bits));
    } else if constexpr (std::is_same_v<T, double>) {
      return std::bit_cast<double>(bits);
    } else {
      return static_cast<T>(bits);
    }
  }
  OctetView take(std::size_t count) {
    if (used_ > body_.size() || count > body_.size() - used_) throw EndOfSample();
    used_ += count;
    return body_.subspan(used_ - count, count);
  }
  [[nodiscard]] std::size_t left() const { return body_.size() - std::min(used_, body_.size()); }

 private:
  OctetView body_;
  bool little_endian_;
  std::size_t used_ = 0;
};

std::string text(Cdr& cdr) {
  const auto length = cdr.number<std::uint32_t>();  // with the NUL at its end
  const OctetView octets = cdr.take(length);
  return {reinterpret_cast<const char*>(octets.data()), length == 0 ? 0 : length - std::size_t{1}};
}

void append_utf8(std::string& out, std::uint32_t code) {
  if (code < 0x80) {
    out += static_cast<char>(code);
  } else if (code < 0x800) {
    out += static_cast<char>(0xc0U | code >> 6U);
    out += static_cast<char>(0x80U | (code & 0x3fU));
  } else if (code < 0x10000) {
    out += static_cast<char>(0xe0U | code >> 12U);
    out += static_cast<char>(0x80U | (code >> 6U & 0x3fU));
    out += static_cast<char>(0x80U | (code & 0x3fU));
  } else {
    out += static_cast<char>(0xf0U | (code >> 18U & 0x07U));
    out += static_cast<char>(0x80U | (code >> 12U & 0x3fU));
    out += static_cast<char>(0x80U | (code >> 6U & 0x3fU));
    out += static_cast<char>(0x80U | (code & 0x3fU));
  }
}

/// Units of UTF-16, each in four octets; a surrogate without its other half becomes what is not UTF-8.
std::string wide_text(Cdr& cdr) {
  const auto length = cdr.number<std::uint32_t>();
  if (length > cdr.left() / 4) throw EndOfSample();
  std::string out;
  std::uint32_t high = 0;
  for (std::uint32_t i = 0; i < length; ++i) {
    const auto unit = cdr.number<std::uint32_t>();
    if (high != 0 && unit >= 0xdc00 && unit < 0xe000) {
      append_utf8(out, 0x10000 + ((high - 0xd800) << 10U) + (unit - 0xdc00));
      high = 0;
      continue;
    }
    if (high != 0) append_utf8(out, high);
    high = unit >= 0xd800 && unit < 0xdc00 ? unit : 0;
    if (high == 0) append_utf8(out, unit);
  }
  if (high != 0) append_utf8(out, high);
  return out;
}

/// With as few digits as tell it from its neighbours: 0.1, not 0.10000000149011612.
template <class F>
Json shortest(F value) {
  if (!std::isfinite(value)) return nullptr;
  const std::string digits = fmt::format("{}", value);
  double same = 0;
  std::from_chars(digits.data(), digits.data() + digits.size(), same);
  return same;
}

class SampleReader {
 public:
  SampleReader(const std::vector<Message>& messages, Cdr cdr, std::size_t most)
      : messages_(messages), cdr_(cdr), most_(most) {}

  Json message(const Message& layout) {
    Json json = Json::object();
    if (layout.empty()) cdr_.take(std::min<std::size_t>(cdr_.left(), 1));  // as an empty struct is written
    for (const Field& field : layout) json[field.name] = field.is_array ? array(field) : value(field);
    return json;
  }

 private:
  Json array(const Field& field) {
    const std::size_t length = field.length ? *field.length : cdr_.number<std::uint32_t>();
    Json json = Json::array();
    for (std::size_t i = 0; i < length; ++i) {
      if (cdr_.left() == 0) throw EndOfSample();
      Json element = value(field);
      if (i < most_) json.push_back(std::move(element));
    }
    if (length > most_) json.push_back("...");
    return json;
  }

  Json value(const Field& field) {
    switch (field.primitive) {
      case Primitive::boolean:
        return cdr_.number<std::uint8_t>() != 0;
      case Primitive::octet:
        return cdr_.number<std::uint8_t>();
      case Primitive::i8:
        return cdr_.number<std::int8_t>();
      case Primitive::i16:
        return cdr_.number<std::int16_t>();
      case Primitive::i32:
        return cdr_.number<std::int32_t>();
      case Primitive::i64:
        return cdr_.number<std::int64_t>();
      case Primitive::u16:
        return cdr_.number<std::uint16_t>();
      case Primitive::u32:
        return cdr_.number<std::uint32_t>();
      case Primitive::u64:
        return cdr_.number<std::uint64_t>();
      case Primitive::f32:
        return shortest(cdr_.number<float>());
      case Primitive::f64:
        return shortest(cdr_.number<double>());
      case Primitive::text:
        return text(cdr_);
      case Primitive::wide_text:
        return wide_text(cdr_);
      case Primitive::message:
        return message(messages_[field.message]);
    }
    return nullptr;
  }

  const std::vector<Message>& messages_;
  Cdr cdr_;
  std::size_t most_;
};

}  // namespace

Result<MessageLayout, std::string> MessageLayout::parse(const std::string& type,
                                                        std::string_view definition) {
  const TypeName own = type_name(type, "");
  try {
    Parser parser(own.package + "/" + own.name, definition);
    parser.add(own, 0);
    return MessageLayout(parser.take());
  } catch (const WrongDefinition& wrong) {
    return Err(wrong.why);
  }
}

std::optional<std::string> MessageLayout::to_json(OctetView sample, std::size_t most) const {
  constexpr std::size_t encapsulation = 4;
  if (sample.size() < encapsulation || sample[0] != 0 || sample[1] > 1) return std::nullopt;
  try {
    SampleReader reader(messages_, Cdr(sample.subspan(encapsulation), sample[1] == 1), most);
    return reader.message(messages_.back()).dump(-1, ' ', false, Json::error_handler_t::replace);
  } catch (const EndOfSample&) {
    return std::nullopt;
  }
}

}  // namespace srfs::mcap
