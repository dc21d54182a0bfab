// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/imaging/image_outbox.hpp"

#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <mission/structures.hpp>

#include "base/file.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

class ImageOutboxTest : public testing::Test {
 protected:
  void write(const std::string& name, const std::string& content = "x") {
    std::filesystem::create_directories((folder_ / name).parent_path());
    std::ofstream(folder_ / name) << content;
  }
  [[nodiscard]] std::vector<std::string> names(const std::string& folder) const {
    std::vector<std::string> found;
    for (const auto& entry : std::filesystem::directory_iterator(folder_ / folder))
      found.push_back(entry.path().filename());
    std::sort(found.begin(), found.end());
    return found;
  }
  /// Acts like CFDP when the ground has received the file.
  void send(const std::string& name) {
    std::filesystem::remove(folder_ / "files/outbox" / name);
    EXPECT_TRUE(outbox_.on_sent("outbox/" + name));
  }

  const testing_support::TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  ImageOutbox outbox_{folder_ / "images", folder_ / "files"};
};

TEST_F(ImageOutboxTest, ANameSaysWhatTheFileIsOf) {
  EXPECT_EQ(outbox_image_name({.task = 5}, 1, "findings.json"), "image_001_0000000005_findings.json");
  EXPECT_EQ(outbox_image_name({.task = 4294967295, .frame = 256}, 256, "a_b"),
            "strip_256_4294967295_0256_a_b");
  EXPECT_EQ(outbox_image_name({.task = 5, .run = 0xA1}, 1, "findings.json"),
            "image_001_r000000a1_0000000005_findings.json");
  for (const OutboxImage image : {OutboxImage{.task = 5}, OutboxImage{.task = 4294967295, .frame = 256},
                                  OutboxImage{.task = 5, .run = 0xFEDCBA98}})
    EXPECT_EQ(outbox_image(outbox_image_name(image, 7, "name")), image);
  for (const char* other :
       {"", "image_", "image_001_5_x", "image_001_00000000050_x", "image_0x1_0000000005_x",
        "image_001_9999999999_x", "image_001_ra1_0000000005_x", "strip_001_r000000a1_0000000005_0002_x",
        "strip_001_0000000005_x", "crash_report", "image_001"})
    EXPECT_FALSE(outbox_image(other)) << other;
}

TEST_F(ImageOutboxTest, FramesComeInTheirOrderAndNothingElse) {
  for (const char* name : {"0002.fits", "0001.fits", "0001.detected", "0003.fits", ".0004.fits"})
    write("images/frames/0000000005/" + std::string(name));
  EXPECT_THAT(outbox_.frames_of(5, 0),
              ElementsAre("frames/0000000005/0001.fits", "frames/0000000005/0002.fits",
                          "frames/0000000005/0003.fits"));
  EXPECT_THAT(outbox_.frames_of(5, 2), ElementsAre("frames/0000000005/0002.fits"));
  EXPECT_THAT(outbox_.frames_of(5, 9), IsEmpty());
  EXPECT_THAT(outbox_.frames_of(6, 0), IsEmpty());
}

TEST_F(ImageOutboxTest, ProductsAreQueuedInTheirOrderAndStayOnBoard) {
  write("images/products/0000000005/z.json", "first");
  write("images/products/0000000005/a.png", "second");
  const auto done = outbox_.queue({.task = 5}, {"products/0000000005/z.json", "products/0000000005/a.png"});
  EXPECT_EQ(done.failure, 0) << done.reason;
  EXPECT_EQ(done.queued, 2U);
  EXPECT_THAT(names("files/outbox"),
              ElementsAre("image_001_0000000005_z.json", "image_002_0000000005_a.png"));
  EXPECT_EQ(read_file(folder_ / "files/outbox/image_001_0000000005_z.json").value(), "first");
  EXPECT_THAT(names("images/products/0000000005"), ElementsAre("a.png", "z.json"));

  EXPECT_EQ(outbox_.queue({.task = 5}, {"products/0000000005/z.json"}).failure, 0) << "after a restart";
  EXPECT_EQ(names("files/outbox").size(), 2U);
}

TEST_F(ImageOutboxTest, ANewProductDoesNotDisturbAnOlderOneOfItsNameThatIsBeingSent) {
  write("images/products/0000000005/a.json", "old");
  ASSERT_EQ(outbox_.queue({.task = 5}, {"products/0000000005/a.json"}).failure, 0);
  ASSERT_TRUE(write_file_atomically(folder_ / "images/products/0000000005/a.json", "new"));
  ASSERT_EQ(outbox_.queue({.task = 5}, {"products/0000000005/a.json"}).failure, 0);
  EXPECT_EQ(read_file(folder_ / "files/outbox/image_001_0000000005_a.json").value(), "old");
  EXPECT_EQ(read_file(folder_ / "files/outbox/image_001_0000000005_2_a.json").value(), "new");
}

TEST_F(ImageOutboxTest, TheNameOfACancelledTransferIsNotUsedWhileTheGroundHasNotEndedIt) {
  write("images/products/0000000005/a.json", "new");
  const auto is_sending = [](const std::string& name) { return name == "image_001_0000000005_a.json"; };
  ASSERT_EQ(outbox_.queue({.task = 5}, {"products/0000000005/a.json"}, is_sending).failure, 0);
  EXPECT_THAT(names("files/outbox"), ElementsAre("image_001_0000000005_2_a.json"));
}

TEST_F(ImageOutboxTest, OfATaskNumberUsedAgainTheNewestFramesAreTakenAndAllAreMarked) {
  for (int i = 1; i <= 300; ++i) {
    write(fmt::format("images/frames/0000000005/{:04}.fits", i));
    write(fmt::format("images/frames/0000000005/{:04}.nothing", i));
  }
  const auto newest = outbox_.newest_frames_of(5, 0);
  ASSERT_EQ(newest.size(), ImageOutbox::max_frames);
  EXPECT_EQ(newest.back(), "frames/0000000005/0300.fits");
  send("image_001_0000000005_a");
  for (int i = 0; i < 80; ++i) outbox_.mark_some();
  EXPECT_TRUE(std::filesystem::exists(folder_ / "images/frames/0000000005/0300.sent"));
}

TEST_F(ImageOutboxTest, FramesThatNobodySearchedAreNotMarked) {
  write("images/frames/0000000005/0001.fits");
  send("image_001_0000000005_thumbnail.png");
  outbox_.mark_some();
  EXPECT_FALSE(std::filesystem::exists(folder_ / "images/frames/0000000005/0001.sent"));
}

TEST_F(ImageOutboxTest, WhatIsNoProductIsNotSent) {
  write("secret");
  write("images/a");
  std::filesystem::create_symlink(folder_ / "secret", folder_ / "images/link");
  for (const char* name : {"../secret", "/etc/passwd", "", "products/../../secret"})
    EXPECT_EQ(outbox_.queue({.task = 5}, {name}).failure, mission::failure::bad_file_name) << name;
  EXPECT_EQ(outbox_.queue({.task = 5}, {"link"}).failure, mission::failure::disk_failed);
  const auto half = outbox_.queue({.task = 5}, {"a", "missing"});
  EXPECT_EQ(half.failure, mission::failure::file_not_found);
  EXPECT_EQ(half.queued, 1U);
  EXPECT_THAT(names("files/outbox"), ElementsAre("image_001_0000000005_a"));
}

TEST_F(ImageOutboxTest, AFullOutboxTakesNoMore) {
  for (std::size_t i = 0; i < ImageOutbox::max_outbox_files; ++i) write("files/outbox/" + std::to_string(i));
  write("images/a");
  EXPECT_EQ(outbox_.queue({.task = 5}, {"a"}).failure, mission::failure::outbox_full);
}

TEST_F(ImageOutboxTest, FramesAreMarkedWhenTheGroundHasAllProductsAlsoAfterARestart) {
  for (int i = 1; i <= 9; ++i) {
    write("images/frames/0000000005/000" + std::to_string(i) + ".fits");
    write("images/frames/0000000005/000" + std::to_string(i) + (i % 2 == 0 ? ".detected" : ".nothing"));
  }
  write("files/outbox/image_001_0000000005_a");
  write("files/outbox/image_002_0000000005_b");
  write("files/outbox/image_001_0000000006_a");
  send("image_001_0000000005_a");
  outbox_.mark_some();
  EXPECT_FALSE(std::filesystem::exists(folder_ / "images/frames/0000000005/0001.sent"));
  send("image_002_0000000005_b");
  for (int i = 0; i < 4; ++i) outbox_.mark_some();
  for (int i = 1; i <= 9; ++i)
    EXPECT_TRUE(
        std::filesystem::exists(folder_ / ("images/frames/0000000005/000" + std::to_string(i) + ".sent")));
}

TEST_F(ImageOutboxTest, OnlyTheDetectionsOfTheRunThatWasSentAreMarked) {
  const std::filesystem::path frames = folder_ / "images/frames/0000000005";
  for (const char* name : {"0001", "0002", "0003"})
    write(std::string("images/frames/0000000005/") + name + ".fits");
  ASSERT_TRUE(image::mark_detected(frames / "0001.fits", "streak", 0xA));  // cancelled: no products
  ASSERT_TRUE(image::mark_detected(frames / "0002.fits", "tracklet", 0xB));
  ASSERT_TRUE(image::mark_frame(frames / "0003.fits", image::FrameMark::nothing));
  write("files/outbox/image_001_r0000000a_0000000005_x");
  write("files/outbox/image_001_r0000000b_0000000005_findings.json");
  send("image_001_r0000000b_0000000005_findings.json");
  for (int i = 0; i < 4; ++i) outbox_.mark_some();
  EXPECT_TRUE(image::has_unsent_detection(frames / "0001.fits"));
  EXPECT_FALSE(image::has_unsent_detection(frames / "0002.fits"))
      << "the other run's products are still here";
  EXPECT_TRUE(image::has_mark(frames / "0003.fits", image::FrameMark::sent));

  send("strip_001_0000000005_0001_a");
  outbox_.mark_some();
  EXPECT_FALSE(image::has_unsent_detection(frames / "0001.fits")) << "the ground has the whole frame";
}

TEST_F(ImageOutboxTest, AProductThatCouldNotBeSentKeepsItsFramesUnmarked) {
  write("images/frames/0000000005/0001.fits");
  write("files/outbox/image_001_0000000005_a");
  write("files/unsent/image_002_0000000005_b");
  send("image_001_0000000005_a");
  outbox_.mark_some();
  EXPECT_FALSE(std::filesystem::exists(folder_ / "images/frames/0000000005/0001.sent"));
}

TEST_F(ImageOutboxTest, AFrameThatWasSentWholeIsMarkedAlone) {
  write("images/frames/0000000005/0001.fits");
  write("images/frames/0000000005/0002.fits");
  write("files/outbox/strip_001_0000000005_0002_a");
  send("strip_001_0000000005_0002_a");
  outbox_.mark_some();
  EXPECT_FALSE(std::filesystem::exists(folder_ / "images/frames/0000000005/0001.sent"));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "images/frames/0000000005/0002.sent"));
}

TEST_F(ImageOutboxTest, OtherFilesAreNobodysBusiness) {
  EXPECT_FALSE(outbox_.on_sent("outbox/crash_report"));
  EXPECT_FALSE(outbox_.on_sent("image_001_0000000005_a"));
}

TEST_F(ImageOutboxTest, ATaskIsTakenOutOfTheOutboxWithAllThatIsOfIt) {
  for (const char* name :
       {"image_001_0000000005_a", "strip_001_0000000005_0002_a", "image_001_0000000006_a", "b"})
    write("files/outbox/" + std::string(name));
  EXPECT_EQ(outbox_.remove(outbox_.queued(5)), 2U);
  EXPECT_THAT(names("files/outbox"), ElementsAre("b", "image_001_0000000006_a"));
}

}  // namespace
}  // namespace srfs
