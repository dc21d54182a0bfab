// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "programs/srfs/suite.hpp"
#include "suite/rescue_settings.hpp"

namespace srfs::tool {

/// What srfs_rescue must know of the deployment, keys included. @return why it cannot be stated
[[nodiscard]] Result<suite::RescueSettings, std::string> rescue_settings_of(const Target& target);

/// `srfs rescue prepare`: fills each folder with the program srfs_rescue, its settings and the list of their
/// digests. Each is replaced atomically.
int prepare_rescue(const Target& target, const std::vector<std::string>& folders, bool json);
/// `srfs rescue step`: the step of the last start. @param up  the next one is normal again
int show_step(const Target& target, bool up, bool json);

}  // namespace srfs::tool
