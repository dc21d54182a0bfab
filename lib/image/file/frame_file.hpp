// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "image/file/fits.hpp"

namespace srfs::image {

/// Makes a frame of the content of a file, or says why it cannot. Never throws.
using FrameDecoder = Result<Frame, Refusal> (*)(OctetView);

/// Reads a frame from a file of up to 1 GiB. Blocks on the disk.
/// @param decode  decode_fits, or decode_photograph on the ground
/// @return the frame, or why there is none, beginning with the path; never throws
[[nodiscard]] Result<Frame, Refusal> read_frame(const std::filesystem::path& path,
                                                FrameDecoder decode = decode_fits);

/// Writes a plain FITS file. Replaces the file.
[[nodiscard]] Result<void, Refusal> write_fits(const std::filesystem::path& path, const Plane& pixels);

/// The same with DATE-OBS, EXPTIME, GAIN, CCD-TEMP and SATURATE where the frame knows them.
[[nodiscard]] Result<void, Refusal> write_fits(const std::filesystem::path& path, const Frame& frame);

/// Replaces the file.
[[nodiscard]] Result<void, Refusal> write_octets(const std::filesystem::path& path, OctetView content);

}  // namespace srfs::image
