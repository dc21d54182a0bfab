// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "mcap/message_definition.hpp"

#include <algorithm>
#include <array>
#include <sstream>
#include <string_view>

#include "base/file.hpp"

namespace srfs::mcap {
namespace {

constexpr std::size_t most_types = 256;
constexpr std::size_t most_octets = 1U << 20;

struct Type {
  std::string package;
  std::string name;
  friend bool operator==(const Type&, const Type&) = default;
};

bool is_primitive(std::string_view type) {
  constexpr std::array<std::string_view, 17> primitives{
      "bool",  "byte",   "char",  "float32", "float64", "int8",    "uint8", "int16",   "uint16",
      "int32", "uint32", "int64", "uint64",  "string",  "wstring", "time",  "duration"};
  return std::find(primitives.begin(), primitives.end(), type) != primitives.end();
}

/// The type of a field's line: "geometry_msgs/Point[<=4] points  # where" is geometry_msgs/Point.
std::optional<Type> used_type(std::string_view line, const std::string& package) {
  line = line.substr(0, line.find('#'));
  const std::size_t begin = line.find_first_not_of(" \t\r");
  if (begin == std::string_view::npos) return std::nullopt;
  std::string_view word = line.substr(begin);
  word = word.substr(0, word.find_first_of(" \t\r"));
  word = word.substr(0, word.find_first_of("[<"));
  if (is_primitive(word)) return std::nullopt;
  const std::size_t first = word.find('/');
  if (first == std::string_view::npos) return Type{package, std::string(word)};
  return Type{std::string(word.substr(0, first)), std::string(word.substr(word.rfind('/') + 1))};
}

bool is_name(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(),
                                      [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; });
}

std::optional<std::string> text_of(const Type& type, const std::vector<std::filesystem::path>& folders) {
  if (!is_name(type.package) || !is_name(type.name)) return std::nullopt;
  for (const auto& folder : folders) {
    const auto text = read_file(folder / type.package / "msg" / (type.name + ".msg"), most_octets);
    if (text) return *text;
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::string> message_definition(const std::string& type,
                                              const std::vector<std::filesystem::path>& folders) {
  const std::size_t first = type.find("/msg/");
  if (first == std::string::npos) return std::nullopt;
  std::vector<Type> types{{type.substr(0, first), type.substr(first + 5)}};
  std::string definition;
  for (std::size_t i = 0; i < types.size(); ++i) {  // grows while it runs
    const Type current = types[i];
    const auto text = text_of(current, folders);
    if (!text || types.size() > most_types) return std::nullopt;
    if (i > 0) {
      definition.append(80, '=').append("\nMSG: ");
      definition.append(current.package).append("/").append(current.name).append("\n");
    }
    definition.append(*text);
    if (!definition.ends_with('\n')) definition.push_back('\n');
    std::istringstream lines(*text);
    for (std::string line; std::getline(lines, line);) {
      const auto used = used_type(line, current.package);
      if (used && std::find(types.begin(), types.end(), *used) == types.end()) types.push_back(*used);
    }
  }
  return definition;
}

}  // namespace srfs::mcap
