// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/config.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/file.hpp"

namespace srfs {
namespace {

std::string found(const YAML::Node& node) {
  if (!node.IsDefined()) return "nothing";
  switch (node.Type()) {
    case YAML::NodeType::Null:
      return "null";
    case YAML::NodeType::Scalar:
      return fmt::format("'{}'", node.Scalar());
    case YAML::NodeType::Sequence:
      return "a list";
    case YAML::NodeType::Map:
      return "a mapping";
    case YAML::NodeType::Undefined:
      break;
  }
  return "nothing";
}

}  // namespace

ConfigSection::ConfigSection(const YAML::Node& node, std::string file, std::string path)
    : node_(node), file_(std::move(file)), path_(std::move(path)) {}

ConfigSection ConfigSection::load(const std::filesystem::path& file) {
  const auto content = read_file(file);
  if (!content) throw ConfigError(content.error().message);
  return parse(*content, file.string());
}

ConfigSection ConfigSection::parse(const std::string& text, const std::string& name) {
  try {
    YAML::Node node = YAML::Load(text);
    if (node.IsNull()) node = YAML::Node(YAML::NodeType::Map);
    if (!node.IsMap())
      throw ConfigError(fmt::format("{}: expected a mapping at the top, found {}", name, found(node)));
    return {node, name, ""};
  } catch (const YAML::Exception& e) {
    throw ConfigError(fmt::format("{}:{}: not valid YAML: {}", name, e.mark.line + 1, e.msg));
  }
}

ConfigError ConfigSection::bad(std::string_view key, std::string_view expected) const {
  const YAML::Node node = get(key);
  const int line = (node.IsDefined() ? node : node_).Mark().line + 1;
  return ConfigError(fmt::format("{}:{}: '{}{}{}': expected {}, found {}", file_, line, path_,
                                 path_.empty() ? "" : ".", key, expected, found(node)));
}

YAML::Node ConfigSection::get(std::string_view key) const {
  asked_.emplace(key);
  const YAML::Node& constant = node_;
  return constant.IsMap() ? constant[std::string(key)] : YAML::Node(YAML::NodeType::Undefined);
}

YAML::Node ConfigSection::need(std::string_view key, std::string_view expected) const {
  const YAML::Node node = get(key);
  if (!node.IsDefined()) throw bad(key, expected);
  return node;
}

bool ConfigSection::has(std::string_view key) const {
  return get(key).IsDefined();
}

std::string ConfigSection::text(std::string_view key) const {
  const YAML::Node node = need(key, "text");
  if (!node.IsScalar()) throw bad(key, "text");
  return node.Scalar();
}

std::string ConfigSection::text(std::string_view key, std::string fallback) const {
  return has(key) ? text(key) : std::move(fallback);
}

bool ConfigSection::boolean(std::string_view key, bool fallback) const {
  if (!has(key)) return fallback;
  bool value = false;
  if (!YAML::convert<bool>::decode(get(key), value)) throw bad(key, "true or false");
  return value;
}

std::int64_t ConfigSection::integer(std::string_view key, std::int64_t lowest, std::int64_t highest) const {
  const std::string expected = fmt::format("an integer from {} to {}", lowest, highest);
  std::int64_t value = 0;
  if (!YAML::convert<std::int64_t>::decode(need(key, expected), value) || value < lowest || value > highest) {
    throw bad(key, expected);
  }
  return value;
}

std::int64_t ConfigSection::integer(std::string_view key, std::int64_t lowest, std::int64_t highest,
                                    std::int64_t fallback) const {
  return has(key) ? integer(key, lowest, highest) : fallback;
}

double ConfigSection::number(std::string_view key, double lowest, double highest) const {
  const std::string expected = fmt::format("a number from {} to {}", lowest, highest);
  double value = 0;
  if (!YAML::convert<double>::decode(need(key, expected), value) || !(value >= lowest && value <= highest))
    throw bad(key, expected);
  return value;
}

double ConfigSection::number(std::string_view key, double lowest, double highest, double fallback) const {
  return has(key) ? number(key, lowest, highest) : fallback;
}

std::string ConfigSection::choice(std::string_view key, const std::vector<std::string>& choices,
                                  std::string fallback) const {
  std::string value = text(key, std::move(fallback));
  if (std::find(choices.begin(), choices.end(), value) == choices.end()) {
    throw bad(key, fmt::format("one of {}", fmt::join(choices, ", ")));
  }
  return value;
}

std::vector<std::string> ConfigSection::texts(std::string_view key) const {
  std::vector<std::string> values;
  if (!has(key)) return values;
  const YAML::Node node = get(key);
  if (!node.IsSequence()) throw bad(key, "a list of strings");
  for (const auto& item : node) {
    if (!item.IsScalar()) throw bad(key, "a list of strings");
    values.push_back(item.Scalar());
  }
  return values;
}

std::vector<std::int64_t> ConfigSection::integers(std::string_view key, std::int64_t lowest,
                                                  std::int64_t highest) const {
  const std::string expected = fmt::format("a list of integers from {} to {}", lowest, highest);
  std::vector<std::int64_t> values;
  if (!has(key)) return values;
  const YAML::Node node = get(key);
  if (!node.IsSequence()) throw bad(key, expected);
  for (const auto& item : node) {
    std::int64_t value = 0;
    if (!YAML::convert<std::int64_t>::decode(item, value) || value < lowest || value > highest)
      throw bad(key, expected);
    values.push_back(value);
  }
  return values;
}

ConfigSection ConfigSection::section(std::string_view key) const {
  YAML::Node node = has(key) ? get(key) : YAML::Node(YAML::NodeType::Map);
  if (node.IsNull()) node = YAML::Node(YAML::NodeType::Map);
  if (!node.IsMap()) throw bad(key, "a mapping");
  return {node, file_, fmt::format("{}{}{}", path_, path_.empty() ? "" : ".", key)};
}

std::vector<ConfigSection> ConfigSection::sections(std::string_view key) const {
  std::vector<ConfigSection> all;
  if (!has(key)) return all;
  const YAML::Node node = get(key);
  if (!node.IsSequence()) throw bad(key, "a list of mappings");
  for (std::size_t i = 0; i < node.size(); ++i) {
    const YAML::Node item = node[i];
    if (!item.IsMap()) throw bad(key, "a list of mappings");
    all.push_back(ConfigSection(item, file_,
                                fmt::format("{}{}{}[{}]", path_, path_.empty() ? "" : ".", key, all.size())));
  }
  return all;
}

std::vector<std::string> ConfigSection::keys() const {
  std::vector<std::string> names;
  if (!node_.IsMap()) return names;
  for (const auto& entry : node_) {
    names.push_back(entry.first.Scalar());
    asked_.insert(entry.first.Scalar());
  }
  return names;
}

YAML::Node ConfigSection::raw(std::string_view key) const {
  return get(key);
}

void ConfigSection::finish() const {
  if (!node_.IsMap()) return;
  for (const auto& entry : node_) {
    const std::string key = entry.first.Scalar();
    if (asked_.contains(key)) continue;
    throw ConfigError(fmt::format("{}:{}: '{}{}{}': unknown key, expected one of {}", file_,
                                  entry.first.Mark().line + 1, path_, path_.empty() ? "" : ".", key,
                                  fmt::join(asked_, ", ")));
  }
}

}  // namespace srfs
