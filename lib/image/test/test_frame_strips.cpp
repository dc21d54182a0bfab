// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/product/frame_strips.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include <gmock/gmock.h>

#include "lib/image/test/skies.hpp"

namespace srfs::image {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

Frame noise(int width, int height, int bits, std::uint64_t seed = 1) {
  std::mt19937_64 random(seed);
  Frame frame;
  frame.pixels = Plane(width, height);
  for (float& v : frame.pixels.cells()) v = static_cast<float>(random() >> (64 - bits));
  return frame;
}

/// Size in octets of the strip that begins at @p at.
std::size_t strip_octets(const Octets& file, std::size_t at) {
  OctetReader r(OctetView(file).subspan(at + strip_header_octets - 8));
  return strip_overhead_octets + r.u32();
}

std::vector<std::size_t> strip_begins(const Octets& file) {
  std::vector<std::size_t> begins;
  for (std::size_t at = 0; at < file.size(); at += strip_octets(file, at)) begins.push_back(at);
  return begins;
}

/// Checks that each strip is either unchanged or missing, and that missing strips have no values.
void expect_rows(const Frame& frame, const StripsFound& found) {
  ASSERT_EQ(found.frame.pixels.width(), frame.pixels.width());
  ASSERT_EQ(found.frame.pixels.height(), frame.pixels.height());
  std::vector<bool> missing(found.strips, false);
  for (const std::uint32_t i : found.missing) missing[i] = true;
  for (int y = 0; y < frame.pixels.height(); ++y) {
    const bool none = missing[static_cast<std::uint32_t>(y) / found.rows];
    for (int x = 0; x < frame.pixels.width(); ++x) {
      const float v = found.frame.pixels.at(x, y);
      if (none ? !std::isnan(v) : v != frame.pixels.at(x, y)) {
        ADD_FAILURE() << "pixel (" << x << ", " << y << ") is " << v;
        return;
      }
    }
  }
}

void expect_same(const Frame& frame) {
  const auto strips = encode_strips(frame);
  ASSERT_TRUE(strips) << strips.error().reason;
  const auto found = decode_strips(*strips);
  ASSERT_TRUE(found) << found.error().reason;
  EXPECT_THAT(found->missing, IsEmpty());
  EXPECT_EQ(found->damaged, 0U);
  EXPECT_EQ(found->octets_skipped, 0U);
  expect_rows(frame, *found);
}

TEST(FrameStrips, GiveBackFramesOfEverySizeAndDepth) {
  for (const auto& [width, height] :
       {std::pair(1, 1), {1, 700}, {700, 1}, {33, 65}, {200, 150}, {40000, 3}}) {
    for (int bits = 1; bits <= 16; ++bits) expect_same(noise(width, height, bits));
  }
}

TEST(FrameStrips, GiveBackSkiesWithTheirTimeAndSaturation) {
  hw_sim::SkyScene scene = small_scene(3);
  scene.adu_step = 16;
  Frame frame = frame_of(scene, {{100, 60, 1e5}});
  frame.time_s = 1795334400.25;
  frame.saturation_adu = 65520;

  const Octets strips = encode_strips(frame).value();
  const StripsFound found = decode_strips(strips).value();

  expect_rows(frame, found);
  EXPECT_EQ(found.frame.time_s, frame.time_s);
  EXPECT_EQ(found.frame.saturation_adu, frame.saturation_adu);
  EXPECT_EQ(found.frame.step, 16);
  EXPECT_FALSE(decode_strips(encode_strips(noise(5, 5, 8)).value())->frame.time_s);
}

TEST(FrameStrips, OfFramesWithoutAPatternOrWithoutLightAreNotMuchLarger) {
  EXPECT_LT(encode_strips(noise(640, 480, 16))->size(), 640U * 480 * 2 * 103 / 100);
  Frame dark;
  dark.pixels = Plane(640, 480, 0.0F);
  EXPECT_LT(encode_strips(dark)->size(), 3000U);
  expect_same(dark);
  Frame white;
  white.pixels = Plane(640, 480, 65535.0F);
  expect_same(white);
}

TEST(FrameStrips, AreRefusedForPixelsThatAreNotWholeNumbersOf16Bits) {
  for (const float v : {0.5F, -1.0F, 65536.0F, 1e30F, std::numeric_limits<float>::quiet_NaN(),
                        std::numeric_limits<float>::infinity()}) {
    Frame frame = noise(20, 20, 12);
    frame.pixels.at(19, 19) = v;
    const auto strips = encode_strips(frame);
    ASSERT_FALSE(strips) << v;
    EXPECT_THAT(strips.error().reason, HasSubstr("whole numbers"));
  }
  EXPECT_FALSE(encode_strips(Frame{}));
}

TEST(FrameStrips, ALostStripIsNamedAndTheOthersStay) {
  const Frame frame = noise(700, 400, 12);
  const Octets file = encode_strips(frame).value();
  const auto begins = strip_begins(file);
  ASSERT_GT(begins.size(), 5U);
  Octets holed(file.begin(), file.begin() + static_cast<std::ptrdiff_t>(begins[2]));
  holed.insert(holed.end(), file.begin() + static_cast<std::ptrdiff_t>(begins[4]), file.end());

  const StripsFound found = decode_strips(holed).value();

  EXPECT_THAT(found.missing, ElementsAre(2U, 3U));
  EXPECT_EQ(found.strips, begins.size());
  EXPECT_EQ(found.damaged, 0U);
  expect_rows(frame, found);
}

TEST(FrameStrips, AreFoundInWhateverOrderAndMoreThanOnce) {
  const Frame frame = noise(700, 200, 12);
  const Octets file = encode_strips(frame).value();
  const auto begins = strip_begins(file);
  Octets mixed(10, 0x53);
  for (std::size_t k = begins.size(); k-- > 0;) {
    const auto from = file.begin() + static_cast<std::ptrdiff_t>(begins[k]);
    for (int times = 0; times < 2; ++times)
      mixed.insert(mixed.end(), from, from + static_cast<std::ptrdiff_t>(strip_octets(file, begins[k])));
    mixed.push_back(0x53);
  }
  const StripsFound found = decode_strips(mixed).value();
  EXPECT_THAT(found.missing, IsEmpty());
  EXPECT_EQ(found.octets_skipped, 10 + begins.size());
  expect_rows(frame, found);
}

TEST(FrameStrips, OfAnotherFrameAreNotTaken) {
  const Frame frame = noise(300, 300, 12);
  Octets file = encode_strips(frame).value();
  const std::size_t own = file.size();
  const Octets other = encode_strips(noise(300, 301, 12, 2)).value();
  file.insert(file.end(), other.begin(), other.end());

  const StripsFound found = decode_strips(file).value();

  EXPECT_EQ(found.octets_skipped, file.size() - own);
  expect_rows(frame, found);
}

/// After any damage to a piece of the file, each strip shows the frame or nothing. At most the strips that
/// the piece touches are missing.
TEST(FrameStrips, DamageSpoilsTheStripsItTouchesAndNoOther) {
  std::mt19937_64 random(7);
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  const Frame frame = noise(500, 400, 10, 9);
  const Octets file = encode_strips(frame).value();
  const auto begins = strip_begins(file);
  const auto strip_at = [&](std::size_t octet) {
    return static_cast<std::uint32_t>(std::upper_bound(begins.begin(), begins.end(), octet) - begins.begin() -
                                      1);
  };
  for (int trial = 0; trial < 300; ++trial) {
    Octets damaged = file;
    const std::size_t from = below(file.size());
    const std::size_t length = std::min(1 + below(trial % 3 == 0 ? 30000 : 1100), file.size() - from);
    const auto begin = damaged.begin() + static_cast<std::ptrdiff_t>(from);
    const auto end = begin + static_cast<std::ptrdiff_t>(length);
    switch (trial % 5) {
      case 0:
        std::fill(begin, end, std::uint8_t{0});
        break;
      case 1:
        damaged.erase(begin, end);
        break;
      case 2:
        damaged.erase(begin, damaged.end());
        break;
      case 3:
        damaged[from] ^= static_cast<std::uint8_t>(1U << below(8));
        break;
      default:
        std::generate(begin, end, [&] { return static_cast<std::uint8_t>(random()); });
    }
    const std::size_t last = trial % 5 == 2 ? file.size() - 1 : trial % 5 == 3 ? from : from + length - 1;
    const std::uint32_t first_touched = strip_at(from);
    const std::uint32_t last_touched = strip_at(last);

    const auto found = decode_strips(damaged);
    if (!found) {
      EXPECT_EQ(last_touched - first_touched + 1, begins.size()) << trial << ": " << found.error().reason;
      continue;
    }
    for (const std::uint32_t i : found->missing) {
      EXPECT_GE(i, first_touched) << trial;
      EXPECT_LE(i, last_touched) << trial;
    }
    expect_rows(frame, *found);
    if (HasFailure()) FAIL() << "trial " << trial;
  }
}

TEST(FrameStrips, SayWhyThereIsNoFrame) {
  EXPECT_THAT(decode_strips({}).error().reason, HasSubstr("no strip begins"));
  Octets file = encode_strips(noise(30, 30, 12)).value();
  file.back() ^= 1;
  EXPECT_THAT(decode_strips(file).error().reason, HasSubstr("none of the strips is sound"));

  const Octets large = encode_strips(noise(30, 30, 12)).value();
  const FramePixelsLimit limit(100);
  EXPECT_FALSE(decode_strips(large));
  EXPECT_FALSE(encode_strips(noise(11, 10, 12)));
  EXPECT_TRUE(encode_strips(noise(10, 10, 12)));
}

}  // namespace
}  // namespace srfs::image
