// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>

#include "base/octets.hpp"
#include "image/frame.hpp"

namespace srfs::image {

/// Reads a frame: FITS (first image of the file, tile compression too), TIFF (8, 16, 32 bit, float), PNG,
/// JPEG. The content says which, not the name. Colours are averaged. The size is judged before pixels are
/// decoded.
/// @return the frame, or why there is none; never throws
[[nodiscard]] Result<Frame, Refusal> decode_frame(OctetView content);

/// The same for a file, which may have up to 1 GiB. Blocks on the disk.
[[nodiscard]] Result<Frame, Refusal> read_frame(const std::filesystem::path& path);

/// 16-bit FITS in memory, as write_fits() writes it.
[[nodiscard]] Octets encode_fits(const Plane& pixels);

/// The same with DATE-OBS and SATURATE where the frame knows them.
[[nodiscard]] Octets encode_fits(const Frame& frame);

/// 8-bit grey PNG in memory.
[[nodiscard]] Result<Octets, Refusal> encode_png(const Grid<std::uint8_t>& pixels);

/// Writes 16-bit FITS; values are rounded and cut off at 0 and 65535. Replaces the file.
[[nodiscard]] Result<void, Refusal> write_fits(const std::filesystem::path& path, const Plane& pixels);

/// The same with DATE-OBS and SATURATE where the frame knows them.
[[nodiscard]] Result<void, Refusal> write_fits(const std::filesystem::path& path, const Frame& frame);

/// Writes 8-bit grey PNG. Replaces the file.
[[nodiscard]] Result<void, Refusal> write_png(const std::filesystem::path& path,
                                              const Grid<std::uint8_t>& pixels);

/// Three grids of one size: red, green, blue.
using Colours = std::array<Grid<std::uint8_t>, 3>;

/// Writes 8-bit colour PNG. Replaces the file.
[[nodiscard]] Result<void, Refusal> write_png(const std::filesystem::path& path, const Colours& colours);

}  // namespace srfs::image
