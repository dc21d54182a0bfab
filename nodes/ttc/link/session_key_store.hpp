// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "nodes/ttc/link/uplink_chain.hpp"
#include "wire/session_keys.hpp"

namespace srfs {

/// Session keys of the spacecraft, FOLDER/session_keys.0 and .1, read and written by ttc and by srfs_rescue.
/// Blocks on the disk.
struct FoundSessionKeys {
  wire::SessionKeys keys = {};
  std::string lost = {};  ///< what is accepted now that they are; empty: they are not
};
/// @p config uses them from then on. Where both copies are damaged, only the contingency association takes
/// frames, if there is one: the keys of the files may be those that were replaced.
[[nodiscard]] FoundSessionKeys load_session_keys(const std::filesystem::path& folder, UplinkConfig& config);
/// @return whether they are on the disk; what is wrong is logged
[[nodiscard]] bool store_session_keys(const std::filesystem::path& folder, const wire::SessionKeys& keys);

}  // namespace srfs
