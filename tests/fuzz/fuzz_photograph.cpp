// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Pictures of the formats that are read on the ground only. No FITS: hostile files kill cfitsio.
// The result is a frame with the announced number of pixels, or a reason.
#include <cstdlib>

#include "image/photograph/photograph.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size > 0 && data[0] == 'S') return 0;
  const auto frame = srfs::image::decode_photograph(srfs::OctetView(data, size));
  if (!frame) {
    if (frame.error().reason.empty()) std::abort();
    return 0;
  }
  const auto& pixels = frame->pixels;
  if (srfs::image::refuse_size(pixels.width(), pixels.height())) std::abort();
  return 0;
}
