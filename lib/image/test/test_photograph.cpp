// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/photograph/photograph.hpp"

#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <jpeglib.h>
#include <png.h>
#include <tiffio.h>

#include "base/file.hpp"
#include "base/text.hpp"
#include "image/file/frame_file.hpp"
#include "image/test/ramp.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::image {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

Result<Frame, Refusal> read_photograph(const std::string& path) {
  return read_frame(path, decode_photograph);
}

class Photograph : public testing::Test {
 protected:
  [[nodiscard]] std::string path(const char* name) const { return (folder_.path() / name).string(); }

  [[nodiscard]] std::string refusal(const std::string& content) const {
    const auto frame = decode_photograph(as_octets(content));
    return frame ? "" : frame.error().reason;
  }

  testing_support::TemporaryFolder folder_;
};

void write_tiff(const std::string& path, int bits, bool tiled) {
  TIFF* tiff = TIFFOpen(path.c_str(), "w");
  const Plane plane = ramp();
  TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, plane.width());
  TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, plane.height());
  TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, bits);
  TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, 1);
  TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
  if (bits == 32) TIFFSetField(tiff, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP);
  const auto put = [&](std::vector<std::uint8_t>& to, std::size_t at, float v) {
    if (bits == 32) std::memcpy(&to[at * 4], &v, 4);
    const auto v16 = static_cast<std::uint16_t>(v);
    if (bits == 16) std::memcpy(&to[at * 2], &v16, 2);
  };
  if (tiled) {
    TIFFSetField(tiff, TIFFTAG_TILEWIDTH, 16);
    TIFFSetField(tiff, TIFFTAG_TILELENGTH, 16);
    std::vector<std::uint8_t> tile(16 * 16 * 4);
    for (int y = 0; y < plane.height(); ++y) {
      for (int x = 0; x < plane.width(); ++x) put(tile, static_cast<std::size_t>(16 * y + x), plane.at(x, y));
    }
    TIFFWriteTile(tiff, tile.data(), 0, 0, 0, 0);
  } else {
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, 4);
    for (int y = 0; y < plane.height(); ++y) {
      std::vector<std::uint8_t> row(static_cast<std::size_t>(plane.width()) * 4);
      for (int x = 0; x < plane.width(); ++x) put(row, static_cast<std::size_t>(x), plane.at(x, y));
      TIFFWriteScanline(tiff, row.data(), static_cast<std::uint32_t>(y), 0);
    }
  }
  TIFFClose(tiff);
}

void write_png16(const std::string& path) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, file);
  const Plane plane = ramp();
  png_set_IHDR(png, info, static_cast<png_uint_32>(plane.width()), static_cast<png_uint_32>(plane.height()),
               16, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  for (int y = 0; y < plane.height(); ++y) {
    std::vector<std::uint8_t> row;
    for (int x = 0; x < plane.width(); ++x) {
      const auto v = static_cast<unsigned>(plane.at(x, y));
      row.push_back(static_cast<std::uint8_t>(v >> 8));
      row.push_back(static_cast<std::uint8_t>(v & 0xFF));
    }
    png_write_row(png, row.data());
  }
  png_write_end(png, info);
  png_destroy_write_struct(&png, &info);
  std::fclose(file);
}

void write_jpeg(const std::string& path, JDIMENSION width, JDIMENSION height) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr errors{};
  jpeg.err = jpeg_std_error(&errors);
  jpeg_create_compress(&jpeg);
  jpeg_stdio_dest(&jpeg, file);
  jpeg.image_width = width;
  jpeg.image_height = height;
  jpeg.input_components = 1;
  jpeg.in_color_space = JCS_GRAYSCALE;
  jpeg_set_defaults(&jpeg);
  jpeg_set_quality(&jpeg, 95, TRUE);
  jpeg_start_compress(&jpeg, TRUE);
  std::vector<std::uint8_t> row(width, 77);
  while (jpeg.next_scanline < height) {
    JSAMPROW pointer = row.data();
    jpeg_write_scanlines(&jpeg, &pointer, 1);
  }
  jpeg_finish_compress(&jpeg);
  jpeg_destroy_compress(&jpeg);
  std::fclose(file);
}

/// A file with one header and its data.
std::string fits_of(const std::vector<std::string>& cards, const std::string& data) {
  std::string content;
  for (const std::string& card : cards) content += fmt::format("{:<80}", card);
  content += fmt::format("{:<80}", "END");
  content.resize((content.size() + 2879) / 2880 * 2880, ' ');
  content += data;
  content.resize((content.size() + 2879) / 2880 * 2880, '\0');
  return content;
}

template <class T>
std::string big_endian(const std::vector<T>& values) {
  std::string octets;
  for (const T v : values) {
    std::array<char, sizeof(T)> one{};
    std::memcpy(one.data(), &v, sizeof(T));
    octets.append(one.rbegin(), one.rend());
  }
  return octets;
}

Frame decoded(const std::string& content) {
  auto frame = decode_photograph(as_octets(content));
  EXPECT_TRUE(frame) << frame.error().reason;
  return frame ? *std::move(frame) : Frame{};
}

TEST_F(Photograph, ReadsFitsOfEveryNumberFormatWithScaleAndBlank) {
  const auto cards = [](int bitpix) {
    return std::vector<std::string>{"SIMPLE  =                    T",
                                    fmt::format("BITPIX  = {:>20}", bitpix),
                                    "NAXIS   =                    2 / two axes",
                                    "NAXIS1  =                    3",
                                    "NAXIS2  =                    1",
                                    "BSCALE  =                  2.0",
                                    "BZERO   =                 10.5",
                                    "DATE-OBS= '2026-11-22T07:52:30.5' / begin",
                                    "SATURATE=                 500.",
                                    "COMMENT = this is none"};
  };
  const auto check = [](const Frame& frame) {
    ASSERT_EQ(frame.pixels.width(), 3);
    EXPECT_EQ(frame.pixels.at(0, 0), 12.5F);
    EXPECT_EQ(frame.pixels.at(2, 0), 16.5F);
    EXPECT_EQ(frame.saturation_adu, 500);
    ASSERT_TRUE(frame.time_s);
    EXPECT_DOUBLE_EQ(*frame.time_s, 1795333950.5);
  };
  for (const bool packed : {false, true}) {
    // cfitsio also accepts an exponent in Fortran's notation.
    const auto all = [&](int bitpix) {
      auto c = cards(bitpix);
      if (packed) c[5] = "BSCALE  =                2.0D0";
      return c;
    };
    check(decoded(fits_of(all(8), big_endian<std::uint8_t>({1, 2, 3}))));
    check(decoded(fits_of(all(16), big_endian<std::int16_t>({1, -2, 3}))));
    check(decoded(fits_of(all(32), big_endian<std::int32_t>({1, -2, 3}))));
    check(decoded(fits_of(all(-32), big_endian<float>({1, -2, 3}))));
    check(decoded(fits_of(all(-64), big_endian<double>({1, -2, 3}))));
    auto with_blank = all(16);
    with_blank.emplace_back("BLANK   =                   -2");
    EXPECT_TRUE(
        std::isnan(decoded(fits_of(with_blank, big_endian<std::int16_t>({1, -2, 3}))).pixels.at(1, 0)));
  }
}

TEST_F(Photograph, ReadsFitsWhoseImageIsInAnExtension) {
  const std::string first = fits_of({"SIMPLE  =                    T", "BITPIX  =                    8",
                                     "NAXIS   =                    0", "EXTEND  =                    T"},
                                    "");
  const std::string second =
      fits_of({"XTENSION= 'IMAGE   '", "BITPIX  =                   16", "NAXIS   =                    2",
               "NAXIS1  =                    2", "NAXIS2  =                    1",
               "PCOUNT  =                    0", "GCOUNT  =                    1"},
              big_endian<std::int16_t>({7, 9}));
  EXPECT_EQ(decoded(first + second).pixels.at(1, 0), 9);
}

TEST_F(Photograph, ReadsTiffOf16BitsAndFloatInStripsAndTiles) {
  for (const int bits : {16, 32}) {
    for (const bool tiled : {false, true}) {
      write_tiff(path("a.tif"), bits, tiled);
      expect_ramp(read_photograph(path("a.tif")));
    }
  }
}

TEST_F(Photograph, ReadsPngOf16Bits) {
  write_png16(path("a.png"));
  expect_ramp(read_photograph(path("a.png")));
}

TEST_F(Photograph, ReadsJpeg) {
  write_jpeg(path("a.jpg"), 33, 17);
  const auto frame = read_photograph(path("a.jpg"));
  ASSERT_TRUE(frame) << frame.error().reason;
  EXPECT_EQ(frame->pixels.width(), 33);
  EXPECT_EQ(frame->pixels.height(), 17);
  EXPECT_NEAR(frame->pixels.at(20, 10), 77, 1);
}

TEST_F(Photograph, RefusesWhatIsNoImageFileAndSaysWhy) {
  EXPECT_THAT(read_photograph(path("none.fits")).error().reason, HasSubstr("cannot open"));
  EXPECT_THAT(read_photograph(path(".")).error().reason, HasSubstr("not a file"));
  EXPECT_THAT(read_photograph("/dev/zero").error().reason, HasSubstr("not a file"));
  EXPECT_THAT(refusal(""), HasSubstr("empty"));
  EXPECT_THAT(refusal("hello"), HasSubstr("neither FITS"));
}

TEST_F(Photograph, RefusesHeadersThatAnnounceMoreThanTheFileHas) {
  ASSERT_TRUE(write_fits(path("a.fits"), ramp()));
  const std::string good = read_file(path("a.fits")).value();
  const auto with = [&](std::string_view card, std::string_view value) {
    std::string content = good;
    const auto at = content.find(card);
    content.replace(at + 10, 20, fmt::format("{:>20}", value));
    return refusal(content);
  };
  EXPECT_THAT(with("NAXIS1", "9000"), HasSubstr("announces"));
  EXPECT_THAT(with("NAXIS1", "90000000"), HasSubstr("more than 100 million"));
  EXPECT_THAT(with("NAXIS1", "0"), HasSubstr("no image"));
  EXPECT_NE(with("NAXIS1", "-5"), "");
  EXPECT_NE(with("NAXIS1", "'twelve'"), "");
  EXPECT_NE(with("NAXIS ", "0"), "");
  EXPECT_NE(with("NAXIS ", "7"), "");
  EXPECT_NE(with("BITPIX", "11"), "");
}

TEST_F(Photograph, RefusesFilesThatAreCutShortOfEveryFormat) {
  ASSERT_TRUE(write_fits(path("a.fits"), ramp()));
  write_tiff(path("a.tif"), 16, false);
  write_png16(path("a.png"));
  write_jpeg(path("a.jpg"), 64, 64);
  for (const char* name : {"a.fits", "a.tif", "a.png", "a.jpg"}) {
    std::string content = read_file(path(name)).value();
    content.resize(content.size() / 2);
    EXPECT_NE(refusal(content), "") << name;
    content.resize(12);
    EXPECT_NE(refusal(content), "") << name;
  }
}

TEST_F(Photograph, WhereMemoryIsCappedLargerFramesAreRefusedInEveryFormat) {
  ASSERT_TRUE(write_fits(path("a.fits"), ramp()));
  ASSERT_TRUE(write_png(path("a.png"), Grid<std::uint8_t>(12, 9, 7)));
  write_tiff(path("a.tif"), 16, false);
  {
    const FramePixelsLimit limit(12 * 9 - 1);
    for (const char* name : {"a.fits", "a.png", "a.tif"}) {
      const auto frame = read_photograph(path(name));
      ASSERT_FALSE(frame) << name;
      EXPECT_THAT(frame.error().reason, HasSubstr("12 x 9 pixels: more than")) << name;
    }
  }
  EXPECT_TRUE(read_photograph(path("a.fits")));
}

Frame picture(std::vector<float> values, float step) {
  Frame frame;
  frame.pixels = Plane(static_cast<int>(values.size()), 1);
  std::copy(values.begin(), values.end(), frame.pixels.cells().begin());
  frame.step = step;
  return frame;
}

TEST(In16Bits, KeepsWholeValuesAndSpreadsOthers) {
  EXPECT_THAT(in_16_bits(picture({0, 7, 65535}, 1)).pixels.cells(), ElementsAre(0, 7, 65535));
  EXPECT_THAT(in_16_bits(picture({0, 0.5F, 1}, 0)).pixels.cells(), ElementsAre(0, 32768, 65535));
  EXPECT_THAT(in_16_bits(picture({-1, 0, 1}, 1)).pixels.cells(), ElementsAre(0, 32768, 65535));
  EXPECT_THAT(in_16_bits(picture({0, 131070}, 1)).pixels.cells(), ElementsAre(0, 65535));
  EXPECT_THAT(in_16_bits(picture({3, 3}, 0)).pixels.cells(), ElementsAre(0, 0));
  EXPECT_THAT(in_16_bits(picture({std::nanf(""), 5, 9}, 1)).pixels.cells(), ElementsAre(5, 5, 9));
  EXPECT_THAT(in_16_bits(picture({std::nanf("")}, 1)).pixels.cells(), ElementsAre(0));
}

}  // namespace
}  // namespace srfs::image
