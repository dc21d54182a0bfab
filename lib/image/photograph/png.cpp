// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <optional>
#include <vector>

#include <png.h>

#include "image/photograph/decoders.hpp"

namespace srfs::image {
namespace {

struct PngSource {
  OctetView content;
  std::size_t at = 0;
  std::array<char, 160> complaint{};
};

void png_take(png_structp png, png_bytep to, std::size_t wanted) {
  auto& source = *static_cast<PngSource*>(png_get_io_ptr(png));
  if (wanted > source.content.size() - source.at) png_error(png, "the file ends too early");
  std::memcpy(to, source.content.data() + source.at, wanted);
  source.at += wanted;
}

void png_complain(png_structp png, png_const_charp text) {
  auto& source = *static_cast<PngSource*>(png_get_error_ptr(png));
  std::snprintf(source.complaint.data(), source.complaint.size(), "%s", text);
  longjmp(png_jmpbuf(png), 1);
}

void png_ignore(png_structp, png_const_charp) {}

/// What decode_png owns; nothing with a destructor lives between setjmp and longjmp.
struct PngReader {
  png_structp png = nullptr;
  png_infop info = nullptr;
  std::vector<std::uint8_t> octets;
  std::vector<png_bytep> rows;
  Frame frame;
  std::optional<Refusal> refusal;
  PngReader() = default;
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;
  ~PngReader() { png_destroy_read_struct(&png, &info, nullptr); }
};

void read_png(PngReader& r) {
  png_read_info(r.png, r.info);
  const std::uint32_t width = png_get_image_width(r.png, r.info);
  const std::uint32_t height = png_get_image_height(r.png, r.info);
  r.refusal = refuse_size(width, height);
  if (r.refusal) return;
  if (png_get_bit_depth(r.png, r.info) == 16) png_set_swap(r.png);
  png_set_expand(r.png);  // tables and fewer than 8 bits to 8 bits
  png_set_interlace_handling(r.png);
  png_read_update_info(r.png, r.info);
  const int samples = png_get_channels(r.png, r.info);
  const int bits = png_get_bit_depth(r.png, r.info);
  const std::size_t row_octets = png_get_rowbytes(r.png, r.info);
  r.octets.resize(row_octets * height);
  r.rows.resize(height);
  for (std::uint32_t y = 0; y < height; ++y) r.rows[y] = r.octets.data() + y * row_octets;
  png_read_image(r.png, r.rows.data());
  r.frame.pixels = Plane(static_cast<int>(width), static_cast<int>(height));
  const int colours = samples >= 3 ? 3 : 1;
  for (int y = 0; y < static_cast<int>(height); ++y) {
    const png_bytep row = r.rows[static_cast<std::size_t>(y)];
    if (bits == 16)
      average_row(reinterpret_cast<const std::uint16_t*>(row), samples, colours, r.frame.pixels.row(y),
                  static_cast<int>(width));
    else
      average_row(row, samples, colours, r.frame.pixels.row(y), static_cast<int>(width));
  }
  r.frame.step = 1.0F / static_cast<float>(colours);
}

}  // namespace

Result<Frame, Refusal> decode_png(OctetView content) {
  PngSource source{content};
  PngReader reader;
  reader.png = png_create_read_struct(PNG_LIBPNG_VER_STRING, &source, png_complain, png_ignore);
  if (reader.png == nullptr) return refuse("PNG: no memory");
  reader.info = png_create_info_struct(reader.png);
  if (reader.info == nullptr) return refuse("PNG: no memory");
  png_set_user_limits(reader.png, 0x7FFFFFFF, 0x7FFFFFFF);  // refuse_size judges
  png_set_read_fn(reader.png, &source, png_take);
  if (setjmp(png_jmpbuf(reader.png)) != 0) return refuse("PNG: {}", source.complaint.data());
  read_png(reader);
  if (reader.refusal) return Err(std::move(*reader.refusal));
  return std::move(reader.frame);
}

}  // namespace srfs::image
