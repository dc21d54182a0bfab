// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include <mission/structures.hpp>

#include "suite/deployment.hpp"
#include "suite/instance.hpp"
#include "update/scrubber.hpp"

namespace srfs {

/// Where the suite is installed.
struct Installation {
  std::filesystem::path bin_folder;
  std::filesystem::path library_folder;
  std::vector<std::filesystem::path> dictionary;  ///< its files
};

/// What must not rot: the golden programs of all nodes, `srfs` and `srfs-lane`, the suite's libraries, stored
/// versions, keys, the deployment file, the mission dictionary. Of what is gone only the programs are named:
/// the manifest knows the rest. Blocks on the disk.
[[nodiscard]] std::vector<update::ScrubFile> files_to_scrub(const suite::Deployment& deployment,
                                                            const suite::VarPaths& var,
                                                            const Installation& installation);

/// As the ground gets it; what the structure has no room for is cut. Pure.
[[nodiscard]] mission::ScrubStatusHousekeeping to_mission(const update::ScrubStatus& status);

/// The end of a path, its most informative part.
[[nodiscard]] std::string end_of(const std::string& path, std::size_t most);

}  // namespace srfs
