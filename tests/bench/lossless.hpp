// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <nlohmann/json.hpp>

namespace srfs::bench {

/// Frames of a 12-bit camera at night without loss: strips of lib/image beside cfitsio's Rice tiles,
/// alternately in this process. Sizes beside 12 bits a pixel; times are of one frame, the best of all.
/// @param frames  of each sky
[[nodiscard]] nlohmann::ordered_json measure_lossless(int width, int height, int frames, std::uint64_t seed);

}  // namespace srfs::bench
