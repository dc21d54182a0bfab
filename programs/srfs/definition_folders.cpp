// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/definition_folders.hpp"

#include <cstdlib>
#include <sstream>

#include "suite/launcher.hpp"

namespace srfs::tool {

namespace fs = std::filesystem;

std::vector<fs::path> definition_folders(const std::vector<std::string>& named) {
  std::vector<fs::path> folders(named.begin(), named.end());
  folders.push_back(suite::suite_bin_folder().parent_path() / "share/srfs/interfaces");
  folders.emplace_back(SRFS_SOURCE_DIR "/msgs");
  folders.emplace_back(SRFS_SOURCE_DIR "/msgs/interfaces");
  const char* prefixes = std::getenv("AMENT_PREFIX_PATH");
  std::istringstream list(prefixes != nullptr ? prefixes : "");
  for (std::string prefix; std::getline(list, prefix, ':');) {
    if (!prefix.empty()) folders.push_back(fs::path(prefix) / "share");
  }
  return folders;
}

}  // namespace srfs::tool
