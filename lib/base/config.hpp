// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <yaml-cpp/yaml.h>

namespace srfs {

/// A configuration that cannot be used. what() names file, line, key, what was found and what was expected.
/// Thrown while configuring only and caught in one place (run_node, main of a tool).
class ConfigError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// One mapping of a YAML file, read strictly: every value is checked for its type and range, and finish()
/// refuses keys that were never asked for. Paths in messages look like "nodes[2].parameters.tick_period_ms".
/// A file with `extends: NAME` states what differs from NAME.yaml in the same folder, which may extend
/// another: mappings are merged, other values replace those of the other file, null removes one.
class ConfigSection {
 public:
  /// Reads the file and those that it extends. Throws ConfigError when one is missing, not YAML, not a
  /// mapping, or extends itself.
  static ConfigSection load(const std::filesystem::path& file);
  /// The same from text, for tests. @param name stands for the file's name in messages
  static ConfigSection parse(const std::string& text, const std::string& name);

  [[nodiscard]] bool has(std::string_view key) const;

  // Scalars. Without a fallback a missing key is an error.
  [[nodiscard]] std::string text(std::string_view key) const;
  [[nodiscard]] std::string text(std::string_view key, std::string fallback) const;
  [[nodiscard]] bool boolean(std::string_view key, bool fallback) const;
  [[nodiscard]] std::int64_t integer(std::string_view key, std::int64_t lowest, std::int64_t highest) const;
  [[nodiscard]] std::int64_t integer(std::string_view key, std::int64_t lowest, std::int64_t highest,
                                     std::int64_t fallback) const;
  [[nodiscard]] double number(std::string_view key, double lowest, double highest) const;
  [[nodiscard]] double number(std::string_view key, double lowest, double highest, double fallback) const;
  /// One of @p choices.
  [[nodiscard]] std::string choice(std::string_view key, const std::vector<std::string>& choices,
                                   std::string fallback) const;

  // Lists and sections. A missing list is empty; section() of a missing key is an empty section.
  [[nodiscard]] std::vector<std::string> texts(std::string_view key) const;
  [[nodiscard]] std::vector<std::int64_t> integers(std::string_view key, std::int64_t lowest,
                                                   std::int64_t highest) const;
  [[nodiscard]] ConfigSection section(std::string_view key) const;
  [[nodiscard]] std::vector<ConfigSection> sections(std::string_view key) const;
  /// All keys of this mapping, in file order, those of an extended file first; counts as asking for them
  /// (their own content is still checked by its reader).
  [[nodiscard]] std::vector<std::string> keys() const;
  /// The raw node, for values whose type depends on a declaration elsewhere (ROS parameters). Missing:
  /// undefined node. Mappings are not merged.
  [[nodiscard]] YAML::Node raw(std::string_view key) const;

  /// Throws ConfigError for keys of this mapping that were never asked for, naming the known ones.
  void finish() const;
  /// The error that @p key is not as @p expected.
  [[nodiscard]] ConfigError bad(std::string_view key, std::string_view expected) const;
  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] const std::string& file() const { return layers_.front().file; }
  /// The file, then those that it extends.
  [[nodiscard]] std::vector<std::string> files() const;

 private:
  struct Layer {
    YAML::Node node;
    std::string file;
  };
  ConfigSection(std::vector<Layer> layers, std::string path)
      : layers_(std::move(layers)), path_(std::move(path)) {}
  /// The value that counts, and its file. Undefined node: missing.
  [[nodiscard]] Layer find(std::string_view key) const;
  [[nodiscard]] YAML::Node get(std::string_view key) const { return find(key).node; }
  [[nodiscard]] YAML::Node need(std::string_view key, std::string_view expected) const;
  [[nodiscard]] std::string path_of(std::string_view key) const;

  std::vector<Layer> layers_;  // a file, then those that it extends; one at least
  std::string path_;
  mutable std::set<std::string, std::less<>> asked_;
};

}  // namespace srfs
