// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/frame_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <limits>
#include <new>

#include <fmt/format.h>
#include <jpeglib.h>
#include <png.h>
#include <tiffio.h>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "image/fits.hpp"
#include "image/fits_library.hpp"

namespace srfs::image {
namespace {

constexpr std::size_t file_octets_max = std::size_t{1} << 30;
constexpr int samples_max = 4;  // of a pixel: colours and alpha

using Decoded = Result<Frame, Refusal>;

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

// --- FITS
// ----------------------------------------------------------------------------------------------------

Decoded decode_packed_fits(OctetView content) {
  static const FitsFunction function = fits_function("srfs_decode_packed_fits");
  if (function.address == nullptr) return Err(Refusal{function.problem});
  Decoded decoded = Frame{};
  reinterpret_cast<decltype(&srfs_decode_packed_fits)>(function.address)(content, decoded);
  return decoded;
}

Decoded decode_fits(OctetView content) {
  if (auto plain = decode_plain_fits(content)) return *std::move(plain);
  return decode_packed_fits(content);
}

// --- TIFF
// ----------------------------------------------------------------------------------------------------

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

Decoded decode_tiff(OctetView content) {
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

// --- PNG
// -----------------------------------------------------------------------------------------------------

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

Decoded decode_png(OctetView content) {
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

// --- JPEG
// ----------------------------------------------------------------------------------------------------

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

Decoded decode_jpeg(OctetView content) {
  JpegReader reader;
  reader.jpeg.err = jpeg_std_error(&reader.errors.base);
  reader.errors.base.error_exit = jpeg_complain;
  reader.errors.base.emit_message = jpeg_warn;
  if (setjmp(reader.errors.jump) != 0) return refuse("JPEG: {}", reader.errors.complaint.data());
  read_jpeg(reader, content);
  if (reader.refusal) return Err(std::move(*reader.refusal));
  return std::move(reader.frame);
}

using FileOctets = std::vector<std::uint8_t, FrameAllocator<std::uint8_t>>;

/// A file at once: its size is known, and a frame's may be large.
Result<FileOctets, Refusal> read_octets(const std::filesystem::path& path) {
  const auto problem = [&](const char* what) {
    return refuse("cannot {} {}: {}", what, path.string(), std::strerror(errno));
  };
  const Fd fd(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  struct stat status {};
  if (!fd || fstat(fd.get(), &status) != 0) return problem("open");
  if (static_cast<std::uint64_t>(status.st_size) > file_octets_max)
    return refuse("{}: {} octets, more than {}", path.string(), status.st_size, file_octets_max);
  FileOctets content(static_cast<std::size_t>(status.st_size));
  std::size_t n = 0;
  while (n < content.size()) {
    const ssize_t got = read(fd.get(), content.data() + n, content.size() - n);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return problem("read");
    if (got == 0) break;
    n += static_cast<std::size_t>(got);
  }
  content.resize(n);  // shorter by now
  return content;
}

bool starts_with(OctetView content, std::string_view magic) {
  return content.size() >= magic.size() && std::memcmp(content.data(), magic.data(), magic.size()) == 0;
}

}  // namespace

Result<Frame, Refusal> decode_frame(OctetView content) try {
  using namespace std::string_view_literals;
  if (content.empty()) return refuse("the file is empty");
  if (starts_with(content, "SIMPLE  =")) return decode_fits(content);
  if (starts_with(content, "\x89PNG\r\n\x1a\n")) return decode_png(content);
  if (starts_with(content, "\xff\xd8\xff")) return decode_jpeg(content);
  if (starts_with(content, "II*\0"sv) || starts_with(content, "MM\0*"sv) || starts_with(content, "II+\0"sv) ||
      starts_with(content, "MM\0+"sv))
    return decode_tiff(content);
  return refuse("neither FITS, TIFF, PNG nor JPEG");
} catch (const std::bad_alloc&) {
  return refuse("not enough memory for this frame");
}

Result<Frame, Refusal> read_frame(const std::filesystem::path& path) try {
  std::error_code ec;
  if (std::filesystem::exists(path, ec) && !std::filesystem::is_regular_file(path, ec))
    return refuse("{}: not a file", path.string());
  if (const auto size = std::filesystem::file_size(path, ec); !ec && size > file_octets_max)
    return refuse("{}: {} octets, more than {}", path.string(), size, file_octets_max);
  const auto content = read_octets(path);
  if (!content) return Err(content.error());
  auto frame = decode_frame(OctetView(content->data(), content->size()));
  if (!frame) return refuse("{}: {}", path.string(), frame.error().reason);
  return frame;
} catch (const std::bad_alloc&) {
  return refuse("{}: not enough memory for this file", path.string());
}

namespace {

Result<void, Refusal> write_octets(const std::filesystem::path& path, OctetView content) {
  const auto written = write_file_atomically(
      path, std::string_view(reinterpret_cast<const char*>(content.data()), content.size()));
  if (!written) return Err(Refusal{written.error().message});
  return {};
}

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
    return refuse("PNG: {}", png.message);
  Octets content(octets);
  if (png_image_write_to_memory(&png, content.data(), &octets, 0, samples, 0, nullptr) == 0)
    return refuse("PNG: {}", png.message);
  content.resize(octets);
  return content;
}

/// @param more  further cards
Octets encode_fits(const Plane& pixels, const std::string& more) {
  constexpr std::size_t block = 2880;
  std::string header;
  const auto card = [&](std::string_view key, std::int64_t value) {
    header += fmt::format("{:<8}= {:>20}{:50}", key, value, "");
  };
  header += fmt::format("{:<8}= {:>20}{:50}", "SIMPLE", "T", "");
  card("BITPIX", 16);
  card("NAXIS", 2);
  card("NAXIS1", pixels.width());
  card("NAXIS2", pixels.height());
  card("BZERO", 32768);
  card("BSCALE", 1);
  header += more;
  header += fmt::format("{:<80}", "END");
  header.resize((header.size() + block - 1) / block * block, ' ');
  Octets content(header.begin(), header.end());
  content.reserve(content.size() + 2 * pixels.size() + block);
  for (const float v : pixels.cells()) {
    const long rounded = std::isfinite(v) ? std::lround(std::clamp(v, 0.0F, 65535.0F)) : 0;
    const auto stored = static_cast<std::uint16_t>(rounded - 32768);
    content.push_back(static_cast<std::uint8_t>(stored >> 8));
    content.push_back(static_cast<std::uint8_t>(stored & 0xFF));
  }
  content.resize((content.size() + block - 1) / block * block, 0);
  return content;
}

}  // namespace

Octets encode_fits(const Frame& frame) {
  std::string more;
  if (const auto begin = utc_of(frame.time_s)) {
    std::string date = to_iso8601(*begin, 6);
    date.pop_back();  // FITS says UTC without a Z
    more += fmt::format("{:<80}", fmt::format("{:<8}= '{}'", "DATE-OBS", date));
  }
  if (frame.saturation_adu)
    more += fmt::format("{:<80}", fmt::format("{:<8}= {:>20.1f}", "SATURATE", *frame.saturation_adu));
  return encode_fits(frame.pixels, more);
}

Octets encode_fits(const Plane& pixels) {
  return encode_fits(pixels, "");
}

Result<Octets, Refusal> encode_png(const Grid<std::uint8_t>& pixels) {
  return encode_samples(pixels.cells().data(), pixels.width(), pixels.height(), PNG_FORMAT_GRAY);
}

Result<void, Refusal> write_fits(const std::filesystem::path& path, const Plane& pixels) {
  return write_octets(path, encode_fits(pixels));
}

Result<void, Refusal> write_fits(const std::filesystem::path& path, const Frame& frame) {
  return write_octets(path, encode_fits(frame));
}

Result<void, Refusal> write_png(const std::filesystem::path& path, const Grid<std::uint8_t>& pixels) {
  const auto content = encode_png(pixels);
  if (!content) return refuse("{}: {}", path.string(), content.error().reason);
  return write_octets(path, *content);
}

Result<void, Refusal> write_png(const std::filesystem::path& path, const Colours& colours) {
  Octets samples;
  samples.reserve(3 * colours[0].size());
  for (std::size_t i = 0; i < colours[0].size(); ++i) {
    for (const auto& colour : colours) samples.push_back(colour.cells()[i]);
  }
  const auto content =
      encode_samples(samples.data(), colours[0].width(), colours[0].height(), PNG_FORMAT_RGB);
  if (!content) return refuse("{}: {}", path.string(), content.error().reason);
  return write_octets(path, *content);
}

}  // namespace srfs::image
