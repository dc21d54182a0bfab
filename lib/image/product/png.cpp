// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/product/png.hpp"

#include <png.h>

namespace srfs::image {
namespace {

/// @param samples  octets, row by row
Result<Octets, Refusal> encode_samples(const std::uint8_t* samples, int width, int height,
                                       png_uint_32 format) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(width);
  png.height = static_cast<png_uint_32>(height);
  png.format = format;
  png_alloc_size_t octets = 0;
  if (png_image_write_to_memory(&png, nullptr, &octets, 0, samples, 0, nullptr) == 0)
    return Err(Refusal{std::string("PNG: ") + png.message});
  Octets content(octets);
  if (png_image_write_to_memory(&png, content.data(), &octets, 0, samples, 0, nullptr) == 0)
    return Err(Refusal{std::string("PNG: ") + png.message});
  content.resize(octets);
  return content;
}

}  // namespace

Result<Octets, Refusal> encode_png(const Grid<std::uint8_t>& grey) {
  return encode_samples(grey.cells().data(), grey.width(), grey.height(), PNG_FORMAT_GRAY);
}

Result<Octets, Refusal> encode_png(const Colours& colours) {
  Octets samples;
  samples.reserve(3 * colours[0].size());
  for (std::size_t i = 0; i < colours[0].size(); ++i) {
    for (const auto& colour : colours) samples.push_back(colour.cells()[i]);
  }
  return encode_samples(samples.data(), colours[0].width(), colours[0].height(), PNG_FORMAT_RGB);
}

}  // namespace srfs::image
