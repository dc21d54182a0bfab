// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/package_draft.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "base/config.hpp"
#include "base/file.hpp"
#include "base/sha256.hpp"
#include "base/text.hpp"

namespace srfs::ground {
namespace {

namespace fs = std::filesystem;
using update::PackageLimits;
using Json = nlohmann::ordered_json;

constexpr std::uint64_t endless_s = 1'000'000'000;  // above what any manifest may say
constexpr std::int64_t longest_slot_ms = 60'000;
constexpr std::size_t entry_file_octets = 64U << 10;
constexpr std::size_t entry_values = 1000;
constexpr int entry_depth = 12;
constexpr std::size_t binary_octets = 256U << 20;
constexpr std::size_t folder_entries = 20'000;

using Files = std::map<std::string, Octets>;  // by their names in the package

fs::path plain(const fs::path& path) {
  return fs::absolute(path).lexically_normal();
}

/// The name of @p file in the package. No part of it below the root is a link, so what is signed is what lies
/// there.
Result<std::string, std::string> name_of(const fs::path& root, const fs::path& file) {
  const fs::path relative = plain(file).lexically_relative(plain(root));
  if (relative.empty() || *relative.begin() == ".." || relative == ".")
    return Err(fmt::format("{}: not below {}, so its name in the package is undefined", file.string(),
                           plain(root).string()));
  fs::path place = plain(root);
  for (const fs::path& part : relative) {
    place /= part;
    std::error_code error;
    if (fs::is_symlink(fs::symlink_status(place, error)))
      return Err(fmt::format("{}: {} is a link; a package contains regular files only", file.string(),
                             place.string()));
  }
  return relative.generic_string();
}

Result<void, std::string> add_file(const fs::path& root, const fs::path& file, Files& files) {
  std::error_code error;
  const auto type = fs::symlink_status(file, error).type();
  if (type == fs::file_type::not_found) return Err(fmt::format("{}: no such file", file.string()));
  const auto name = name_of(root, file);
  if (!name) return Err(name.error());
  if (type != fs::file_type::regular) return Err(fmt::format("{}: not a regular file", file.string()));
  if (!files.contains(*name) && files.size() == PackageLimits::files)
    return Err(fmt::format("more than {} files", PackageLimits::files));
  const auto content = read_file(file, PackageLimits::file_octets);
  if (!content) return Err(content.error().message);
  files[*name] = Octets(content->begin(), content->end());
  return {};
}

bool is_source(const fs::path& file) {
  const fs::path ending = file.extension();
  return ending == ".cpp" || ending == ".hpp" || ending == ".h";
}

Result<void, std::string> add_folder(const fs::path& root, const fs::path& folder, Files& files) {
  std::vector<fs::path> found;
  std::size_t seen = 0;
  std::error_code error;
  fs::recursive_directory_iterator entry(folder, error);
  for (; !error && entry != fs::recursive_directory_iterator(); entry.increment(error)) {
    if (++seen > folder_entries)
      return Err(fmt::format("{}: more than {} entries", folder.string(), folder_entries));
    if (entry->is_symlink())
      return Err(fmt::format("{}: a link; a package contains regular files only", entry->path().string()));
    if (entry->is_regular_file() && is_source(entry->path())) found.push_back(entry->path());
  }
  if (error) return Err(fmt::format("{}: {}", folder.string(), error.message()));
  if (found.empty()) return Err(fmt::format("{}: no .cpp, .hpp or .h below it", folder.string()));
  for (const fs::path& file : found) {
    if (auto added = add_file(root, file, files); !added) return added;
  }
  return {};
}

/// Unless it is named: the one folder of sources, else the present one.
fs::path root_of(const PackageDraft& draft) {
  if (!draft.root.empty()) return draft.root;
  const bool one_folder = draft.sources.size() == 1 && fs::is_directory(draft.sources.front());
  return one_folder ? draft.sources.front() : ".";
}

Result<Files, std::string> collect(const PackageDraft& draft) {
  if (draft.sources.empty()) return Err(std::string("no sources given (--sources)"));
  const fs::path root = root_of(draft);
  Files files;
  for (const std::string& source : draft.sources) {
    auto added = fs::is_directory(source) ? add_folder(root, source, files) : add_file(root, source, files);
    if (!added) return Err(added.error());
  }
  if (!draft.fragment.empty()) {
    if (auto added = add_file(root, draft.fragment, files); !added) return Err(added.error());
  }
  std::size_t total = 0;
  for (const auto& [name, content] : files) total += content.size();
  if (total > PackageLimits::package_octets)
    return Err(fmt::format("{} octets of sources; {} are allowed", total, PackageLimits::package_octets));
  return files;
}

/// A plain scalar as the number or truth it looks like; quoted ones are text.
Json to_json(const std::string& text, bool quoted) {
  if (quoted || text.empty()) return text;
  if (text == "true" || text == "false") return text == "true";
  if (const auto integer = to_number<std::int64_t>(text)) return *integer;
  if (const auto number = to_number<double>(text); number && std::isfinite(*number)) return *number;
  return text;
}

/// @param left  values that may still come: a few aliases can stand for very many
Result<Json, std::string> to_json(const YAML::Node& node, int depth, std::size_t& left) {
  if (depth > entry_depth || left == 0) return Err(std::string("too deep, or too much"));
  --left;
  if (node.IsScalar()) return to_json(node.Scalar(), node.Tag() == "!");
  if (node.IsSequence()) {
    Json list = Json::array();
    for (const YAML::Node& value : node) {
      auto json = to_json(value, depth + 1, left);
      if (!json) return json;
      list.push_back(std::move(*json));
    }
    return list;
  }
  if (!node.IsMap()) return Json();
  Json object = Json::object();
  for (const auto& entry : node) {
    auto json = to_json(entry.second, depth + 1, left);
    if (!json) return json;
    if (!entry.first.IsScalar()) return Err(std::string("a key that is not text"));
    object[entry.first.Scalar()] = std::move(*json);
  }
  return object;
}

Result<std::string, std::string> read_entry(const std::string& file, const std::string& node) {
  const auto text = read_file(file, entry_file_octets);
  if (!text) return Err(text.error().message);
  const auto section = ConfigSection::parse(*text, file);
  Json entry = Json::object();
  std::size_t left = entry_values;
  for (const std::string& key : section.keys()) {
    auto json = to_json(section.raw(key), 0, left);
    if (!json) return Err(fmt::format("{}: '{}': {}", file, key, json.error()));
    entry[key] = std::move(*json);
  }
  if (entry.contains("name") && entry["name"] != node)
    return Err(fmt::format("{}: 'name': expected '{}', the node of the package", file, node));
  return entry.dump(-1, ' ', false, Json::error_handler_t::replace);
}

update::SlotRequest read_slot(const ConfigSection& section) {
  update::SlotRequest slot;
  if (section.has("payload")) slot.payload = section.text("payload");
  slot.allotted = milliseconds(section.integer("allotted_ms", 1, longest_slot_ms));
  slot.overrun = milliseconds(section.integer("overrun_ms", 0, longest_slot_ms));
  slot.reset = milliseconds(section.integer("reset_ms", 1, longest_slot_ms));
  slot.after = section.text("after");
  section.finish();
  return slot;
}

PackageDraft read_draft(const ConfigSection& section, const fs::path& folder) {
  const auto beside = [&](const std::string& path) {
    return path.empty() ? path : (folder / path).lexically_normal().string();
  };
  const auto positive = [&](const char* key) -> std::optional<std::uint64_t> {
    if (!section.has(key)) return std::nullopt;
    return static_cast<std::uint64_t>(section.integer(key, 1, INT64_MAX));
  };
  PackageDraft draft;
  draft.node = section.text("node", "");
  draft.kind = section.text("kind", "");
  draft.counter = positive("counter");
  draft.root = beside(section.text("root", "."));
  for (const std::string& source : section.texts("sources")) draft.sources.push_back(beside(source));
  draft.options = section.texts("options");
  draft.self_test_s = positive("self_test_s");
  draft.probation_s = positive("probation_s");
  draft.ring_after = section.text("ring_after", "");
  draft.deployment_entry = beside(section.text("deployment_entry", ""));
  draft.fragment = beside(section.text("fragment", ""));
  draft.binary = beside(section.text("binary", ""));
  if (section.has("slot")) draft.slot = read_slot(section.section("slot"));
  section.finish();
  return draft;
}

Result<update::Manifest, std::string> read_manifest(const PackageDraft& draft) {
  update::Manifest manifest;
  if (draft.node.empty()) return Err(std::string("no node given (--node)"));
  manifest.node = draft.node;
  if (draft.kind != "replace" && draft.kind != "new")
    return Err(fmt::format("--kind: expected replace or new, found '{}'", draft.kind));
  manifest.kind = draft.kind == "new" ? update::PackageKind::add : update::PackageKind::replace;
  if (!draft.counter) return Err(std::string("no counter given (--counter): one more than the node's last"));
  manifest.counter = *draft.counter;
  manifest.options = draft.options.empty() ? std::vector<std::string>{"-O2"} : draft.options;
  const auto duration = [](std::uint64_t value_s) { return seconds(std::min(value_s, endless_s)); };
  if (draft.self_test_s) manifest.self_test = duration(*draft.self_test_s);
  if (draft.probation_s) manifest.probation = duration(*draft.probation_s);
  if (!draft.ring_after.empty()) manifest.ring_after = draft.ring_after;
  manifest.slot = draft.slot;
  if (manifest.kind == update::PackageKind::add && draft.deployment_entry.empty())
    return Err(std::string("a new node needs a deployment entry (--deployment-entry)"));
  if (manifest.kind == update::PackageKind::replace && !draft.deployment_entry.empty())
    return Err(std::string("a replaced node keeps its deployment entry; omit --deployment-entry"));
  if (!draft.deployment_entry.empty()) {
    auto entry = read_entry(draft.deployment_entry, draft.node);
    if (!entry) return Err(entry.error());
    manifest.deployment = std::move(*entry);
  }
  if (!draft.binary.empty()) {
    const auto binary = read_file(draft.binary, binary_octets);
    if (!binary) return Err(binary.error().message);
    manifest.binary_sha256 = to_digits(sha256_of(as_octets(*binary)));
  }
  return manifest;
}

}  // namespace

Result<PackageDraft, std::string> load_draft(const fs::path& file) {
  try {
    const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
    return read_draft(ConfigSection::load(file), folder);
  } catch (const ConfigError& error) {
    return Err(std::string(error.what()));
  }
}

PackageDraft merged(PackageDraft base, const PackageDraft& said) {
  const auto take = [](auto& own, const auto& other) {
    if (other != std::decay_t<decltype(other)>{}) own = other;
  };
  take(base.node, said.node);
  take(base.kind, said.kind);
  take(base.counter, said.counter);
  take(base.root, said.root);
  take(base.sources, said.sources);
  take(base.options, said.options);
  take(base.self_test_s, said.self_test_s);
  take(base.probation_s, said.probation_s);
  take(base.ring_after, said.ring_after);
  take(base.deployment_entry, said.deployment_entry);
  take(base.fragment, said.fragment);
  take(base.binary, said.binary);
  take(base.slot, said.slot);
  return base;
}

Result<Octets, std::string> make_package(const PackageDraft& draft, const update::SigningSeed& seed) {
  try {
    auto manifest = read_manifest(draft);
    if (!manifest) return Err(manifest.error());
    const auto files = collect(draft);
    if (!files) return Err(files.error());
    std::vector<Octets> contents;
    for (const auto& [name, content] : *files) {
      manifest->files.push_back({.path = name});
      contents.push_back(content);
    }
    if (!draft.fragment.empty()) {
      const auto name = name_of(root_of(draft), draft.fragment);
      if (!name) return Err(name.error());
      manifest->dictionary = *name;
    }
    auto package = update::make_package(std::move(*manifest), contents, seed);
    if (!package) return Err(update::to_text(package.error()));
    return std::move(*package);
  } catch (const ConfigError& error) {
    return Err(std::string(error.what()));
  } catch (const fs::filesystem_error& error) {
    return Err(std::string(error.what()));
  }
}

}  // namespace srfs::ground
