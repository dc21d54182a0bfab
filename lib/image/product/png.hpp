// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "base/octets.hpp"
#include "image/frame.hpp"

namespace srfs::image {

/// Three grids of one size: red, green, blue.
using Colours = std::array<Grid<std::uint8_t>, 3>;

/// 8-bit PNG in memory.
[[nodiscard]] Result<Octets, Refusal> encode_png(const Grid<std::uint8_t>& grey);
[[nodiscard]] Result<Octets, Refusal> encode_png(const Colours& colours);

}  // namespace srfs::image
