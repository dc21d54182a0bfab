// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/process.hpp"

namespace srfs::suite {

struct NodeProcess {
  std::string node;
  Process process;
};

/// Every process that the launcher started as a node of the suite of this VAR, by its command line: so that
/// one that holds no lock yet, because it is still being loaded, is found, too. A process between fork and
/// exec still has the command line of its starter and is not. Blocks as /proc does.
[[nodiscard]] std::vector<NodeProcess> node_processes(const std::filesystem::path& var);

/// The starters beside its nodes (starter.hpp).
[[nodiscard]] std::vector<Process> starter_processes(const std::filesystem::path& var);

}  // namespace srfs::suite
