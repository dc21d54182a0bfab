// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <nlohmann/json.hpp>

namespace srfs::bench {

/// Lossless compression of night frames of a 12-bit camera: strips of lib/image compared with cfitsio's Rice
/// tiles, alternately in this process. Sizes are relative to 12 bits per pixel; times are the best of all,
/// per frame.
/// @param frames  number of frames for each sky
[[nodiscard]] nlohmann::ordered_json measure_lossless(int width, int height, int frames, std::uint64_t seed);

}  // namespace srfs::bench
