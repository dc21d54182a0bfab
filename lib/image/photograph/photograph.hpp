// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "base/octets.hpp"
#include "image/frame.hpp"
#include "image/product/png.hpp"

/// Frames as telescopes, cameras and other programs store them. For programs on the ground: nothing of this
/// flies.
namespace srfs::image {

/// Whether a file begins as one of these formats.
[[nodiscard]] bool is_photograph(OctetView content);

/// FITS (first image of the file, tile compression too), TIFF (8, 16, 32 bit, float), PNG, JPEG. The content
/// says which, not the name. Colours are averaged. The size is judged before pixels are decoded.
/// @return the frame, or why there is none; never throws
[[nodiscard]] Result<Frame, Refusal> decode_photograph(OctetView content);

/// For FITS of 16 bits, which is all that is read on board: whole values from 0 to 65535 stay; continuous,
/// negative and larger ones are spread over 0 to 65535; pixels without a value become the least. Pure.
[[nodiscard]] Frame in_16_bits(Frame frame);

/// Writes 8-bit PNG. Replaces the file.
[[nodiscard]] Result<void, Refusal> write_png(const std::filesystem::path& path,
                                              const Grid<std::uint8_t>& pixels);
[[nodiscard]] Result<void, Refusal> write_png(const std::filesystem::path& path, const Colours& colours);

}  // namespace srfs::image
