// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstdio>
#include <optional>
#include <vector>

#include <jpeglib.h>

#include "image/photograph/decoders.hpp"

namespace srfs::image {
namespace {

struct JpegErrors {
  jpeg_error_mgr base;
  std::jmp_buf jump;
  std::array<char, JMSG_LENGTH_MAX> complaint;
};

void jpeg_complain(j_common_ptr jpeg) {
  auto& errors = *reinterpret_cast<JpegErrors*>(jpeg->err);
  errors.base.format_message(jpeg, errors.complaint.data());
  longjmp(errors.jump, 1);
}

/// A cut file decodes to grey from where it ends: libjpeg calls that a warning, here it is an error.
void jpeg_warn(j_common_ptr jpeg, int level) {
  if (level < 0) jpeg_complain(jpeg);
}

struct JpegReader {
  jpeg_decompress_struct jpeg{};
  JpegErrors errors{};
  std::vector<std::uint8_t> row;
  Frame frame;
  std::optional<Refusal> refusal;
  JpegReader() = default;
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;
  ~JpegReader() { jpeg_destroy_decompress(&jpeg); }
};

/// What compression makes of neighbouring values: steps between the levels of blocks, which the eye does not
/// see and a search for lines does, and the coarse waves within them (the first nine, of which a pixel sees a
/// quarter).
float jpeg_step(const jpeg_decompress_struct& jpeg) {
  constexpr std::array coarse{1, 2, 3, 8, 9, 10, 16, 17, 24};  // row by row in the table
  const JQUANT_TBL* const table = jpeg.quant_tbl_ptrs[0];
  if (table == nullptr) return 1;
  float sum = 0;
  for (const int k : coarse) sum += static_cast<float>(table->quantval[k]);
  const float waves = sum / static_cast<float>(coarse.size()) / 4;
  const float levels = static_cast<float>(table->quantval[0]) / 8;
  return std::max({1.0F, waves, 2.5F * levels});
}

void read_jpeg(JpegReader& r, OctetView content) {
  jpeg_create_decompress(&r.jpeg);
  jpeg_mem_src(&r.jpeg, content.data(), content.size());
  jpeg_read_header(&r.jpeg, TRUE);
  r.refusal = refuse_size(r.jpeg.image_width, r.jpeg.image_height);
  if (r.refusal) return;
  if (r.jpeg.jpeg_color_space == JCS_YCbCr)
    r.jpeg.out_color_space = JCS_GRAYSCALE;  // Y is all there is of fine detail
  jpeg_start_decompress(&r.jpeg);
  const int width = static_cast<int>(r.jpeg.output_width);
  const int samples = r.jpeg.output_components;
  r.row.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(samples));
  r.frame.pixels = Plane(width, static_cast<int>(r.jpeg.output_height));
  while (r.jpeg.output_scanline < r.jpeg.output_height) {
    const int y = static_cast<int>(r.jpeg.output_scanline);
    JSAMPROW row = r.row.data();
    jpeg_read_scanlines(&r.jpeg, &row, 1);
    average_row(row, samples, samples >= 3 ? 3 : 1, r.frame.pixels.row(y), width);
  }
  r.frame.step = jpeg_step(r.jpeg);
  jpeg_finish_decompress(&r.jpeg);
}

}  // namespace

Result<Frame, Refusal> decode_jpeg(OctetView content) {
  JpegReader reader;
  reader.jpeg.err = jpeg_std_error(&reader.errors.base);
  reader.errors.base.error_exit = jpeg_complain;
  reader.errors.base.emit_message = jpeg_warn;
  if (setjmp(reader.errors.jump) != 0) return refuse("JPEG: {}", reader.errors.complaint.data());
  read_jpeg(reader, content);
  if (reader.refusal) return Err(std::move(*reader.refusal));
  return std::move(reader.frame);
}

}  // namespace srfs::image
