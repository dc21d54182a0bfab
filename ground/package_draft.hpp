// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "update/package.hpp"

namespace srfs::ground {

/// The description of a package of sources, as a team gives it. Empty or nullopt: not given.
struct PackageDraft {
  std::string node;
  std::string kind;  ///< replace or new
  std::optional<std::uint64_t> counter;
  std::string root;                  ///< names in the package are relative to this folder
  std::vector<std::string> sources;  ///< files, and folders: all .cpp, .hpp and .h below them
  std::vector<std::string> options;
  std::optional<std::uint64_t> self_test_s;
  std::optional<std::uint64_t> probation_s;
  std::string ring_after;
  std::string deployment_entry;  ///< file, YAML: an entry as under `nodes` of a deployment
  std::string fragment;          ///< file, YAML: of the mission dictionary; goes along as one of the files
  std::string binary;            ///< file: its SHA-256 goes along
  std::optional<update::SlotRequest> slot;
};

/// A file that a team keeps beside its sources (README.md); its paths are relative to its folder. The error
/// is ready to print. Blocks on the disk, as all here.
[[nodiscard]] Result<PackageDraft, std::string> load_draft(const std::filesystem::path& file);
/// @p base, with what @p said gives in its place.
[[nodiscard]] PackageDraft merged(PackageDraft base, const PackageDraft& said);

/// The package, its files ordered by name; refused for all that the spacecraft would refuse. The same input
/// gives the same octets. The error is ready to print.
[[nodiscard]] Result<Octets, std::string> make_package(const PackageDraft& draft,
                                                       const update::SigningSeed& seed);

}  // namespace srfs::ground
