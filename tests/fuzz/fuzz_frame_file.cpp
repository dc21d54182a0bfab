// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// FITS files as they are read on board. The result is a frame with the announced number of pixels, or a
// reason.
#include <cstdlib>

#include "image/file/fits.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto frame = srfs::image::decode_fits(srfs::OctetView(data, size));
  if (!frame) {
    if (frame.error().reason.empty()) std::abort();
    return 0;
  }
  const auto& pixels = frame->pixels;
  if (srfs::image::refuse_size(pixels.width(), pixels.height())) std::abort();
  return 0;
}
