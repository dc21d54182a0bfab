// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_processing/image_task.hpp"

#include <cmath>
#include <limits>

#include <gmock/gmock.h>
#include <mission/structures.hpp>

#include "base/file.hpp"
#include "image/file/frame_file.hpp"
#include "image/file/frame_mark.hpp"
#include "image/product/frame_strips.hpp"
#include "lib/image/test/skies.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

using image::FrameMark;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

class ImageTaskTest : public testing::Test {
 protected:
  /// Stores a sky with stars, and optionally a streak, as the given frame of task 17.
  std::string store_frame(int number, bool with_streak) {
    hw_sim::SkyScene scene = image::small_scene(2.4, static_cast<std::uint64_t>(number));
    std::vector<hw_sim::SkyStreak> streaks;
    if (with_streak) {
      hw_sim::SkyStreak streak{60.3, 80.1, 190.4, 150.2, 1};
      streak.flux_e = 60 / hw_sim::streak_snr(scene, streak);
      streaks.push_back(streak);
    }
    const auto frame = image::frame_of(scene, image::lattice(scene, 60), streaks);
    return store(number, frame.pixels);
  }
  std::string store(int number, const image::Plane& pixels) {
    const std::string name = "frames/0000000017/000" + std::to_string(number) + ".fits";
    std::filesystem::create_directories((images_ / name).parent_path());
    EXPECT_TRUE(image::write_fits(images_ / name, pixels));
    return name;
  }
  ImageTask task(std::vector<std::string> files, const std::string& method, std::uint32_t budget = 200'000,
                 const std::string& parameters = "", bool full_frames = false,
                 std::int64_t pixels = 6'000'000) {
    auto order = check_request({17, std::move(files), method, parameters, budget, full_frames, run_});
    if (!order) throw std::runtime_error(order.error().reason);
    return {*std::move(order), images_, {pixels}};
  }
  void run(ImageTask& task) {
    for (int steps = 0; !task.is_done(); ++steps) {
      ASSERT_LT(steps, 1000);
      const StepReport report = task.step(store_);
      for (const auto& r : report.refused) refused_.push_back(r.file + ": " + r.why);
      for (const auto& f : report.frames) frames_.push_back(f);
      EXPECT_THAT(report.problems, IsEmpty());
    }
  }
  [[nodiscard]] image::Json findings() const {
    return image::Json::parse(read_file(images_ / "products/0000000017/findings.json").value());
  }

  testing_support::TemporaryFolder folder_;
  std::filesystem::path images_ = folder_.path() / "images";
  ProductStore store_{images_, 10'000'000};
  image::ProcessingRun run_ = 0xA1;  ///< of the next task
  std::vector<std::string> refused_;
  std::vector<FrameReport> frames_;
};

TEST_F(ImageTaskTest, FindsStreaksMarksTheFramesAndMakesProductsMostImportantFirst) {
  const auto with = store_frame(1, true);
  const auto without = store_frame(2, false);
  ImageTask work = task({with, without}, "streak", 200'000, "stars=1");

  run(work);

  ASSERT_FALSE(work.failure()) << work.failure()->reason;
  EXPECT_EQ(work.counts().frames_processed, 2);
  EXPECT_EQ(work.counts().streaks, 1U);
  EXPECT_GT(work.counts().stars, 40U);
  EXPECT_EQ(work.counts().left_out, 0);
  EXPECT_TRUE(image::has_mark(images_ / with, FrameMark::detected));
  EXPECT_TRUE(image::has_mark(images_ / without, FrameMark::nothing));
  const std::string folder = "products/0000000017/";
  EXPECT_THAT(work.products(), ElementsAre(folder + "findings.json", folder + "streak_0000.png",
                                           folder + "stars.bin", folder + "thumbnail.png"));
  std::uint64_t octets = 0;
  for (const auto& product : work.products()) octets += std::filesystem::file_size(images_ / product);
  EXPECT_EQ(octets, work.product_octets());
  const auto json = findings();
  EXPECT_EQ(json["streaks"].size(), 1U);
  EXPECT_NEAR(json["streaks"][0]["snr"].get<double>(), 60, 20);
  EXPECT_EQ(json["frames"][1]["file"], without);
  ASSERT_EQ(frames_.size(), 2U);
  EXPECT_EQ(frames_[0].streaks.size(), 1U);
  EXPECT_EQ(frames_[0].file, with);
}

TEST_F(ImageTaskTest, StaysWithinEveryBudgetAndLeavesOutTheLeastImportant) {
  const auto with = store_frame(1, true);
  std::vector<std::size_t> known;
  for (const std::uint32_t budget : {0U, 100U, 1000U, 4000U, 12'000U, 30'000U, 60'000U, 1'000'000U}) {
    ImageTask work = task({with}, "streak", budget, "stars=1", true);
    run(work);
    ASSERT_FALSE(work.failure());
    EXPECT_LE(work.product_octets(), budget);
    if (budget < 1'000'000U) {
      EXPECT_GT(work.counts().left_out, 0);
    }
    if (budget >= 1000U) {
      EXPECT_THAT(work.products().front(), HasSubstr("findings.json"));
    }
    known.push_back(work.products().size());
  }
  EXPECT_EQ(known.front(), 0U);
  EXPECT_EQ(known.back(), 5U);
}

TEST_F(ImageTaskTest, GoesOnWithoutTheFramesThatCannotBeUsed) {
  const auto good = store_frame(1, true);
  const auto one = store(2, image::Plane(1, 1, 5.0F));
  const auto large = store(3, image::Plane(600, 500, 5.0F));
  ASSERT_TRUE(write_file_atomically(images_ / "frames/0000000017/0004.fits", "no picture at all"));
  std::string lying = read_file(images_ / good).value();
  lying.replace(lying.find("NAXIS1  = ") + 10, 20, "               10000");
  lying.replace(lying.find("NAXIS2  = ") + 10, 20, "               10000");
  ASSERT_TRUE(write_file_atomically(images_ / "frames/0000000017/0005.fits", lying));
  std::string none(2880, ' ');  // 32-bit floats that are NaN
  const std::string header =
      "SIMPLE  =                    T" + std::string(50, ' ') + "BITPIX  =                  -32" +
      std::string(50, ' ') + "NAXIS   =                    2" + std::string(50, ' ') +
      "NAXIS1  =                   40" + std::string(50, ' ') + "NAXIS2  =                   40" +
      std::string(50, ' ') + "END" + std::string(77, ' ');
  none.replace(0, header.size(), header);
  for (int i = 0; i < 40 * 40; ++i) none += std::string("\x7f\xc0\x00\x00", 4);
  none.resize((none.size() + 2879) / 2880 * 2880, '\0');
  ASSERT_TRUE(write_file_atomically(images_ / "frames/0000000017/0006.fits", none));

  ImageTask work =
      task({"../../etc/passwd", "frames/0000000017/none.fits", one, large, "frames/0000000017/0004.fits",
            "frames/0000000017/0005.fits", "frames/0000000017/0006.fits", good},
           "streak", 200'000, "", false, 200'000);
  run(work);

  ASSERT_FALSE(work.failure());
  EXPECT_EQ(work.counts().frames_processed, 1);
  EXPECT_EQ(work.counts().frames_refused, 7U);
  EXPECT_EQ(work.counts().frames_done, 8);
  EXPECT_EQ(work.counts().streaks, 1U);
  ASSERT_EQ(refused_.size(), 7U);
  EXPECT_THAT(refused_[0], HasSubstr("leads elsewhere"));
  EXPECT_THAT(refused_[2], HasSubstr("1 x 1 pixels"));
  EXPECT_THAT(refused_[3], HasSubstr("600 x 500 pixels: more than 0.2 million"));
  EXPECT_THAT(refused_[4], HasSubstr("not a FITS file"));
  EXPECT_THAT(refused_[5], HasSubstr("10000 x 10000"));
  EXPECT_THAT(refused_[6], HasSubstr("-32 bits a pixel"));
  EXPECT_EQ(findings()["refused"].size(), 7U);
}

TEST_F(ImageTaskTest, FailsWhereNoFrameCanBeUsed) {
  ImageTask work = task({"frames/none.fits", "frames/neither.fits"}, "streak");
  run(work);
  ASSERT_TRUE(work.failure());
  EXPECT_EQ(work.failure()->failure_code, mission::failure::no_usable_frame);
  EXPECT_THAT(work.products(), IsEmpty());
}

TEST_F(ImageTaskTest, FailsWhereTheDiskTakesNoProduct) {
  const auto frame = store_frame(1, true);
  ASSERT_TRUE(write_file_atomically(images_ / "products", "a file where the folder should be"));
  ImageTask work = task({frame}, "streak");
  while (!work.is_done()) static_cast<void>(work.step(store_));
  ASSERT_TRUE(work.failure());
  EXPECT_EQ(work.failure()->failure_code, mission::failure::disk_failed);
  EXPECT_TRUE(image::has_mark(images_ / frame, FrameMark::detected));
}

TEST_F(ImageTaskTest, SendsFullFramesBitForBitAndOnlyThemWithoutAMethod) {
  const auto first = store_frame(1, false);
  const auto second = store_frame(2, false);
  ImageTask work = task({first, "frames/none.fits", second}, "", 1'000'000, "", true);

  run(work);

  ASSERT_FALSE(work.failure());
  EXPECT_THAT(work.products(),
              ElementsAre("products/0000000017/frame_0001.strips", "products/0000000017/frame_0002.strips"));
  EXPECT_EQ(refused_.size(), 1U);
  const auto content = read_file(images_ / work.products()[1]).value();
  const auto found =
      image::decode_strips(OctetView(reinterpret_cast<const std::uint8_t*>(content.data()), content.size()));
  ASSERT_TRUE(found);
  EXPECT_EQ(found->frame.pixels.cells(), image::read_frame(images_ / second)->pixels.cells());
  EXPECT_FALSE(image::has_mark(images_ / first, FrameMark::nothing));
}

TEST_F(ImageTaskTest, WhatWasDetectedOnceStaysMarked) {
  const auto with = store_frame(1, true);
  const auto without = store_frame(2, false);
  ASSERT_TRUE(image::mark_frame(images_ / without, FrameMark::detected));
  ASSERT_TRUE(image::mark_frame(images_ / with, FrameMark::nothing));

  ImageTask work = task({with, without}, "streak");
  run(work);

  EXPECT_TRUE(image::has_mark(images_ / with, FrameMark::detected));
  EXPECT_FALSE(image::has_mark(images_ / with, FrameMark::nothing));
  EXPECT_TRUE(image::has_mark(images_ / without, FrameMark::detected));
  EXPECT_FALSE(image::has_mark(images_ / without, FrameMark::nothing));
}

TEST_F(ImageTaskTest, ADetectionWaitsForTheProductsOfItsOwnRun) {
  const auto frame = store_frame(1, true);
  ImageTask cancelled = task({frame}, "streak");
  static_cast<void>(cancelled.step(store_));  // marks the frame but makes no product
  run_ = 0xA2;
  ImageTask other = task({frame}, "thumbnail");
  run(other);
  EXPECT_FALSE(image::lacks_sent_mark(images_ / frame, 0xA2)) << "it says nothing of the streak";
  EXPECT_TRUE(image::has_unsent_detection(images_ / frame));

  run_ = 0xA3;
  ImageTask again = task({frame}, "streak");
  run(again);
  EXPECT_TRUE(image::lacks_sent_mark(images_ / frame, 0xA3));
  ASSERT_TRUE(image::mark_sent(images_ / frame, 0xA3));
  EXPECT_FALSE(image::has_unsent_detection(images_ / frame)) << "instead of what the first run found";
}

TEST_F(ImageTaskTest, MethodsThatDoNotLookForDebrisLeaveTheMarks) {
  const auto frame = store_frame(1, false);
  ImageTask work = task({frame}, "star_centroid");
  run(work);
  EXPECT_GT(work.counts().stars, 20U);
  EXPECT_FALSE(image::has_mark(images_ / frame, FrameMark::nothing));
  EXPECT_THAT(work.products(), Contains(HasSubstr("stars.bin")));
}

TEST_F(ImageTaskTest, PiecesAndThumbnailsAreProductsOfTheirMethods) {
  const auto first = store_frame(1, false);
  const auto second = store_frame(2, false);
  ImageTask pieces = task({first, second}, "roi", 200'000, "x=10,y=20,width=32,height=16");
  run(pieces);
  EXPECT_THAT(pieces.products(), Contains("products/0000000017/roi_0001.fits"));
  EXPECT_THAT(pieces.products(), Contains("products/0000000017/roi_0002.fits"));
  EXPECT_EQ(image::read_frame(images_ / "products/0000000017/roi_0002.fits")->pixels.width(), 32);

  ImageTask thumbnails = task({first}, "thumbnail", 200'000, "width=80");
  run(thumbnails);
  EXPECT_THAT(thumbnails.products(),
              ElementsAre("products/0000000017/findings.json", "products/0000000017/thumbnail_0001.png"));
  EXPECT_FALSE(std::filesystem::exists(images_ / "products/0000000017/roi_0002.fits")) << "of the run before";
}

TEST_F(ImageTaskTest, MakesADarkThatLaterTasksUseAndName) {
  std::vector<std::string> darks;
  for (int k = 1; k <= 4; ++k) {
    image::Plane pixels(96, 64, 200 + static_cast<float>(k % 3));
    for (int y = 0; y < 64; ++y) pixels.at(40, y) += 60;  // a warm column
    darks.push_back(store(k, pixels));
  }
  ImageTask making = task(darks, "calibrate");
  run(making);
  ASSERT_FALSE(making.failure());
  const image::Json master = findings()["master"];
  EXPECT_EQ(master["kind"], "dark");
  EXPECT_EQ(master["generation"], 1);
  EXPECT_TRUE(std::filesystem::exists(images_ / "calibration/dark_0001.master"));

  ImageTask with = task({darks[0]}, "star_centroid");
  run(with);
  EXPECT_EQ(findings()["calibration"][0]["sha256"], master["sha256"]);
  EXPECT_EQ(findings()["frames"][0]["dark"], 1);
  EXPECT_LT(findings()["frames"][0]["background"], 5);

  ImageTask without = task({darks[0]}, "star_centroid", 200'000, "calibrated=0");
  run(without);
  EXPECT_TRUE(findings()["calibration"].empty());
  EXPECT_GT(findings()["frames"][0]["background"], 190);
}

TEST_F(ImageTaskTest, AMasterThatIsInUseIsASuccessAlsoWhereTheDiskTakesNoProduct) {
  std::vector<std::string> darks;
  for (int k = 1; k <= 3; ++k) darks.push_back(store(k, image::Plane(96, 64, 200)));
  ASSERT_TRUE(write_file_atomically(images_ / "products", "a file where the folder should be"));
  ImageTask making = task(darks, "calibrate");
  std::vector<std::string> problems;
  while (!making.is_done()) {
    const StepReport report = making.step(store_);
    problems.insert(problems.end(), report.problems.begin(), report.problems.end());
  }

  EXPECT_FALSE(making.failure()) << making.failure()->reason;
  EXPECT_TRUE(std::filesystem::exists(images_ / "calibration/dark_0001.master"));
  EXPECT_EQ(making.counts().left_out, 2) << "findings and thumbnail";
  EXPECT_THAT(making.products(), IsEmpty());
  EXPECT_THAT(problems, Contains(HasSubstr("products")));
}

TEST_F(ImageTaskTest, MakesNoFlatWithoutADarkThatFits) {
  std::vector<std::string> lit;
  image::Plane even(96, 64, 2000);
  even.at(50, 30) = 2010;  // all of one value: saturated
  for (int k = 1; k <= 3; ++k) lit.push_back(store(k, even));
  ImageTask without = task(lit, "calibrate", 200'000, "kind=1");
  run(without);
  ASSERT_TRUE(without.failure());
  EXPECT_EQ(without.failure()->failure_code, mission::failure::no_usable_frame);
  ASSERT_EQ(refused_.size(), 3U);
  EXPECT_THAT(refused_[0], HasSubstr("there is no dark of 96 x 64 px"));

  std::vector<std::string> darks;
  for (int k = 4; k <= 6; ++k) darks.push_back(store(k, image::Plane(96, 64, 200)));
  ImageTask dark = task(darks, "calibrate");
  run(dark);
  ImageTask with = task(lit, "calibrate", 200'000, "kind=1");
  run(with);

  ASSERT_FALSE(with.failure()) << with.failure()->reason;
  EXPECT_EQ(findings()["master"]["kind"], "flat");
  EXPECT_EQ(findings()["calibration"][0]["kind"], "dark");
}

TEST_F(ImageTaskTest, SaysWhyThereIsNoMaster) {
  ImageTask work = task({store_frame(1, false), store_frame(2, false)}, "calibrate");

  run(work);

  ASSERT_TRUE(work.failure());
  EXPECT_EQ(work.failure()->failure_code, mission::failure::no_usable_frame);
  EXPECT_THAT(work.failure()->reason, HasSubstr("3 frames"));
  EXPECT_FALSE(std::filesystem::exists(images_ / "calibration"));
}

TEST_F(ImageTaskTest, LinksAnObjectOverASequenceAndMarksItsFrames) {
  hw_sim::SkyScene scene = image::small_scene(2.4, 3);
  std::vector<std::string> files;
  for (int k = 0; k < 6; ++k) {
    scene.seed = static_cast<std::uint64_t>(50 + k);
    auto stars = image::lattice(scene, 60);
    stars.push_back({60.0 + 9 * k, 75.0 + 5 * k, hw_sim::flux_for_snr(scene, 100, 90, 25)});
    files.push_back(store(k + 1, image::frame_of(scene, stars).pixels));
  }
  ImageTask work = task(files, "tracklet");

  run(work);

  ASSERT_FALSE(work.failure());
  EXPECT_EQ(work.counts().tracklets, 1U);
  EXPECT_THAT(work.products(), Contains("products/0000000017/tracklet_0000.png"));
  EXPECT_EQ(frames_.size(), 6U);
  EXPECT_TRUE(image::has_mark(images_ / files[2], FrameMark::detected));
  EXPECT_EQ(findings()["tracklets"].size(), 1U);
}

}  // namespace
}  // namespace srfs
