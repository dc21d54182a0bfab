// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mission/structures.hpp>

#include "update/version_table.hpp"

namespace srfs {

/// A version of a node as the ground gets it; what the structure has no room for is cut. Pure.
/// @param version  nullptr: golden
[[nodiscard]] mission::NodeVersionHousekeeping to_mission(const std::string& node,
                                                          const update::VersionTable& table,
                                                          const update::Version* version);

}  // namespace srfs
