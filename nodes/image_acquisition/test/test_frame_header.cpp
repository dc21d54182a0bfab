// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_acquisition/frame_header.hpp"

#include <gtest/gtest.h>

#include "image/file/fits.hpp"
#include "image/file/frame_file.hpp"

namespace srfs {
namespace {

hw::CameraFrame frame() {
  hw::CameraFrame f;
  f.pixels = image::Grid<std::uint16_t>(64, 48, std::uint16_t{100});
  f.pixels.at(3, 2) = 4095;
  f.pixels.at(63, 47) = 5;
  f.bits = 12;
  f.sequence = 8;
  f.settings = {milliseconds(250), 6.5};
  f.temperature_k = 283.15;
  f.saturation_adu = 4095;
  return f;
}

FrameFacts facts() {
  FrameFacts known;
  known.task = 17;
  known.number = 2;
  known.camera = "a camera\nwith ümlaut";
  known.instrument = "SRFS";
  known.begin = from_iso8601("2026-11-22T07:52:30.25Z");
  known.start_error_us = 85;
  known.attitude = FrameFacts::Attitude{{0.1F, 0.2F, 0.3F, 0.9F}, 0.5};
  return known;
}

template <class T>
std::optional<T> value(const std::vector<image::FitsCard>& cards, const std::string& key) {
  for (const image::FitsCard& card : cards) {
    if (card.key == key) return std::get<T>(card.value);
  }
  return std::nullopt;
}

TEST(FrameHeader, SaysWhatIsKnown) {
  const auto cards = frame_header(frame(), facts());
  EXPECT_EQ(value<std::string>(cards, "DATE-OBS"), "2026-11-22T07:52:30.250000");
  EXPECT_EQ(value<double>(cards, "EXPTIME"), 0.25);
  EXPECT_EQ(value<double>(cards, "GAIN"), 6.5);
  EXPECT_EQ(value<std::int64_t>(cards, "TASK"), 17);
  EXPECT_EQ(value<std::int64_t>(cards, "FRAME"), 2);
  EXPECT_EQ(value<std::int64_t>(cards, "SATURATE"), 4095);
  EXPECT_EQ(value<std::int64_t>(cards, "DATAMAX"), 4095);
  EXPECT_EQ(value<std::int64_t>(cards, "DATAMIN"), 5);
  EXPECT_NEAR(value<double>(cards, "CCD-TEMP").value(), 10, 1e-9);
  EXPECT_NEAR(value<double>(cards, "ATT-W").value(), 0.9, 1e-6);
  EXPECT_EQ(value<std::string>(cards, "CAMERA"), "a camera?with ??mlaut");
}

TEST(FrameHeader, LeavesOutWhatIsNotKnown) {
  hw::CameraFrame f = frame();
  f.temperature_k.reset();
  f.saturation_adu.reset();
  FrameFacts unknown = facts();
  unknown.begin.reset();
  unknown.attitude.reset();
  const auto cards = frame_header(f, unknown);
  for (const char* key : {"DATE-OBS", "TIMESYS", "CCD-TEMP", "SATURATE", "ATT-X"}) {
    for (const image::FitsCard& card : cards) EXPECT_NE(card.key, key);
  }
}

TEST(FrameHeader, MakesAFileThatReadsAsTheFrameItWas) {
  const hw::CameraFrame f = frame();
  const auto file = image::encode_packed_fits(f.pixels, frame_header(f, facts()));
  ASSERT_TRUE(file) << file.error().reason;
  EXPECT_EQ(file->size() % 2880, 0U);
  const auto read = image::decode_fits(*file);
  ASSERT_TRUE(read) << read.error().reason;
  ASSERT_EQ(read->pixels.width(), 64);
  ASSERT_EQ(read->pixels.height(), 48);
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) ASSERT_EQ(read->pixels.at(x, y), static_cast<float>(f.pixels.at(x, y)));
  }
  EXPECT_EQ(read->saturation_adu, 4095.0F);
  EXPECT_EQ(read->step, 1.0F);
  EXPECT_NEAR(read->time_s.value(), static_cast<double>(facts().begin->ns()) * 1e-9, 1e-6);
}

TEST(FrameHeader, MakesTheSameFileWhateverTheMemoryHeldBefore) {
  const hw::CameraFrame f = frame();
  const auto first = image::encode_packed_fits(f.pixels, frame_header(f, facts()));
  ASSERT_TRUE(first);
  for (int i = 0; i < 20; ++i) {
    const auto again = image::encode_packed_fits(f.pixels, frame_header(f, facts()));
    ASSERT_TRUE(again) << again.error().reason;
    ASSERT_EQ(again->size(), first->size());
  }
}

TEST(FrameHeader, FitsAreSmallerThanTheirPixels) {
  hw::CameraFrame f = frame();
  f.pixels = image::Grid<std::uint16_t>::unset(640, 480);
  std::uint32_t noise = 1;
  for (std::uint16_t& v : f.pixels.cells()) {
    noise = noise * 1664525 + 1013904223;
    v = static_cast<std::uint16_t>(300 + (noise >> 28));
  }
  const auto file = image::encode_packed_fits(f.pixels, frame_header(f, facts()));
  ASSERT_TRUE(file);
  EXPECT_LT(file->size(), f.pixels.size());
  EXPECT_FALSE(image::encode_packed_fits({}, {})) << "a frame without pixels";
}

}  // namespace
}  // namespace srfs
