// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "mcap/message_definition.hpp"

#include <algorithm>
#include <sstream>

#include "base/file.hpp"
#include "mcap/message_line.hpp"

namespace srfs::mcap {
namespace {

constexpr std::size_t most_types = 256;
constexpr std::size_t most_octets = 1U << 20;

bool is_name(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(),
                                      [](unsigned char c) { return std::isalnum(c) != 0 || c == '_'; });
}

std::optional<std::string> text_of(const TypeName& type, const std::vector<std::filesystem::path>& folders) {
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
  std::vector<TypeName> types{{type.substr(0, first), type.substr(first + 5)}};
  std::string definition;
  for (std::size_t i = 0; i < types.size(); ++i) {  // grows while it runs
    const TypeName current = types[i];
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
      const auto field = field_of(line);
      if (!field || is_primitive(field->type)) continue;
      const TypeName used = type_name(field->type, current.package);
      if (std::find(types.begin(), types.end(), used) == types.end()) types.push_back(used);
    }
  }
  return definition;
}

}  // namespace srfs::mcap
