// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "base/result.hpp"
#include "suite/instance.hpp"
#include "update/version_table.hpp"

namespace srfs::suite {

/// State files over a change of a node's version: what one version wrote, another may not be able to read.

constexpr std::uint64_t largest_snapshot = 4U << 20U;  ///< octets; what has no room is not in it
constexpr std::size_t most_snapshot_files = 64;

/// VAR/versions/NODE/state.N: the state as version N left it.
[[nodiscard]] std::filesystem::path snapshot_folder(const VarPaths& var, const std::string& node,
                                                    update::VersionNumber version);
/// Copies the files of VAR/state/NODE, folders in it left out; a snapshot of the same version before goes.
/// Blocks on the disk.
[[nodiscard]] Result<void, std::string> snapshot_state(const VarPaths& var, const std::string& node,
                                                       update::VersionNumber version);

enum class TakenBack : std::uint8_t {
  yes,
  never,  ///< journals and counters: an old one would let things happen twice
};
/// The content of VAR/state/NODE/NAME. What @p usable refuses is set aside as NAME.unreadable, with a line in
/// the log, and is no failure: the copy in the snapshot of the active version takes its place where it may
/// and is usable. Blocks on the disk.
/// @param usable  leaves everything as it was when it returns false
/// @return nullopt: there is none that can be used
[[nodiscard]] std::optional<std::string> read_state_file(
    const VarPaths& var, const std::string& node, const std::string& name, std::size_t limit,
    TakenBack taken_back, const std::function<bool(const std::string&)>& usable);
/// NAME.unreadable, in the place of an earlier one; for a caller that reads the file itself.
void set_aside_unreadable(const std::filesystem::path& file);

}  // namespace srfs::suite
