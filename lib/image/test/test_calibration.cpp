// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/calibration.hpp"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>

#include "image/method.hpp"
#include "lib/image/test/skies.hpp"

namespace srfs::image {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

/// Frames of one warm sensor with columns and rows, particles in each.
hw_sim::LensScene warm_scene(std::uint64_t seed) {
  hw_sim::LensScene scene = finder_scene(1.8, seed);
  scene.pattern_seed = 77;
  scene.detector.saturation_adu = 4095;
  scene.detector.gain_e_per_adu = 2;
  scene.detector.bias_adu = 200;
  scene.detector.warm_share = 0.03;
  scene.detector.warm_e = 150;
  scene.detector.pixel_pattern_e = 12;
  scene.detector.cosmic_rays = 20;
  return scene;
}

Frame dark_frame(std::uint64_t seed) {
  hw_sim::LensScene scene = warm_scene(seed);
  scene.detector.background_e = 0;
  return frame_of(scene, std::vector<hw_sim::SkyStar>{});
}

MasterMaker::Made dark_of(int frames) {
  MasterMaker maker(MasterKind::dark);
  for (int k = 0; k < frames; ++k) EXPECT_TRUE(maker.add(dark_frame(500 + static_cast<std::uint64_t>(k))));
  return maker.finish().value();
}

/// Scatter of the pixels without stars, by the quarter and the middle of their values.
double noise_of(const Plane& pixels) {
  std::vector<float> values;
  for (const float v : pixels.cells()) {
    if (std::isfinite(v)) values.push_back(v);
  }
  std::sort(values.begin(), values.end());
  return double(values[values.size() * 84 / 100] - values[values.size() * 16 / 100]) / 2;
}

Frame plain(int width, int height, float value) {
  Frame frame;
  frame.pixels = Plane(width, height, value);
  return frame;
}

/// Evenly lit, but for one pixel: no light is without noise.
Frame lit(int width, int height, float value) {
  Frame frame = plain(width, height, value);
  frame.pixels.at(width - 1, height - 1) *= 1.01F;
  return frame;
}

Master plain_master(MasterKind kind, int width, int height, float level) {
  Master master;
  master.kind = kind;
  master.level = Plane(width, height, level);
  master.setting.width = width;
  master.setting.height = height;
  return master;
}

TEST(Calibration, TakesThePatternOfASensorOutOfItsFrames) {
  Frame frame = frame_of(warm_scene(900), std::vector<hw_sim::SkyStar>{});
  const double before = noise_of(frame.pixels);

  const auto dark = dark_of(8);
  calibrate(&dark.master, nullptr, frame);

  EXPECT_LT(noise_of(frame.pixels), 0.8 * before);
}

TEST(Calibration, LeavesFewerFalseStars) {
  const hw_sim::LensScene scene = warm_scene(901);
  const auto truth = lattice(scene, 40, 400);
  Frame frame = frame_of(scene, truth);
  const auto stars = [](const Frame& of) {
    const auto method = find_method("star_centroid").value();
    return method->make(Parameters::parse(method->parameters, {}).value())->process(of).value().stars.size();
  };
  const std::size_t before = stars(frame);

  const auto dark = dark_of(8);
  calibrate(&dark.master, nullptr, frame);

  EXPECT_LE(stars(frame), truth.size() + 2);
  EXPECT_GE(stars(frame), truth.size() - 1);
  EXPECT_LE(stars(frame), before);
}

TEST(Calibration, NoParticleCountsInAMaster) {
  MasterMaker maker(MasterKind::dark);
  for (int k = 0; k < 5; ++k) {
    Frame frame = plain(20, 20, 100 + static_cast<float>(k % 3));
    frame.pixels.at(k, 3) = 4000;
    EXPECT_TRUE(maker.add(frame));
  }

  const auto made = maker.finish().value();

  EXPECT_THAT(made.defects, IsEmpty());
  for (int k = 0; k < 5; ++k) EXPECT_NEAR(made.master.level.at(k, 3), 101, 1.1);
}

TEST(Calibration, FindsPixelsThatSayNothing) {
  MasterMaker darks(MasterKind::dark);
  MasterMaker flats(MasterKind::flat);
  for (int k = 0; k < 4; ++k) {
    Frame dark = plain(20, 20, 100 + static_cast<float>(k));
    dark.pixels.at(5, 6) += 500;
    EXPECT_TRUE(darks.add(dark));
    Frame flat = lit(20, 20, 1000 + static_cast<float>(100 * k));
    flat.pixels.at(9, 9) *= 0.3F;
    EXPECT_TRUE(flats.add(flat));
  }

  const auto dark = darks.finish().value();
  const auto flat = flats.finish().value();
  Frame frame = lit(20, 20, 300);
  calibrate(&dark.master, &flat.master, frame);

  ASSERT_EQ(dark.defects.size(), 1U);
  EXPECT_EQ(dark.defects[0].kind, Defect::Kind::hot);
  ASSERT_EQ(flat.defects.size(), 1U);
  EXPECT_EQ(flat.defects[0].kind, Defect::Kind::dark);
  EXPECT_TRUE(std::isnan(frame.pixels.at(5, 6)));
  EXPECT_TRUE(std::isnan(frame.pixels.at(9, 9)));
  EXPECT_NEAR(frame.pixels.at(1, 1), 300 - 101.5, 0.6);
}

TEST(Calibration, DividesByTheResponse) {
  MasterMaker maker(MasterKind::flat);
  for (int k = 0; k < 3; ++k) {
    Frame flat = lit(40, 20, 500 * static_cast<float>(k + 1));
    for (int y = 0; y < 20; ++y)
      for (int x = 0; x < 15; ++x) flat.pixels.at(x, y) *= 0.8F;
    EXPECT_TRUE(maker.add(flat));
  }
  Frame frame = lit(40, 20, 200);

  const auto made = maker.finish().value();
  calibrate(nullptr, &made.master, frame);

  EXPECT_NEAR(frame.pixels.at(5, 5), 250, 0.1);
  EXPECT_NEAR(frame.pixels.at(30, 5), 200, 0.1);
}

TEST(Calibration, SaturatedPixelsStaySaturated) {
  Master dark = plain_master(MasterKind::dark, 20, 20, 50);
  dark.level.at(4, 4) = 90;
  Frame frame = plain(20, 20, 100);
  for (int x = 2; x < 8; ++x) frame.pixels.at(x, 4) = 255;

  calibrate(&dark, nullptr, frame);

  ASSERT_TRUE(frame.saturation_adu.has_value());
  for (int x = 2; x < 8; ++x) EXPECT_GE(frame.pixels.at(x, 4), *frame.saturation_adu);
  EXPECT_EQ(frame.pixels.at(0, 0), 50);
}

TEST(Calibration, ADefectHasNoValueWhereItIsSaturatedEither) {
  Master dark = plain_master(MasterKind::dark, 20, 20, 50);
  dark.level.at(4, 4) = std::numeric_limits<float>::quiet_NaN();
  Frame frame = plain(20, 20, 100);
  frame.saturation_adu = 255;
  frame.pixels.at(4, 4) = 255;
  frame.pixels.at(9, 4) = 255;

  calibrate(&dark, nullptr, frame);

  EXPECT_TRUE(std::isnan(frame.pixels.at(4, 4)));
  EXPECT_GE(frame.pixels.at(9, 4), *frame.saturation_adu);
}

/// Frames of a sensor of 8 bits whose noise is below a step: a few values differ from the others, by one.
Frame quiet_frame(int number) {
  Frame frame = plain(60, 40, 12);
  frame.step = 1;
  for (int i = number % 4; i < 60 * 40; i += 11) frame.pixels.cells()[static_cast<std::size_t>(i)] = 13;
  for (int i = 0; i < 60 * 40; i += 5) frame.pixels.cells()[static_cast<std::size_t>(i)] += 2;  // warm
  frame.pixels.at(30, 20) = 90;
  return frame;
}

TEST(Calibration, OfAQuietSensorOnlyWhatIsManyStepsOffIsADefect) {
  MasterMaker maker(MasterKind::dark);
  for (int k = 0; k < 8; ++k) EXPECT_TRUE(maker.add(quiet_frame(k)));

  const auto made = maker.finish().value();

  EXPECT_EQ(made.master.defects, 1U);
  ASSERT_THAT(made.defects, SizeIs(1));
  EXPECT_EQ(made.defects[0].x, 30);
  EXPECT_NEAR(made.master.level.at(10, 1), 14, 1.1) << "a warm pixel has a level";
}

/// @param share  of the pixels hot, one in so many; each is stronger than those before
Frame frame_with_defects(int width, int height, int one_in) {
  Frame frame = plain(width, height, 100);
  frame.step = 1;
  for (int i = 0; i < width * height; i += one_in)
    frame.pixels.cells()[static_cast<std::size_t>(i)] += 1000 + static_cast<float>(i) / 100;
  return frame;
}

Result<MasterMaker::Made, Refusal> master_with_defects(int width, int height, int one_in) {
  MasterMaker maker(MasterKind::dark);
  for (int k = 0; k < 3; ++k) EXPECT_TRUE(maker.add(frame_with_defects(width, height, one_in)));
  return maker.finish();
}

TEST(Calibration, RefusesAMasterWhoseDefectsAreMoreThanADetectorHas) {
  EXPECT_TRUE(master_with_defects(100, 80, 11));

  const auto made = master_with_defects(100, 80, 9);

  ASSERT_FALSE(made);
  EXPECT_THAT(made.error().reason, HasSubstr("11.1 % of the pixels would be defects, more than 10 %"));
}

TEST(Calibration, ListsTheStrongestDefectsAndCountsAll) {
  const int one_in = 23;
  const auto made = master_with_defects(600, 450, one_in).value();

  const std::uint32_t all = 600 * 450 / one_in + 1;
  ASSERT_GT(all, MasterMaker::defects_listed_most);
  EXPECT_EQ(made.master.defects, all);
  ASSERT_THAT(made.defects, SizeIs(MasterMaker::defects_listed_most));
  EXPECT_GT(made.defects.front().level_adu, made.defects.back().level_adu);
  const double weakest_listed = 1000 + double(all - MasterMaker::defects_listed_most) * one_in / 100;
  EXPECT_NEAR(made.defects.back().level_adu, weakest_listed, 0.3);
  EXPECT_TRUE(std::isnan(made.master.level.at(0, 0))) << "not listed, and no level all the same";
}

TEST(Calibration, AFlatDoesNotCountTheDefectsOfTheDark) {
  const auto dark = master_with_defects(100, 80, 23).value();
  MasterMaker maker(MasterKind::flat);
  for (int k = 0; k < 4; ++k) {
    Frame frame = lit(100, 80, 1000 + static_cast<float>(k));
    frame.pixels.at(50, 40) = 300;
    calibrate(&dark.master, nullptr, frame);
    EXPECT_TRUE(maker.add(frame));
  }

  const auto flat = maker.finish().value();

  EXPECT_EQ(flat.master.defects, 1U);
  ASSERT_THAT(flat.defects, SizeIs(1));
  EXPECT_EQ(flat.defects[0].x, 50);
  EXPECT_TRUE(std::isnan(flat.master.level.at(0, 0)));
}

TEST(Calibration, DarkCornersOfAFlatHaveNoValueAndAreNoDefects) {
  MasterMaker maker(MasterKind::flat);
  for (int k = 0; k < 3; ++k) {
    Frame frame = lit(60, 40, 1000);
    for (int y = 0; y < 12; ++y)
      for (int x = 0; x < 12 - y; ++x) frame.pixels.at(x, y) = 0;
    EXPECT_TRUE(maker.add(frame));
  }

  const auto flat = maker.finish().value();
  Frame frame = lit(60, 40, 100);
  calibrate(nullptr, &flat.master, frame);

  EXPECT_LT(flat.master.defects, 30U) << "those along the edge";
  EXPECT_TRUE(std::isnan(frame.pixels.at(2, 2)));
  EXPECT_EQ(frame.pixels.at(30, 30), 100);
}

TEST(Calibration, SaturatedPixelsOfAFlatGetNoLevel) {
  for (const bool is_known : {true, false}) {
    const Master dark = plain_master(MasterKind::dark, 60, 40, 100);
    MasterMaker maker(MasterKind::flat);
    for (int k = 0; k < 3; ++k) {
      Frame frame = plain(60, 40, 3000 + static_cast<float>(10 * k));
      for (int y = 0; y < 40; ++y)
        for (int x = 0; x < 25; ++x) frame.pixels.at(x, y) = 4095;
      if (is_known) frame.saturation_adu = 4095;
      calibrate(&dark, nullptr, frame);
      EXPECT_TRUE(maker.add(frame));
    }

    const auto flat = maker.finish().value();

    EXPECT_THAT(flat.defects, IsEmpty());
    EXPECT_TRUE(std::isnan(flat.master.level.at(10, 20))) << is_known;
    EXPECT_TRUE(std::isnan(flat.master.level.at(24, 20))) << is_known;
    EXPECT_NEAR(flat.master.level.at(40, 20), 1, 1e-5);
  }
}

TEST(Calibration, RefusesAFlatMostOfWhichIsSaturatedAlsoWhereNoFileSaysSo) {
  Master dark = plain_master(MasterKind::dark, 20, 20, 100);
  for (int x = 0; x < 20; ++x) dark.level.at(x, 5) = 130;
  Frame all = plain(20, 20, 4095);
  Frame most = plain(20, 20, 4095);
  for (int x = 0; x < 20; ++x) most.pixels.at(x, 3) = 3000;
  for (Frame frame : {all, most}) {
    calibrate(&dark, nullptr, frame);
    MasterMaker maker(MasterKind::flat);
    const auto added = maker.add(frame);
    ASSERT_FALSE(added);
    EXPECT_THAT(added.error().reason, HasSubstr("too much light in a frame of a flat"));
  }
}

TEST(Calibration, RefusesADarkThatIsSaturatedOrHasNoValue) {
  MasterMaker maker(MasterKind::dark);
  Frame saturated = plain(20, 20, 4095);
  saturated.saturation_adu = 4095;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(maker.add(saturated).error().reason, HasSubstr("too much light in a frame of a dark"));
  EXPECT_THAT(maker.add(plain(20, 20, nan)).error().reason, HasSubstr("no pixel has a value in a frame"));
  EXPECT_EQ(maker.frames(), 0);
  for (int k = 0; k < 4; ++k) {  // each pixel is without a value in one of them
    Frame frame = plain(20, 20, 100);
    for (std::size_t i = static_cast<std::size_t>(k); i < frame.pixels.size(); i += 4)
      frame.pixels.cells()[i] = nan;
    EXPECT_TRUE(maker.add(frame));
  }
  EXPECT_THAT(maker.finish().error().reason, HasSubstr("no pixel has a value in all frames"));
}

TEST(Calibration, AMasterFitsFramesOfItsSetting) {
  const DetectorSetting master{640, 480, 0.1, 6.0, 290.0};
  const auto with = [&](const auto& change) {
    DetectorSetting frame = master;
    change(frame);
    return frame;
  };
  const auto longer = with([](DetectorSetting& s) { s.exposure_s = 0.105; });
  const auto nearly = with([](DetectorSetting& s) { s.exposure_s = 0.101; });
  const auto amplified = with([](DetectorSetting& s) { s.gain = 12; });
  const auto warmer = with([](DetectorSetting& s) { s.temperature_k = 296; });
  const auto smaller = with([](DetectorSetting& s) { s.height = 240; });
  const auto of_unknown_exposure = with([](DetectorSetting& s) { s.exposure_s.reset(); });
  const auto of_unknown_gain = with([](DetectorSetting& s) { s.gain.reset(), s.temperature_k.reset(); });

  for (const auto& fitting : {master, nearly, of_unknown_gain})
    EXPECT_TRUE(fits(MasterKind::dark, master, fitting)) << to_text(fitting);
  for (const auto& other : {longer, amplified, warmer, smaller, of_unknown_exposure})
    EXPECT_FALSE(fits(MasterKind::dark, master, other)) << to_text(other);
  EXPECT_TRUE(fits(MasterKind::dark, of_unknown_exposure, of_unknown_exposure));
  for (const auto& other : {longer, amplified, warmer, of_unknown_exposure})
    EXPECT_TRUE(fits(MasterKind::flat, master, other)) << to_text(other);
  EXPECT_FALSE(fits(MasterKind::flat, master, smaller));
  EXPECT_EQ(to_text(warmer), "640 x 480 px, 0.1 s, gain 6, 296 K");
}

TEST(Calibration, RefusesFramesThatDoNotBelongTogether) {
  MasterMaker maker(MasterKind::flat);
  EXPECT_TRUE(maker.add(lit(20, 20, 100)));
  EXPECT_THAT(maker.add(lit(20, 21, 100)).error().reason, HasSubstr("20 x 21"));
  EXPECT_THAT(maker.add(plain(20, 20, 0)).error().reason, HasSubstr("no light"));
  Frame saturated = plain(20, 20, 255);
  saturated.saturation_adu = 255;
  EXPECT_THAT(maker.add(saturated).error().reason, HasSubstr("saturated"));
  EXPECT_THAT(maker.finish().error().reason, HasSubstr("3 frames, not 1"));
  EXPECT_EQ(maker.frames(), 0);
  MasterMaker darks(MasterKind::dark);
  Frame dark = plain(20, 20, 100);
  dark.exposure_s = 0.1;
  EXPECT_TRUE(darks.add(dark));
  dark.exposure_s = 1;
  EXPECT_THAT(darks.add(dark).error().reason, HasSubstr("1 s after frames of 20 x 20 px, 0.1 s"));
}

}  // namespace
}  // namespace srfs::image
