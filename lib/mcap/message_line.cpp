// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "mcap/message_line.hpp"

#include <algorithm>
#include <array>

namespace srfs::mcap {
namespace {

constexpr std::string_view blank = " \t\r";

/// The first word of the text; the text then begins behind it.
std::string_view take_word(std::string_view& text) {
  text.remove_prefix(std::min(text.find_first_not_of(blank), text.size()));
  const std::string_view word = text.substr(0, text.find_first_of(blank));
  text.remove_prefix(word.size());
  return word;
}

}  // namespace

std::optional<MessageLine> field_of(std::string_view line) {
  line = line.substr(0, line.find('#'));
  const std::string_view type = take_word(line);
  if (type.empty() || line.find('=') != std::string_view::npos) return std::nullopt;  // as rosidl decides
  const std::string_view name = take_word(line);
  if (name.empty()) return std::nullopt;
  const std::size_t array = type.ends_with(']') ? type.rfind('[') : std::string_view::npos;
  return MessageLine{.type = type.substr(0, type.find_first_of("[<")),
                     .array = array == std::string_view::npos ? std::string_view() : type.substr(array),
                     .name = name};
}

bool is_primitive(std::string_view type) {
  constexpr std::array<std::string_view, 17> primitives{
      "bool",  "byte",   "char",  "float32", "float64", "int8",    "uint8", "int16",   "uint16",
      "int32", "uint32", "int64", "uint64",  "string",  "wstring", "time",  "duration"};
  return std::find(primitives.begin(), primitives.end(), type) != primitives.end();
}

TypeName type_name(std::string_view type, const std::string& package) {
  const std::size_t first = type.find('/');
  if (first == std::string_view::npos) return {package, std::string(type)};
  return {std::string(type.substr(0, first)), std::string(type.substr(type.rfind('/') + 1))};
}

}  // namespace srfs::mcap
