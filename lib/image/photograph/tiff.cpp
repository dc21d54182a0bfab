// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include <tiffio.h>

#include "image/photograph/decoders.hpp"

namespace srfs::image {
namespace {

constexpr int samples_max = 4;  // of a pixel: colours and alpha

struct MemoryFile {
  OctetView content;
  std::uint64_t at = 0;
};

MemoryFile& memory_of(thandle_t handle) {
  return *static_cast<MemoryFile*>(handle);
}

tmsize_t tiff_read(thandle_t handle, void* to, tmsize_t wanted) {
  MemoryFile& file = memory_of(handle);
  if (wanted <= 0 || file.at >= file.content.size()) return 0;
  const auto n = std::min<std::uint64_t>(static_cast<std::uint64_t>(wanted), file.content.size() - file.at);
  std::memcpy(to, file.content.data() + file.at, n);
  file.at += n;
  return static_cast<tmsize_t>(n);
}

tmsize_t tiff_write(thandle_t, void*, tmsize_t) {
  return 0;
}

toff_t tiff_seek(thandle_t handle, toff_t offset, int whence) {
  MemoryFile& file = memory_of(handle);
  if (whence == SEEK_SET) file.at = offset;
  if (whence == SEEK_CUR) file.at += offset;
  if (whence == SEEK_END) file.at = file.content.size() + offset;
  return file.at;
}

int tiff_close(thandle_t) {
  return 0;
}
toff_t tiff_size(thandle_t handle) {
  return memory_of(handle).content.size();
}

/// What libtiff last complained about; its handlers are the process's.
thread_local std::string tiff_complaint;

void keep_tiff_complaint(const char*, const char* format, va_list arguments) {
  std::array<char, 200> text{};
  std::vsnprintf(text.data(), text.size(), format, arguments);
  tiff_complaint = text.data();
}

struct TiffFile {
  TIFF* handle;
  explicit TiffFile(MemoryFile& memory)
      : handle(TIFFClientOpen("frame", "rm", &memory, tiff_read, tiff_write, tiff_seek, tiff_close, tiff_size,
                              nullptr, nullptr)) {}
  TiffFile(const TiffFile&) = delete;
  TiffFile& operator=(const TiffFile&) = delete;
  ~TiffFile() {
    if (handle != nullptr) TIFFClose(handle);
  }
};

/// How the samples of a TIFF lie.
struct TiffLayout {
  int width = 0;
  int height = 0;
  int samples = 1;
  int colours = 1;
  int bits = 8;
  bool is_float = false;
  bool separate = false;  ///< a plane for each sample
};

Result<TiffLayout, Refusal> tiff_layout(TIFF* tiff, std::size_t file_octets) {
  std::uint32_t width = 0;
  std::uint32_t height = 0;
  std::uint16_t bits = 1;
  std::uint16_t samples = 1;
  std::uint16_t format = SAMPLEFORMAT_UINT;
  std::uint16_t planar = PLANARCONFIG_CONTIG;
  std::uint16_t photometric = PHOTOMETRIC_MINISBLACK;
  TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &width);
  TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &height);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &bits);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &samples);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &format);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_PLANARCONFIG, &planar);
  TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &photometric);
  if (auto refusal = refuse_size(width, height)) return Err(std::move(*refusal));
  if (photometric == PHOTOMETRIC_PALETTE) return refuse("TIFF: colour tables are not supported");
  if (samples < 1 || samples > samples_max)
    return refuse("TIFF: {} samples a pixel; expected 1 to {}", samples, samples_max);
  const bool is_float = format == SAMPLEFORMAT_IEEEFP;
  const bool readable =
      is_float ? bits == 32 : (format == SAMPLEFORMAT_UINT && (bits == 8 || bits == 16 || bits == 32));
  if (!readable)
    return refuse("TIFF: {} bits a sample in format {}; expected 8, 16 or 32 bits, or float of 32", bits,
                  format);
  const std::uint64_t octets = std::uint64_t{width} * height * samples * (bits / 8U);
  if (octets / 2000 > file_octets)
    return refuse("TIFF: the header announces {} octets of pixels in a file of {}", octets, file_octets);
  TiffLayout layout;
  layout.width = static_cast<int>(width);
  layout.height = static_cast<int>(height);
  layout.samples = samples;
  layout.colours = samples >= 3 ? 3 : 1;
  layout.bits = bits;
  layout.is_float = is_float;
  layout.separate = planar == PLANARCONFIG_SEPARATE && samples > 1;
  return layout;
}

void convert_tiff_row(const TiffLayout& layout, const std::vector<std::uint8_t>& row, int samples,
                      int colours, float* out) {
  if (layout.is_float)
    average_row(reinterpret_cast<const float*>(row.data()), samples, colours, out, layout.width);
  else if (layout.bits == 8)
    average_row(row.data(), samples, colours, out, layout.width);
  else if (layout.bits == 16)
    average_row(reinterpret_cast<const std::uint16_t*>(row.data()), samples, colours, out, layout.width);
  else
    average_row(reinterpret_cast<const std::uint32_t*>(row.data()), samples, colours, out, layout.width);
}

/// Tiles: the row of tiles that holds a row is decoded once.
bool read_tiled(TIFF* tiff, const TiffLayout& layout, Plane& pixels) {
  std::uint32_t tile_width = 0;
  std::uint32_t tile_height = 0;
  TIFFGetField(tiff, TIFFTAG_TILEWIDTH, &tile_width);
  TIFFGetField(tiff, TIFFTAG_TILELENGTH, &tile_height);
  const tmsize_t octets = TIFFTileSize(tiff);
  const std::size_t sample_octets = static_cast<std::size_t>(layout.bits) / 8;
  const int samples = layout.separate ? 1 : layout.samples;
  const auto row_octets =
      static_cast<std::size_t>(tile_width) * static_cast<std::size_t>(samples) * sample_octets;
  if (tile_width == 0 || tile_height == 0 || octets <= 0 || octets > (tmsize_t{1} << 28) ||
      row_octets * tile_height > static_cast<std::size_t>(octets))
    return false;
  std::vector<std::uint8_t> tile(static_cast<std::size_t>(octets));
  std::vector<std::uint8_t> line(row_octets);
  std::vector<float> values(tile_width);
  TiffLayout of_tile = layout;
  of_tile.width = static_cast<int>(tile_width);
  for (int y0 = 0; y0 < layout.height; y0 += static_cast<int>(tile_height)) {
    for (int x0 = 0; x0 < layout.width; x0 += static_cast<int>(tile_width)) {
      for (int plane = 0; plane < (layout.separate ? layout.colours : 1); ++plane) {
        if (TIFFReadTile(tiff, tile.data(), static_cast<std::uint32_t>(x0), static_cast<std::uint32_t>(y0), 0,
                         static_cast<std::uint16_t>(plane)) < 0)
          return false;
        const int rows = std::min(static_cast<int>(tile_height), layout.height - y0);
        const int columns = std::min(static_cast<int>(tile_width), layout.width - x0);
        for (int y = 0; y < rows; ++y) {
          std::memcpy(line.data(), tile.data() + static_cast<std::size_t>(y) * row_octets, row_octets);
          convert_tiff_row(of_tile, line, samples, layout.separate ? 1 : layout.colours, values.data());
          float* out = pixels.row(y0 + y) + x0;
          const float share = layout.separate ? 1.0F / static_cast<float>(layout.colours) : 1.0F;
          for (int x = 0; x < columns; ++x) out[x] += share * values[static_cast<std::size_t>(x)];
        }
      }
    }
  }
  return true;
}

bool read_rows(TIFF* tiff, const TiffLayout& layout, Plane& pixels) {
  const int samples = layout.separate ? 1 : layout.samples;
  const auto octets = static_cast<std::size_t>(layout.width) * static_cast<std::size_t>(samples) *
                      (static_cast<std::size_t>(layout.bits) / 8);
  if (TIFFScanlineSize(tiff) != static_cast<tmsize_t>(octets)) return false;
  std::vector<std::uint8_t> row(octets);
  std::vector<float> values(static_cast<std::size_t>(layout.width));
  const int planes = layout.separate ? layout.colours : 1;
  for (int plane = 0; plane < planes; ++plane) {
    for (int y = 0; y < layout.height; ++y) {
      if (TIFFReadScanline(tiff, row.data(), static_cast<std::uint32_t>(y),
                           static_cast<std::uint16_t>(plane)) < 0)
        return false;
      convert_tiff_row(layout, row, samples, layout.separate ? 1 : layout.colours, values.data());
      float* out = pixels.row(y);
      for (int x = 0; x < layout.width; ++x)
        out[x] += values[static_cast<std::size_t>(x)] / static_cast<float>(planes);
    }
  }
  return true;
}

}  // namespace

Result<Frame, Refusal> decode_tiff(OctetView content) {
  TIFFSetErrorHandler(keep_tiff_complaint);
  TIFFSetWarningHandler(nullptr);
  tiff_complaint.clear();
  MemoryFile memory{content};
  const TiffFile file(memory);
  if (file.handle == nullptr) return refuse("TIFF: {}", tiff_complaint);
  const auto layout = tiff_layout(file.handle, content.size());
  if (!layout) return Err(layout.error());
  Frame frame;
  frame.pixels = Plane(layout->width, layout->height);
  const bool read = TIFFIsTiled(file.handle) != 0 ? read_tiled(file.handle, *layout, frame.pixels)
                                                  : read_rows(file.handle, *layout, frame.pixels);
  if (!read)
    return refuse("TIFF: {}", tiff_complaint.empty() ? "the pixels do not match the header" : tiff_complaint);
  if (!layout->is_float) frame.step = 1.0F / static_cast<float>(layout->colours);
  return frame;
}

}  // namespace srfs::image
