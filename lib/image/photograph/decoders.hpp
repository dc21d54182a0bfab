// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include "base/octets.hpp"
#include "image/frame.hpp"

/// One decoder a format, each in its own source with its own library. They judge the size before they decode
/// pixels. May throw std::bad_alloc.
namespace srfs::image {

template <class... Args>
tl::unexpected<Refusal> refuse(fmt::format_string<Args...> format, Args&&... args) {
  return Err(Refusal{fmt::format(format, std::forward<Args>(args)...)});
}

/// Averages @p colours of every @p samples samples.
template <class T>
void average_row(const T* in, int samples, int colours, float* out, int width) {
  for (int x = 0; x < width; ++x, in += samples) {
    float sum = 0;
    for (int s = 0; s < colours; ++s) sum += static_cast<float>(in[s]);
    out[x] = sum / static_cast<float>(colours);
  }
}

/// The first image of a file, tile-compressed too, by cfitsio.
[[nodiscard]] Result<Frame, Refusal> decode_any_fits(OctetView content);
/// The first page: 8, 16 or 32 bits, or float.
[[nodiscard]] Result<Frame, Refusal> decode_tiff(OctetView content);
[[nodiscard]] Result<Frame, Refusal> decode_png(OctetView content);
[[nodiscard]] Result<Frame, Refusal> decode_jpeg(OctetView content);

}  // namespace srfs::image
