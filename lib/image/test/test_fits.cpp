// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/file/fits.hpp"

#include <array>
#include <random>

#include <fitsio.h>
#include <fmt/format.h>
#include <gmock/gmock.h>

#include "base/file.hpp"
#include "base/text.hpp"
#include "image/file/frame_file.hpp"
#include "image/file/rice.hpp"
#include "image/photograph/decoders.hpp"
#include "image/test/ramp.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::image {
namespace {

using testing::HasSubstr;
using Pixels = Grid<std::uint16_t>;

constexpr std::size_t block = 2880;

std::string text_of(const Octets& octets) {
  return {octets.begin(), octets.end()};
}

std::string refusal(const std::string& content) {
  const auto frame = decode_fits(as_octets(content));
  return frame ? "" : frame.error().reason;
}

/// A file with the value of a key replaced.
std::string with(std::string content, const std::string& key, const std::string& value) {
  const auto at = content.find(fmt::format("{:<8}= ", key));
  EXPECT_NE(at, std::string::npos) << key;
  return content.replace(at + 10, 70, fmt::format("{:<70}", value));
}

/// Noise of so many bits on a level.
Pixels noise(int width, int height, int bits, std::uint16_t level = 500) {
  std::mt19937 random(static_cast<unsigned>(width * 31 + bits));
  Pixels pixels(width, height);
  for (auto& v : pixels.cells()) v = static_cast<std::uint16_t>(level + (random() & ((1U << bits) - 1)));
  return pixels;
}

/// Rows of different kinds: constant, steps, spikes, noise that does not pack.
std::vector<Pixels> samples() {
  std::vector<Pixels> all;
  for (const int width : {1, 2, 31, 32, 33, 300}) {
    for (const int bits : {0, 1, 3, 6, 12, 14, 15, 16}) all.push_back(noise(width, 3, bits));
    Pixels spikes(width, 2, std::uint16_t{900});
    for (int x = 0; x < width; x += 29) spikes.at(x, 1) = x % 2 == 0 ? 65535 : 0;
    all.push_back(spikes);
  }
  return all;
}

/// The same image by cfitsio.
std::string packed_by_cfitsio(const Pixels& pixels) {
  void* memory = nullptr;
  std::size_t size = 0;
  int status = 0;
  fitsfile* file = nullptr;
  std::array<long, 2> axes{pixels.width(), pixels.height()};
  fits_create_memfile(&file, &memory, &size, 1 << 20, std::realloc, &status);
  fits_set_compression_type(file, RICE_1, &status);
  fits_create_img(file, USHORT_IMG, 2, axes.data(), &status);
  Pixels copy = pixels;
  fits_write_img(file, TUSHORT, 1, static_cast<LONGLONG>(copy.size()), copy.cells().data(), &status);
  fits_flush_file(file, &status);
  LONGLONG header = 0, data = 0, end = 0;
  fits_get_hduaddrll(file, &header, &data, &end, &status);
  fits_close_file(file, &status);
  EXPECT_EQ(status, 0);
  std::string content(static_cast<const char*>(memory), static_cast<std::size_t>(end));
  std::free(memory);
  return content;
}

std::string packed(const Pixels& pixels, const std::vector<FitsCard>& cards = {}) {
  return text_of(encode_packed_fits(pixels, cards).value());
}

/// What follows the second header.
std::string table_of(const std::string& content) {
  const auto end = content.find(fmt::format("{:<80}", "END"), content.find("XTENSION"));
  return content.substr((end / block + 1) * block);
}

void expect_pixels(const Result<Frame, Refusal>& frame, const Pixels& pixels) {
  ASSERT_TRUE(frame) << frame.error().reason;
  ASSERT_EQ(frame->pixels.width(), pixels.width());
  ASSERT_EQ(frame->pixels.height(), pixels.height());
  for (std::size_t i = 0; i < pixels.size(); ++i)
    ASSERT_EQ(frame->pixels.cells()[i], static_cast<float>(pixels.cells()[i])) << i;
}

TEST(Fits, ReadsWhatItWrotePlain) {
  const Octets file = encode_fits(ramp());
  EXPECT_EQ(file.size() % block, 0U);
  const auto frame = decode_fits(file);
  expect_ramp(frame);
  EXPECT_EQ(frame->step, 1);
  EXPECT_FALSE(frame->time_s);
  EXPECT_FALSE(frame->saturation_adu);
}

TEST(Fits, CfitsioReadsWhatItWrotePlain) {
  expect_ramp(decode_any_fits(encode_fits(ramp())));
}

TEST(Fits, PacksRowsToTheSameOctetsAsCfitsio) {
  for (const Pixels& pixels : samples())
    EXPECT_TRUE(table_of(packed(pixels)) == table_of(packed_by_cfitsio(pixels))) << pixels.width();
}

TEST(Fits, ReadsWhatCfitsioPackedAndCfitsioReadsWhatItPacked) {
  for (const Pixels& pixels : samples()) {
    expect_pixels(decode_fits(as_octets(packed_by_cfitsio(pixels))), pixels);
    expect_pixels(decode_any_fits(as_octets(packed(pixels))), pixels);
    expect_pixels(decode_fits(as_octets(packed(pixels))), pixels);
  }
}

TEST(Fits, CardsAreReadByCfitsioAsTheyWereGiven) {
  const std::vector<FitsCard> cards{{"ORIGIN", std::string("SRFS"), "who"},
                                    {"QUOTES", std::string("it's 'quoted'")},
                                    {"LONG", std::string(100, '\'')},
                                    {"TINY", 1.25e-7, "small"},
                                    {"THIRD", 1.0 / 3},
                                    {"TASK", std::int64_t{-7}, std::string(90, 'c')},
                                    {"NONE", std::nan("")},
                                    {"FLAG", true}};
  std::string content = packed(noise(40, 5, 4), cards);
  for (std::size_t at = 0; at < content.find("END  ", content.find("XTENSION")); at += 80)
    EXPECT_EQ(content.substr(at, 80).find_first_not_of(
                  " !\"#$%&'()*+,-./0123456789:;<=>?@ABCDEFGHIJKLMNOPQRSTUVWXYZ"
                  "[]^_`abcdefghijklmnopqrstuvwxyz{|}~"),
              std::string::npos);
  int status = 0;
  fitsfile* file = nullptr;
  void* memory = content.data();
  std::size_t size = content.size();
  ASSERT_EQ(fits_open_memfile(&file, "frame", READONLY, &memory, &size, 0, nullptr, &status), 0);
  fits_movabs_hdu(file, 2, nullptr, &status);
  const auto text = [&](const char* key) {
    std::array<char, FLEN_VALUE> value{};
    EXPECT_EQ(fits_read_key(file, TSTRING, key, value.data(), nullptr, &status), 0) << key;
    return std::string(value.data());
  };
  const auto number = [&](const char* key) {
    double value = 0;
    EXPECT_EQ(fits_read_key(file, TDOUBLE, key, &value, nullptr, &status), 0) << key;
    return value;
  };
  EXPECT_EQ(text("ORIGIN"), "SRFS");
  EXPECT_EQ(text("QUOTES"), "it's 'quoted'");
  EXPECT_EQ(text("LONG"), std::string(34, '\''));
  EXPECT_EQ(number("TINY"), 1.25e-7);
  EXPECT_EQ(number("THIRD"), 1.0 / 3);
  EXPECT_EQ(number("TASK"), -7);
  int flag = 0;
  EXPECT_EQ(fits_read_key(file, TLOGICAL, "FLAG", &flag, nullptr, &status), 0);
  EXPECT_EQ(flag, 1);
  double none = 0;
  EXPECT_EQ(fits_read_key(file, TDOUBLE, "NONE", &none, nullptr, &status), VALUE_UNDEFINED);
  status = 0;
  fits_close_file(file, &status);
  fits_clear_errmsg();
}

TEST(Fits, KeepsTheExposureTheDetectorsSettingAndWherePixelsAreSaturated) {
  const testing_support::TemporaryFolder folder;
  Frame frame;
  frame.pixels = ramp();
  frame.time_s = 1795334400.25;
  frame.exposure_s = 0.25;
  frame.gain = 6.5;
  frame.temperature_k = 283.25;
  frame.saturation_adu = 4095;
  ASSERT_TRUE(write_fits(folder.path() / "dated.fits", frame));

  const auto found = read_frame(folder.path() / "dated.fits");
  expect_ramp(found);
  EXPECT_EQ(found->time_s, frame.time_s);
  EXPECT_EQ(found->exposure_s, frame.exposure_s);
  EXPECT_EQ(found->gain, frame.gain);
  EXPECT_NEAR(found->temperature_k.value_or(0), 283.25, 1e-9);
  EXPECT_EQ(found->saturation_adu, frame.saturation_adu);
}

TEST(Fits, RefusesWhatIsNoFitsFileAndSaysWhy) {
  const testing_support::TemporaryFolder folder;
  EXPECT_THAT(read_frame(folder.path() / "none.fits").error().reason, HasSubstr("cannot open"));
  EXPECT_THAT(read_frame(folder.path()).error().reason, HasSubstr("not a file"));
  EXPECT_THAT(read_frame("/dev/zero").error().reason, HasSubstr("not a file"));
  EXPECT_THAT(refusal(""), HasSubstr("empty"));
  for (const char* other : {"hello", "SIMPLE", "\x89PNG\r\n\x1a\n", "\xff\xd8\xff\xe0", "II*", "MM"})
    EXPECT_THAT(refusal(other), HasSubstr("not a FITS file; srfs-product makes one")) << other;
}

TEST(Fits, RefusesPlainFilesOfOtherKindsAndThoseThatAnnounceMoreThanTheyHave) {
  const std::string good = text_of(encode_fits(ramp()));
  ASSERT_EQ(refusal(good), "");
  EXPECT_THAT(refusal(with(good, "NAXIS1", "9000")), HasSubstr("announces"));
  EXPECT_THAT(refusal(with(good, "NAXIS1", "90000000")), HasSubstr("more than 100 million"));
  EXPECT_THAT(refusal(with(good, "NAXIS1", "9223372036854775807")), HasSubstr("more than"));
  EXPECT_THAT(refusal(with(good, "NAXIS1", "0")), HasSubstr("no image"));
  EXPECT_THAT(refusal(with(good, "NAXIS2", "-5")), HasSubstr("no image"));
  EXPECT_THAT(refusal(with(good, "NAXIS1", "'twelve'")), HasSubstr("no image"));
  EXPECT_THAT(refusal(with(good, "NAXIS", "0")), HasSubstr("FITS: "));
  EXPECT_THAT(refusal(with(good, "NAXIS", "7")), HasSubstr("7 axes"));
  EXPECT_THAT(refusal(with(good, "BITPIX", "-32")), HasSubstr("-32 bits"));
  EXPECT_THAT(refusal(with(good, "BSCALE", "2.0D0")), HasSubstr("BSCALE"));
  EXPECT_THAT(refusal(with(good, "BZERO", "NaN")), HasSubstr("BZERO"));
  EXPECT_THAT(refusal(with(good, "SIMPLE", "F")), HasSubstr("SIMPLE"));
  EXPECT_THAT(refusal(std::string(good).replace(good.find("BSCALE"), 6, "BLANK ")), HasSubstr("BLANK"));
  EXPECT_THAT(refusal(good.substr(0, 400)), HasSubstr("END"));
  EXPECT_THAT(refusal(good.substr(0, block)), HasSubstr("announces"));
  EXPECT_THAT(refusal(good.substr(0, 80) + std::string(1 << 20, ' ')), HasSubstr("END"));
}

TEST(Fits, RefusesPackedFilesOfOtherKindsAndDamagedOnes) {
  const std::string good = packed(noise(300, 5, 6));
  ASSERT_EQ(refusal(good), "");
  for (const auto& [key, value, why] :
       std::vector<std::array<const char*, 3>>{{"XTENSION", "'IMAGE'", "neither"},
                                               {"ZIMAGE", "F", "neither"},
                                               {"ZBITPIX", "-32", "bits"},
                                               {"ZNAXIS", "3", "axes"},
                                               {"ZNAXIS1", "90000000", "more than"},
                                               {"ZNAXIS1", "301", "rows"},
                                               {"ZNAXIS2", "6", "rows"},
                                               {"ZTILE1", "0", "rows"},
                                               {"ZTILE1", "30", "rows"},
                                               {"ZTILE2", "2", "rows"},
                                               {"ZCMPTYPE", "'GZIP_1'", "otherwise"},
                                               {"ZVAL1", "0", "parameters"},
                                               {"ZVAL1", "16", "parameters"},
                                               {"ZVAL2", "4", "parameters"},
                                               {"ZNAME1", "'ZVAL'", "parameters"},
                                               {"TFIELDS", "2", "columns"},
                                               {"TFORM1", "'1QB(40)'", "columns"},
                                               {"NAXIS1", "16", "columns"},
                                               {"NAXIS2", "99999999", "columns"}})
    EXPECT_THAT(refusal(with(good, key, value)), HasSubstr(why)) << key << " " << value;
  const std::string wide = with(with(good, "ZNAXIS1", "19000000"), "ZTILE1", "19000000");
  EXPECT_THAT(refusal(wide), HasSubstr("announces 19000000 x 5 pixels"));
  EXPECT_THAT(refusal(good.substr(0, block)), HasSubstr("no image"));
  EXPECT_THAT(refusal(good.substr(0, block + 1000)), HasSubstr("END"));
  const std::size_t table = good.size() - table_of(good).size();
  EXPECT_THAT(refusal(good.substr(0, table + 20)), HasSubstr("announces"));
  EXPECT_THAT(refusal(good.substr(0, table + 100)), HasSubstr("row 0 is beyond the end"));
  for (const std::size_t octet : {0, 4}) {
    std::string damaged = good;
    damaged[table + octet] = '\xff';
    EXPECT_THAT(refusal(damaged), HasSubstr("row 0 is beyond the end"));
  }
  std::string shorter = good;
  shorter[table + 3] = 5;
  EXPECT_THAT(refusal(shorter), HasSubstr("row 0 is damaged"));
}

TEST(Fits, WhereMemoryIsCappedLargerFramesAreRefused) {
  const std::string plain = text_of(encode_fits(ramp()));
  const std::string rows = packed(noise(12, 9, 3));
  {
    const FramePixelsLimit limit(12 * 9 - 1);
    EXPECT_THAT(refusal(plain), HasSubstr("12 x 9 pixels: more than"));
    EXPECT_THAT(refusal(rows), HasSubstr("12 x 9 pixels: more than"));
  }
  EXPECT_EQ(refusal(plain), "");
  EXPECT_EQ(refusal(rows), "");
}

TEST(Fits, EveryCutFileIsRefusedAndEveryChangedOneGivesAFrameOrAReason) {
  const std::string good = packed(noise(40, 6, 5));
  const std::size_t table = good.size() - table_of(good).size();
  OctetReader last_row(as_octets(good).subspan(table + 5 * 8, 8));
  const std::size_t octets = last_row.u32();
  const std::size_t used = table + 6 * 8 + last_row.u32() + octets;
  for (std::size_t n = 0; n < used; n += 7) EXPECT_NE(refusal(good.substr(0, n)), "") << n;
  std::mt19937 random(4);
  for (int i = 0; i < 3000; ++i) {
    std::string changed = good;
    for (unsigned k = 0; k < 1 + random() % 4; ++k)
      changed[random() % changed.size()] = static_cast<char>(random());
    const auto frame = decode_fits(as_octets(changed));
    if (frame) {
      EXPECT_FALSE(refuse_size(frame->pixels.width(), frame->pixels.height()));
    } else {
      EXPECT_NE(frame.error().reason, "");
    }
  }
}

}  // namespace
}  // namespace srfs::image
