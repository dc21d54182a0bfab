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

YAML::Node value_of(const YAML::Node& mapping, std::string_view key) {
  return mapping.IsMap() ? mapping[std::string(key)] : YAML::Node(YAML::NodeType::Undefined);
}

}  // namespace

ConfigSection ConfigSection::load(const std::filesystem::path& file) {
  std::vector<Layer> layers;
  std::filesystem::path next = file;
  while (true) {
    const auto content = read_file(next);
    if (!content) throw ConfigError(content.error().message);
    const ConfigSection one = parse(*content, next.string());
    layers.push_back(one.layers_.front());
    if (!one.has("extends")) break;
    const std::string name = one.text("extends");
    next.replace_filename(name + ".yaml");
    std::error_code ec;
    if (name.find('/') != std::string::npos || !std::filesystem::is_regular_file(next, ec))
      throw one.bad("extends",
                    fmt::format("the name of a file in this folder, without .yaml ({})", next.string()));
    for (const Layer& layer : layers)
      if (layer.file == next.string()) throw one.bad("extends", "a file that does not extend this one");
  }
  ConfigSection root(std::move(layers), "");
  root.asked_.emplace("extends");
  return root;
}

ConfigSection ConfigSection::parse(const std::string& text, const std::string& name) {
  try {
    YAML::Node node = YAML::Load(text);
    if (node.IsNull()) node = YAML::Node(YAML::NodeType::Map);
    if (!node.IsMap())
      throw ConfigError(fmt::format("{}: expected a mapping at the top, found {}", name, found(node)));
    return ConfigSection({{node, name}}, "");
  } catch (const YAML::Exception& e) {
    throw ConfigError(fmt::format("{}:{}: not valid YAML: {}", name, e.mark.line + 1, e.msg));
  }
}

std::vector<std::string> ConfigSection::files() const {
  std::vector<std::string> names;
  for (const Layer& layer : layers_) names.push_back(layer.file);
  return names;
}

std::string ConfigSection::path_of(std::string_view key) const {
  return fmt::format("{}{}{}", path_, path_.empty() ? "" : ".", key);
}

ConfigError ConfigSection::bad(std::string_view key, std::string_view expected) const {
  const Layer value = find(key);
  const int line = (value.node.IsDefined() ? value.node : layers_.front().node).Mark().line + 1;
  return ConfigError(fmt::format("{}:{}: '{}': expected {}, found {}", value.file, line, path_of(key),
                                 expected, found(value.node)));
}

ConfigSection::Layer ConfigSection::find(std::string_view key) const {
  asked_.emplace(key);
  for (const Layer& layer : layers_) {
    const YAML::Node value = value_of(layer.node, key);
    const bool removes = value.IsDefined() && value.IsNull() && &layer != &layers_.back();
    if (removes) break;
    if (value.IsDefined()) return {value, layer.file};
  }
  return {YAML::Node(YAML::NodeType::Undefined), file()};
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
  const YAML::Node first = get(key);
  if (first.IsDefined() && !first.IsNull() && !first.IsMap()) throw bad(key, "a mapping");
  std::vector<Layer> merged;
  for (const Layer& layer : layers_) {
    const YAML::Node value = value_of(layer.node, key);
    if (!value.IsDefined()) continue;
    if (!value.IsMap()) break;
    merged.push_back({value, layer.file});
  }
  if (merged.empty()) merged.push_back({YAML::Node(YAML::NodeType::Map), file()});
  return {std::move(merged), path_of(key)};
}

std::vector<ConfigSection> ConfigSection::sections(std::string_view key) const {
  std::vector<ConfigSection> all;
  if (!has(key)) return all;
  const Layer list = find(key);
  if (!list.node.IsSequence()) throw bad(key, "a list of mappings");
  for (std::size_t i = 0; i < list.node.size(); ++i) {
    const YAML::Node item = list.node[i];
    if (!item.IsMap()) throw bad(key, "a list of mappings");
    all.push_back(ConfigSection({{item, list.file}}, fmt::format("{}[{}]", path_of(key), all.size())));
  }
  return all;
}

std::vector<std::string> ConfigSection::keys() const {
  std::vector<std::string> names;
  for (auto layer = layers_.rbegin(); layer != layers_.rend(); ++layer) {
    if (!layer->node.IsMap()) continue;
    for (const auto& entry : layer->node) {
      const std::string& name = entry.first.Scalar();
      if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
    }
  }
  std::erase_if(names, [&](const std::string& name) { return !has(name); });
  return names;
}

YAML::Node ConfigSection::raw(std::string_view key) const {
  return get(key);
}

void ConfigSection::finish() const {
  for (const Layer& layer : layers_) {
    if (!layer.node.IsMap()) continue;
    for (const auto& entry : layer.node) {
      const std::string key = entry.first.Scalar();
      if (asked_.contains(key)) continue;
      throw ConfigError(fmt::format("{}:{}: '{}': unknown key, expected one of {}", layer.file,
                                    entry.first.Mark().line + 1, path_of(key), fmt::join(asked_, ", ")));
    }
  }
}

}  // namespace srfs
