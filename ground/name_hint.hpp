// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "msgs/mission/dictionary.hpp"

namespace srfs::ground {

/// How many letters must be inserted, removed, changed or swapped with their neighbour to make one of the
/// other.
[[nodiscard]] std::size_t edit_distance(std::string_view a, std::string_view b);

/// "; did you mean 'x' or 'y'?" for names that are near, nearest first, at most three; empty: none is.
[[nodiscard]] std::string did_you_mean(std::string_view name, const std::vector<std::string>& known);

/// Why a telecommand cannot be encoded; of an unknown one with names that are near.
[[nodiscard]] std::string explained(const mission::Dictionary& dictionary, const std::string& name,
                                    const std::string& why);

}  // namespace srfs::ground
