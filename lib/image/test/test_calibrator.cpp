// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/file/calibrator.hpp"

#include <gmock/gmock.h>

#include "base/file.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::image {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

constexpr MastersUsed both{true, true, false};
constexpr MastersUsed of_flats{true, false, true};

Master plain_dark(float level, double exposure_s) {
  return {MasterKind::dark, Plane(20, 16, level), 8, 0, {20, 16, exposure_s, {}, {}}};
}

Master plain_flat(float response) {
  return {MasterKind::flat, Plane(20, 16, response), 8, 0, {20, 16, 0.1, {}, {}}};
}

Frame frame_of_exposure(double exposure_s) {
  Frame frame;
  frame.pixels = Plane(20, 16, 100);
  frame.pixels.at(19, 15) = 101;  // all of one value: saturated
  frame.exposure_s = exposure_s;
  return frame;
}

class CalibratorTest : public testing::Test {
 protected:
  testing_support::TemporaryFolder folder_;
  MasterStore store_{folder_.path()};
};

TEST_F(CalibratorTest, UsesTheNewestDarkOfTheFramesExposureNotTheNewestDark) {
  ASSERT_TRUE(store_.save(plain_dark(10, 0.1)));
  ASSERT_TRUE(store_.save(plain_dark(11, 0.1)));
  ASSERT_TRUE(store_.save(plain_dark(60, 1)));
  Frame frame = frame_of_exposure(0.1);
  Frame longer = frame_of_exposure(1);
  Calibrator calibrator(store_, both);

  EXPECT_EQ(calibrator.apply(frame)->dark, 2U);
  EXPECT_EQ(calibrator.apply(longer)->dark, 3U);

  EXPECT_EQ(frame.pixels.at(0, 0), 100 - 11);
  EXPECT_EQ(longer.pixels.at(0, 0), 100 - 60);
  ASSERT_THAT(calibrator.used(), SizeIs(2));
  EXPECT_EQ(calibrator.used()[1].generation, 3U);
  EXPECT_THAT(calibrator.used()[1].sha256, SizeIs(64));
}

TEST_F(CalibratorTest, SaysWhichMastersThereAreWhereNoneFits) {
  ASSERT_TRUE(store_.save(plain_dark(10, 0.1)));
  Frame frame = frame_of_exposure(4);
  Calibrator calibrator(store_, both);

  const auto applied = calibrator.apply(frame).value();

  EXPECT_FALSE(applied.dark || applied.flat);
  EXPECT_THAT(applied.notes, ElementsAre("no dark fits 20 x 16 px, 4 s; the newest is of 20 x 16 px, 0.1 s"));
  EXPECT_EQ(frame.pixels.at(0, 0), 100);
  EXPECT_THAT(calibrator.used(), IsEmpty());
}

TEST_F(CalibratorTest, DividesByAFlatOnlyWhatADarkWasTakenFrom) {
  ASSERT_TRUE(store_.save(plain_flat(0.5F)));
  Frame without_any = frame_of_exposure(0.1);
  const auto alone = Calibrator(store_, both).apply(without_any).value();
  ASSERT_TRUE(store_.save(plain_dark(10, 0.1)));
  Frame fitting = frame_of_exposure(0.1);
  Frame longer = frame_of_exposure(4);
  Calibrator calibrator(store_, both);

  const auto of_fitting = calibrator.apply(fitting).value();
  const auto of_longer = calibrator.apply(longer).value();

  EXPECT_FALSE(alone.flat);
  EXPECT_THAT(alone.notes, ElementsAre("the flat is not used without a dark"));
  EXPECT_EQ(without_any.pixels.at(0, 0), 100);
  EXPECT_EQ(of_fitting.flat, 1U);
  EXPECT_THAT(of_fitting.notes, IsEmpty());
  EXPECT_EQ(fitting.pixels.at(0, 0), (100 - 10) / 0.5F);
  EXPECT_FALSE(of_longer.flat) << "not that of the frame before";
  EXPECT_THAT(of_longer.notes, ElementsAre(HasSubstr("no dark fits"), "the flat is not used without a dark"));
  EXPECT_EQ(longer.pixels.at(0, 0), 100);
  EXPECT_THAT(calibrator.used(), SizeIs(2));
}

TEST_F(CalibratorTest, HasNothingToSayWhereThereIsNone) {
  Frame frame = frame_of_exposure(4);
  Calibrator calibrator(store_, both);
  EXPECT_THAT(calibrator.apply(frame)->notes, IsEmpty());
  EXPECT_EQ(frame.pixels.at(0, 0), 100);
}

TEST_F(CalibratorTest, RefusesAFrameOfAFlatThatNoDarkFits) {
  Frame without_any = frame_of_exposure(4);
  EXPECT_THAT(Calibrator(store_, of_flats).apply(without_any).error().reason,
              HasSubstr("there is no dark of 20 x 16 px, 4 s"));
  ASSERT_TRUE(store_.save(plain_dark(10, 0.1)));
  Frame other = frame_of_exposure(4);
  Frame fitting = frame_of_exposure(0.1);
  Calibrator calibrator(store_, of_flats);

  EXPECT_THAT(calibrator.apply(other).error().reason, HasSubstr("no dark fits 20 x 16 px, 4 s"));
  EXPECT_EQ(calibrator.apply(fitting)->dark, 1U);
}

TEST_F(CalibratorTest, GoesBackToTheGenerationBeforeABrokenOneAndSaysSoOnce) {
  ASSERT_TRUE(store_.save(plain_dark(10, 0.1)));
  ASSERT_TRUE(store_.save(plain_dark(12, 0.1)));
  const auto path = folder_.path() / "dark_0002.master";
  std::string content = read_file(path).value();
  content[200] = static_cast<char>(content[200] ^ 1);
  ASSERT_TRUE(write_file_atomically(path, content));
  Calibrator calibrator(store_, both);

  for (int k = 0; k < 3; ++k) {
    Frame frame = frame_of_exposure(0.1);
    EXPECT_EQ(calibrator.apply(frame)->dark, 1U);
    EXPECT_EQ(frame.pixels.at(0, 0), 90);
    EXPECT_THAT(calibrator.take_problems(), SizeIs(k == 0 ? 1 : 0));
  }
}

TEST_F(CalibratorTest, LeavesFramesAsTheyAreWhereNothingIsWanted) {
  ASSERT_TRUE(store_.save(plain_dark(10, 0.1)));
  Frame frame = frame_of_exposure(0.1);
  Calibrator calibrator(store_, {});
  EXPECT_FALSE(calibrator.apply(frame)->dark.has_value());
  EXPECT_EQ(frame.pixels.at(0, 0), 100);
}

}  // namespace
}  // namespace srfs::image
