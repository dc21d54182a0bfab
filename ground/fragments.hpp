// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs::ground {

/// Where dictionary fragments of added nodes are looked for. A node's first fragment counts.
struct FragmentSources {
  std::vector<std::filesystem::path> files;  ///< named by the operator: each must fit
  std::filesystem::path folder;              ///< every *.yaml of it
  std::filesystem::path var;                 ///< a VAR of the simulation: its list of added nodes
};

/// The mission dictionary with the fragments that are found. Blocks on the disk.
/// @param warnings  what of folder and VAR is not used, ready to print
/// @param cache  file of a DictionaryCache
/// @return why it cannot be used, ready to print
[[nodiscard]] Result<mission::Dictionary, std::string> load_dictionary(
    const std::filesystem::path& dictionary, const FragmentSources& sources,
    const std::filesystem::path& cache, std::vector<std::string>& warnings);

}  // namespace srfs::ground
