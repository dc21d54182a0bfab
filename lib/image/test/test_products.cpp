// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <limits>

#include <gmock/gmock.h>

#include "image/method.hpp"
#include "image/picture.hpp"
#include "lib/image/test/skies.hpp"

namespace srfs::image {
namespace {

using testing::HasSubstr;

std::unique_ptr<Method> method(const char* name, const std::vector<std::string>& parameters = {}) {
  const MethodEntry* entry = find_method(name).value();
  return entry->make(Parameters::parse(entry->parameters, parameters).value());
}

TEST(Thumbnail, KeepsTheProportionsAndShowsStarsAboveADarkSky) {
  const hw_sim::SkyScene scene = small_scene(3);
  const std::vector<hw_sim::SkyStar> star{{100, 60, hw_sim::flux_for_snr(scene, 100, 60, 500)}};

  const Grid<std::uint8_t> picture = thumbnail(frame_of(scene, star).pixels, 160);

  EXPECT_EQ(picture.width(), 160);
  EXPECT_EQ(picture.height(), 120);
  EXPECT_GT(picture.at(50, 30), 200);
  double sky = 0;
  for (int y = 60; y < 120; ++y) {
    for (int x = 0; x < 160; ++x) sky += picture.at(x, y);
  }
  sky /= 60 * 160;
  EXPECT_GT(sky, 10);
  EXPECT_LT(sky, 90);
}

TEST(Thumbnail, OfFramesThatAreNarrowSmallOrWithoutAValueHasAtLeastAPixel) {
  const Plane wide(4000, 1, 5.0F);
  EXPECT_EQ(thumbnail(wide, 100).height(), 1);
  EXPECT_EQ(thumbnail(wide, 100).width(), 100);
  EXPECT_EQ(thumbnail(Plane(3, 2, 1.0F), 100).width(), 3);
  const Plane nothing(40, 40, std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(thumbnail(nothing, 10).at(5, 5), 0);
}

TEST(RegionOfInterest, IsThePixelsAsTheyAre) {
  Frame frame;
  frame.pixels = Plane(30, 20);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 30; ++x) frame.pixels.at(x, y) = static_cast<float>(100 * y + x);
  }
  const auto found = method("roi", {"x=25", "y=3", "width=10", "height=4"})->process(frame);
  ASSERT_TRUE(found);
  ASSERT_TRUE(found->cutout);
  EXPECT_EQ(found->cutout->x, 25);
  const auto& part = std::get<Plane>(found->cutout->pixels);
  EXPECT_EQ(part.width(), 5);
  EXPECT_EQ(part.height(), 4);
  EXPECT_EQ(part.at(4, 3), 629);
  EXPECT_THAT(found->notes.at(0), HasSubstr("only 5 x 4"));

  const auto outside = method("roi", {"x=30"})->process(frame);
  ASSERT_FALSE(outside);
  EXPECT_THAT(outside.error().reason, HasSubstr("begins at (30, 0), the frame has 30 x 20"));
}

/// Frames of a detector with constant defects, under a drifting sky.
std::vector<Frame> drifting(int frames) {
  std::vector<Frame> sequence;
  hw_sim::SkyScene scene = small_scene(2.2, 3);
  scene.pattern_seed = 17;
  scene.cosmic_rays = 20;
  for (int k = 0; k < frames; ++k) {
    scene.seed = 100 + static_cast<std::uint64_t>(k);
    std::vector<hw_sim::SkyStar> stars = lattice(scene, 200);
    for (hw_sim::SkyStar& s : stars) s.x += 1.7 * k, s.y += 0.9 * k;
    sequence.push_back(frame_of(scene, stars));
    sequence.back().pixels.at(50, 31) += 400;
    sequence.back().pixels.at(201, 180) += 150;
    sequence.back().pixels.at(120, 77) -= 200;
  }
  return sequence;
}

TEST(DefectMap, HasThePixelsThatStayHotOrDarkAndNeitherStarsNorParticles) {
  const auto map = method("defect_map");
  for (const Frame& frame : drifting(6)) ASSERT_TRUE(map->process(frame));

  const SequenceFindings found = map->finish();

  ASSERT_EQ(found.defects.size(), 3U);
  EXPECT_EQ(found.defects[0].x, 50);
  EXPECT_EQ(found.defects[0].y, 31);
  EXPECT_EQ(found.defects[0].kind, Defect::Kind::hot);
  EXPECT_NEAR(found.defects[0].level_adu, 400, 30);
  EXPECT_EQ(found.defects[1].x, 120);
  EXPECT_EQ(found.defects[1].kind, Defect::Kind::dark);
  EXPECT_NEAR(found.defects[1].level_adu, -200, 30);
  EXPECT_EQ(found.defects[2].x, 201);
  EXPECT_EQ(found.defects[2].frames, 6);
  EXPECT_TRUE(found.notes.empty());
  EXPECT_TRUE(map->finish().defects.empty()) << "the next sequence is another one";
}

TEST(DefectMap, SaysThatOneFrameDoesNotTellParticlesFromDefects) {
  const auto map = method("defect_map");
  ASSERT_TRUE(map->process(drifting(1)[0]));
  EXPECT_THAT(map->finish().notes.at(0), HasSubstr("particles look like defects"));
}

TEST(DefectMap, RefusesAFrameOfAnotherSize) {
  const auto map = method("defect_map");
  Frame frame;
  frame.pixels = Plane(40, 30, 1.0F);
  ASSERT_TRUE(map->process(frame));
  frame.pixels = Plane(30, 40, 1.0F);
  const auto refused = map->process(frame);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().reason, HasSubstr("30 x 40 px after frames of 40 x 30"));
}

}  // namespace
}  // namespace srfs::image
