// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Strips of a frame as received from the link. The result is the frame or a reason. Also tests strips with
// correct checksums, to reach the code behind the checks.
#include <cmath>
#include <cstdlib>

#include "base/crc32c.hpp"
#include "image/product/frame_strips.hpp"

namespace {

using srfs::Octets;
using srfs::OctetView;

void decode(OctetView content) {
  const auto found = srfs::image::decode_strips(content);
  if (!found) {
    if (found.error().reason.empty()) std::abort();
    return;
  }
  const auto& pixels = found->frame.pixels;
  if (found->strips == 0 || found->missing.size() >= found->strips || found->rows == 0) std::abort();
  if (found->octets_skipped > content.size()) std::abort();
  if (srfs::image::refuse_size(pixels.width(), pixels.height())) std::abort();
  for (const float v : pixels.cells()) {
    if (!std::isnan(v) && !(v >= 0 && v <= 65535)) std::abort();
  }
}

void set_u32(Octets& octets, std::size_t at, std::uint32_t v) {
  for (std::size_t i = 0; i < 4; ++i) octets[at + i] = static_cast<std::uint8_t>(v >> (24 - 8 * i));
}

/// One strip with correct checksums for arbitrary fields and samples.
Octets with_sums(OctetView content) {
  Octets strip(content.begin(), content.end());
  const std::size_t samples = strip.size() - srfs::image::strip_overhead_octets;
  constexpr std::size_t header = srfs::image::strip_header_octets;
  set_u32(strip, header - 8, static_cast<std::uint32_t>(samples));
  set_u32(strip, header - 4, srfs::crc32c(OctetView(strip).first(header - 4)));
  set_u32(strip, header + samples, srfs::crc32c(OctetView(strip).subspan(header, samples)));
  return strip;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const srfs::image::FramePixelsLimit limit(1'000'000);
  const OctetView content(data, size);
  decode(content);
  if (size > srfs::image::strip_overhead_octets) decode(with_sums(content));
  return 0;
}
