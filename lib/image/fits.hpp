// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "base/octets.hpp"
#include "image/fits_writer.hpp"
#include "image/frame.hpp"

namespace srfs::image {

/// A FITS file whose first header and data unit is an image, neither compressed nor otherwise unusual.
/// @return nothing where it is not that: cfitsio knows more kinds, and why a file is none of them
[[nodiscard]] std::optional<Frame> decode_plain_fits(OctetView content);

}  // namespace srfs::image

/// Any FITS image, by cfitsio: in a library of its own, since cfitsio brings fifty others.
extern "C" void srfs_decode_packed_fits(srfs::OctetView content,
                                        srfs::Result<srfs::image::Frame, srfs::image::Refusal>& decoded);

/// Writes them, by cfitsio too.
extern "C" void srfs_encode_packed_fits(const srfs::image::Grid<std::uint16_t>& pixels,
                                        std::span<const srfs::image::FitsCard> cards,
                                        srfs::Result<srfs::Octets, srfs::image::Refusal>& encoded);
