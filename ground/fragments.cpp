// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/fragments.hpp"

#include <algorithm>
#include <set>

#include "base/file.hpp"
#include "ground/dictionary_cache.hpp"
#include "suite/added_nodes.hpp"

namespace srfs::ground {
namespace {

std::vector<std::filesystem::path> files_of(const std::filesystem::path& folder) {
  std::vector<std::filesystem::path> files;
  std::error_code ec;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ec)) {
    if (entry.path().extension() == ".yaml") files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

}  // namespace

Result<mission::Dictionary, std::string> load_dictionary(const std::filesystem::path& dictionary,
                                                         const FragmentSources& sources,
                                                         const std::filesystem::path& cache,
                                                         std::vector<std::string>& warnings) {
  std::vector<mission::Fragment> fragments;
  std::set<std::string> nodes;
  const auto take = [&](mission::Fragment fragment) {
    const auto node = fragment.node();
    if (!node || nodes.insert(*node).second) fragments.push_back(std::move(fragment));
  };
  for (const auto& file : sources.files) {
    auto text = read_file(file, mission::Fragment::octets_max);
    if (!text) return Err(text.error().message);
    take({file.string(), std::move(*text)});
  }
  const std::size_t named = fragments.size();
  for (const auto& file : files_of(sources.folder)) {
    auto text = read_file(file, mission::Fragment::octets_max);
    if (text) {
      take({file.string(), std::move(*text)});
    } else {
      warnings.push_back(text.error().message);
    }
  }
  const auto added = suite::read_added_nodes(suite::VarPaths{sources.var});
  if (!added.damage.empty()) warnings.push_back(added.damage);
  for (const suite::AddedNode& node : added.added.nodes) {
    if (!node.dictionary.empty()) take({"fragment of " + node.name, node.dictionary});
  }
  const DictionaryCache kept(cache, dictionary, fragments);
  if (auto known = kept.load()) return std::move(*known);
  try {
    std::vector<mission::RefusedFragment> refused;
    mission::Dictionary loaded = mission::Dictionary::load_fitting(dictionary, fragments, refused);
    for (const mission::RefusedFragment& one : refused) {
      const auto was_named =
          std::any_of(fragments.begin(), fragments.begin() + static_cast<std::ptrdiff_t>(named),
                      [&](const mission::Fragment& fragment) { return fragment.name == one.name; });
      if (was_named) return Err(one.why);
      warnings.push_back(one.why);
    }
    if (refused.empty()) kept.keep(loaded);
    return loaded;
  } catch (const ConfigError& e) {
    return Err(std::string(e.what()));
  }
}

}  // namespace srfs::ground
