// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_acquisition/frame_store.hpp"

#include <gtest/gtest.h>

#include "image/file/frame_mark.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

namespace fs = std::filesystem;
using image::FrameMark;

constexpr std::uint64_t kib = 1024;

class FrameStoreTest : public testing::Test {
 protected:
  /// Stores a frame of one KiB.
  Result<std::string, FrameStore::Failure> add(FrameStore& store, std::uint32_t task) {
    const Octets content(kib, 0x55);
    return store.add(task, store.next_number(task).value(), content);
  }
  void mark(const std::string& file, FrameMark how) { ASSERT_TRUE(image::mark_frame(images_ / file, how)); }
  bool is_there(const std::string& file) { return fs::exists(images_ / file); }

  testing_support::TemporaryFolder temporary_;
  const fs::path images_ = temporary_.path() / "images";
};

TEST_F(FrameStoreTest, NumbersTheFramesOfATaskFromOneOn) {
  FrameStore store(images_, 100 * kib);
  ASSERT_TRUE(store.open());
  EXPECT_EQ(add(store, 17).value(), "frames/0000000017/0001.fits");
  EXPECT_EQ(add(store, 17).value(), "frames/0000000017/0002.fits");
  EXPECT_EQ(add(store, 4294967295).value(), "frames/4294967295/0001.fits");
  EXPECT_EQ(store.figures().frames, 3U);
  EXPECT_EQ(store.figures().octets, 3 * kib);
  EXPECT_EQ(fs::file_size(images_ / "frames/0000000017/0002.fits"), kib);
}

TEST_F(FrameStoreTest, GoesOnAfterARestartAndNeverWritesOverAFrame) {
  {
    FrameStore store(images_, 100 * kib);
    ASSERT_TRUE(store.open());
    add(store, 5).value();
    add(store, 5).value();
  }
  fs::remove(images_ / frame_file(5, 1));
  FrameStore again(images_, 100 * kib);
  ASSERT_TRUE(again.open());
  EXPECT_EQ(again.figures().frames, 1U);
  EXPECT_EQ(add(again, 5).value(), "frames/0000000005/0003.fits");
}

TEST_F(FrameStoreTest, RemovesWhatAPowerLossLeft) {
  FrameStore store(images_, 100 * kib);
  ASSERT_TRUE(store.open());
  const std::string kept = add(store, 5).value();
  mark(kept, FrameMark::detected);
  const fs::path folder = images_ / "frames/0000000005";
  for (const char* name : {"0002.fits.123.tmp", "0007.sent", "notes.txt"})
    ASSERT_TRUE(write_file_atomically(folder / name, "x"));
  ASSERT_TRUE(write_file_atomically(images_ / "frames/other/0001.fits", "x"));
  FrameStore again(images_, 100 * kib);
  ASSERT_TRUE(again.open());
  EXPECT_EQ(again.figures().frames, 1U);
  EXPECT_FALSE(fs::exists(folder / "0002.fits.123.tmp"));
  EXPECT_FALSE(fs::exists(folder / "0007.sent")) << "a mark without its frame";
  EXPECT_TRUE(fs::exists(folder / "0001.detected"));
  EXPECT_TRUE(fs::exists(folder / "notes.txt")) << "not ours";
}

TEST_F(FrameStoreTest, MakesRoomBySentThenEmptyThenUnmarkedFramesWithTheirMarks) {
  FrameStore store(images_, 4 * kib);
  ASSERT_TRUE(store.open());
  const std::string unmarked = add(store, 1).value();
  const std::string nothing = add(store, 2).value();
  const std::string sent = add(store, 3).value();
  const std::string detected = add(store, 4).value();
  mark(nothing, FrameMark::nothing);
  mark(sent, FrameMark::detected);
  mark(sent, FrameMark::sent);
  mark(detected, FrameMark::detected);

  ASSERT_TRUE(add(store, 5));
  EXPECT_FALSE(is_there(sent));
  EXPECT_FALSE(fs::exists(images_ / "frames/0000000003")) << "with its marks and its folder";
  ASSERT_TRUE(add(store, 5));
  EXPECT_FALSE(is_there(nothing));
  EXPECT_TRUE(is_there(unmarked));
  ASSERT_TRUE(add(store, 5));
  EXPECT_FALSE(is_there(unmarked));

  const auto full = add(store, 5);
  ASSERT_FALSE(full);
  EXPECT_TRUE(full.error().full);
  EXPECT_NE(full.error().reason.find("1 of 4 frames have detections not sent"), std::string::npos)
      << full.error().reason;
  EXPECT_TRUE(is_there(detected)) << "until it is sent";
  EXPECT_EQ(store.figures().removed, 3U);

  mark(detected, FrameMark::sent);
  EXPECT_TRUE(add(store, 5));
  EXPECT_FALSE(is_there(detected));
}

TEST_F(FrameStoreTest, KeepsAFrameWhoseDetectionIsOfARunThatWasNotSent) {
  FrameStore store(images_, 2 * kib);
  ASSERT_TRUE(store.open());
  const std::string kept = add(store, 1).value();
  const std::string gone = add(store, 2).value();
  for (const std::string& file : {kept, gone}) {
    ASSERT_TRUE(image::mark_detected(images_ / file, "streak", 0xA));
    ASSERT_TRUE(image::mark_sent(images_ / file, 0xA));
  }
  ASSERT_TRUE(image::mark_detected(images_ / kept, "tracklet", 0xB));
  ASSERT_TRUE(add(store, 3));
  EXPECT_TRUE(is_there(kept)) << "the older one, but of run B the ground has nothing";
  EXPECT_FALSE(is_there(gone));
  ASSERT_TRUE(add(store, 4));
  EXPECT_TRUE(is_there(kept)) << "rather the new one";
}

TEST_F(FrameStoreTest, SaysWhenTheDiskFails) {
  FrameStore store(images_, 100 * kib);
  ASSERT_TRUE(store.open());
  ASSERT_TRUE(write_file_atomically(images_ / "frames/0000000009", "a file where a folder is due"));
  const auto stored = add(store, 9);
  ASSERT_FALSE(stored);
  EXPECT_FALSE(stored.error().full);
  EXPECT_NE(stored.error().reason.find("0000000009"), std::string::npos);
  EXPECT_EQ(store.figures().frames, 0U);

  FrameStore nowhere(images_ / "frames/0000000009/x", kib);
  EXPECT_FALSE(nowhere.open());
}

TEST_F(FrameStoreTest, TakesNothingWhileItCannotReadAllThatIsThere) {
  FrameStore store(images_, 2 * kib);
  ASSERT_TRUE(store.open());
  const std::string first = add(store, 5).value();
  const fs::path loop = images_ / "frames/0000000009";
  fs::create_symlink("0000000009", loop);

  const auto opened = store.open();
  ASSERT_FALSE(opened);
  EXPECT_NE(opened.error().message.find("0000000009: "), std::string::npos) << opened.error().message;
  EXPECT_FALSE(store.is_open());
  EXPECT_EQ(store.next_number(5), std::nullopt) << "the first one's number is taken, but nobody knows";
  const auto refused = store.add(5, 1, Octets(kib));
  ASSERT_FALSE(refused);
  EXPECT_FALSE(refused.error().full);
  EXPECT_TRUE(is_there(first));

  fs::remove(loop);
  ASSERT_TRUE(store.open());
  EXPECT_EQ(add(store, 5).value(), "frames/0000000005/0002.fits");
}

TEST_F(FrameStoreTest, HasNumbersToFourDigits) {
  ASSERT_TRUE(write_file_atomically(images_ / frame_file(5, 9999), "x"));
  FrameStore store(images_, 100 * kib);
  ASSERT_TRUE(store.open());
  EXPECT_EQ(store.next_number(5), std::nullopt);
  EXPECT_EQ(store.next_number(6), 1);
}

}  // namespace
}  // namespace srfs
