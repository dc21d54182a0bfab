// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/method.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gmock/gmock.h>

#include "lib/image/test/skies.hpp"

namespace srfs::image {
namespace {

using testing::HasSubstr;

constexpr std::array specs{ParameterSpec{"threshold", 5, 1, 10, ""}, ParameterSpec{"size", 3, 0, 100, ""}};

std::string refusal_of(const std::vector<std::string>& given) {
  const auto parameters = Parameters::parse(specs, given);
  return parameters ? "" : parameters.error().reason;
}

TEST(MethodParameters, AreTheStandardOnesUnlessGiven) {
  const auto parameters = Parameters::parse(specs, std::vector<std::string>{"size=7.5"});
  ASSERT_TRUE(parameters);
  EXPECT_EQ((*parameters)["threshold"], 5);
  EXPECT_EQ((*parameters)["size"], 7.5);
}

TEST(MethodParameters, AreRefusedWithTheReason) {
  EXPECT_THAT(refusal_of({"sise=7"}), HasSubstr("no parameter 'sise'; available: threshold, size"));
  EXPECT_THAT(refusal_of({"size"}), HasSubstr("size=NUMBER"));
  EXPECT_THAT(refusal_of({"size=7x"}), HasSubstr("'7x' is not a number"));
  EXPECT_THAT(refusal_of({"size="}), HasSubstr("not a number"));
  EXPECT_THAT(refusal_of({"size=nan"}), HasSubstr("not a number"));
  EXPECT_THAT(refusal_of({"threshold=11"}), HasSubstr("not within 1 to 10"));
  EXPECT_THAT(refusal_of({"size=1", "size=2"}), HasSubstr("given twice"));
}

TEST(Methods, AreFoundByNameOrTheOnesThereAreAreNamed) {
  EXPECT_TRUE(find_method("star_centroid"));
  const auto unknown = find_method("stars");
  ASSERT_FALSE(unknown);
  EXPECT_THAT(unknown.error().reason,
              HasSubstr("no method 'stars'; available: star_centroid, streak, tracklet"));
}

/// An odd frame, as from a camera, a broken file or a practical joker.
Frame odd_frame(const std::string& kind) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  constexpr float infinity = std::numeric_limits<float>::infinity();
  Frame frame;
  frame.pixels = Plane(kind == "one pixel" ? 1
                       : kind == "one row" ? 300
                       : kind == "two"     ? 2
                                           : 90,
                       kind == "one pixel" || kind == "one row" ? 1
                       : kind == "one column"                   ? 400
                                                                : 70,
                       0.0F);
  if (kind == "one column") frame.pixels = Plane(1, 400, 7.0F);
  auto& cells = frame.pixels.cells();
  std::uint32_t state = 1;
  for (float& v : cells) {
    state = state * 1664525U + 1013904223U;
    const float random = static_cast<float>(state >> 8) / 16777216.0F;
    if (kind == "white") v = 65535;
    if (kind == "no value") v = nan;
    if (kind == "infinite") v = infinity;
    if (kind == "half without a value") v = random < 0.5F ? nan : 100 + random;
    if (kind == "beyond all scales") v = (random - 0.5F) * 3e38F;
    if (kind == "negative") v = -1e6F + random;
    if (kind == "salt") v = random > 0.9F ? 255.0F : 0.0F;
    if (kind == "salt beyond all scales") v = random > 0.7F ? 2e38F : -2e38F;
    if (kind == "tiny") v = random * 1e-38F;
  }
  if (kind == "one value") cells[2000] = 1e30F;
  if (kind == "ramp") {
    for (std::size_t i = 0; i < cells.size(); ++i) cells[i] = static_cast<float>(i);
  }
  return frame;
}

class OddFrames : public testing::TestWithParam<const char*> {};

TEST_P(OddFrames, GiveFiniteFindingsOfEveryMethodAndInASequence) {
  const std::string_view kind = GetParam();
  const bool has_value = kind != "no value" && kind != "infinite";
  for (const MethodEntry& entry : methods()) {
    const auto parameters = Parameters::parse(entry.parameters, {});
    ASSERT_TRUE(parameters);
    const auto method = entry.make(*parameters);
    for (int k = 0; k < 3; ++k) {
      const auto found = method->process(odd_frame(GetParam()));
      if (!has_value && entry.name == std::string_view("calibrate")) {
        EXPECT_FALSE(found) << "no master is made of nothing";
        continue;
      }
      ASSERT_TRUE(found) << entry.name;
      for (const Star& s : found->stars) EXPECT_TRUE(std::isfinite(s.x + s.y + s.flux + s.snr + s.fwhm_px));
      for (const Streak& s : found->streaks)
        EXPECT_TRUE(std::isfinite(s.x1 + s.y1 + s.x2 + s.y2 + s.flux + s.snr + s.width_px));
      EXPECT_TRUE(std::isfinite(found->background) && std::isfinite(found->noise)) << entry.name;
    }
    EXPECT_TRUE(method->finish().tracklets.empty()) << entry.name;
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, OddFrames,
                         testing::Values("black", "white", "one pixel", "one row", "one column", "two",
                                         "no value", "infinite", "half without a value", "beyond all scales",
                                         "negative", "salt", "salt beyond all scales", "tiny", "one value",
                                         "ramp"));

TEST(Methods, FindNothingInAFlatFrame) {
  for (const MethodEntry& entry : methods()) {
    const auto parameters = Parameters::parse(entry.parameters, {});
    ASSERT_TRUE(parameters);
    const auto found = entry.make(*parameters)->process(odd_frame("black"));
    ASSERT_TRUE(found) << entry.name;
    EXPECT_TRUE(found->stars.empty());
    EXPECT_TRUE(found->streaks.empty());
  }
}

/// A consumer camera: eight bits, sky noise below one step.
TEST(Methods, FindTheStarsAndNoStreakInEightBits) {
  hw_sim::SkyScene scene = small_scene(2.6, 5);
  const std::vector<hw_sim::SkyStar> truth = lattice(scene, 60);
  Frame frame = frame_of(scene, truth);
  for (float& v : frame.pixels.cells()) v = std::clamp(std::round((v - 420) / 20), 0.0F, 255.0F);
  frame.step = 1;
  const auto parameters =
      Parameters::parse(find_method("streak").value()->parameters, std::vector<std::string>{"stars=1"});
  const auto found = find_method("streak").value()->make(*parameters)->process(frame);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->streaks.empty());
  std::size_t hits = 0;
  for (const hw_sim::SkyStar& t : truth) {
    hits += std::any_of(found->stars.begin(), found->stars.end(),
                        [&](const Star& s) { return std::hypot(s.x - t.x, s.y - t.y) < 0.5; });
  }
  EXPECT_EQ(hits, truth.size());
}

TEST(FrameSize, IsRefusedBelowOneAndAboveAHundredMegapixels) {
  EXPECT_FALSE(refuse_size(1, 1));
  EXPECT_FALSE(refuse_size(10000, 10000));
  EXPECT_THAT(refuse_size(10000, 10001).value().reason, HasSubstr("more than 100 million"));
  EXPECT_THAT(refuse_size(1LL << 62, 1LL << 62).value().reason, HasSubstr("more than"));
  EXPECT_THAT(refuse_size(0, 5).value().reason, HasSubstr("no image"));
}

}  // namespace
}  // namespace srfs::image
