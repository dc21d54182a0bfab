// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include <nlohmann/json.hpp>

namespace srfs::ground {

inline constexpr int json_depth_max = 16;  ///< objects and arrays in each other

/// JSON of others. Discarded (is_discarded()): no JSON, or nested deeper than json_depth_max, which would
/// take the stack of whoever copies, compares or writes it. Pure.
[[nodiscard]] nlohmann::json parse_bounded(std::string_view text);

}  // namespace srfs::ground
