// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/file/frame_mark.hpp"

#include <gtest/gtest.h>

#include "tests/temporary_folder.hpp"

namespace srfs::image {
namespace {

class FrameMarkTest : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(write_file_atomically(frame_, "pixels")); }
  void detect(std::string_view method, ProcessingRun run) { ASSERT_TRUE(mark_detected(frame_, method, run)); }
  void send(std::optional<ProcessingRun> run) { ASSERT_TRUE(mark_sent(frame_, run)); }

  testing_support::TemporaryFolder folder_;
  const std::filesystem::path frame_ = folder_.path() / "0001.fits";
};

TEST_F(FrameMarkTest, AFrameOfWhichNothingIsKnownHasNothingToSendButItself) {
  EXPECT_FALSE(has_unsent_detection(frame_));
  EXPECT_FALSE(lacks_sent_mark(frame_, 0xA)) << "nobody searched it";
  EXPECT_TRUE(lacks_sent_mark(frame_, std::nullopt));
}

TEST_F(FrameMarkTest, ADetectionIsSentByTheProductsOfItsRunAlone) {
  detect("streak", 0xA);
  EXPECT_TRUE(has_unsent_detection(frame_));
  EXPECT_FALSE(lacks_sent_mark(frame_, 0xB));
  ASSERT_TRUE(lacks_sent_mark(frame_, 0xA));
  send(0xA);
  EXPECT_FALSE(has_unsent_detection(frame_));
  EXPECT_FALSE(lacks_sent_mark(frame_, 0xA)) << "it is said";
}

TEST_F(FrameMarkTest, EachMethodsLatestDetectionHasToBeSent) {
  detect("streak", 0xA);
  send(0xA);
  detect("tracklet", 0xB);
  EXPECT_TRUE(has_unsent_detection(frame_));
  detect("streak", 0xC);  // replaces A
  send(0xB);
  EXPECT_TRUE(has_unsent_detection(frame_)) << "C";
  send(0xC);
  EXPECT_FALSE(has_unsent_detection(frame_));
  EXPECT_EQ(read_file(mark_path(frame_, FrameMark::detected)).value(),
            "tracklet 0000000b\nstreak 0000000c\n");
  EXPECT_EQ(read_file(mark_path(frame_, FrameMark::sent)).value(), "0000000c\n0000000b\n")
      << "bounded: what is superseded goes";
}

TEST_F(FrameMarkTest, AFrameSentWholeHasAllThatWasFoundInItUntilThen) {
  detect("streak", 0xA);
  detect("tracklet", 0xB);
  send(std::nullopt);
  EXPECT_FALSE(has_unsent_detection(frame_));
  EXPECT_FALSE(lacks_sent_mark(frame_, std::nullopt));
  detect("streak", 0xC);
  EXPECT_TRUE(has_unsent_detection(frame_));
}

TEST_F(FrameMarkTest, EmptyMarksAreOfNoRun) {
  ASSERT_TRUE(mark_frame(frame_, FrameMark::detected));
  EXPECT_TRUE(has_unsent_detection(frame_));
  ASSERT_TRUE(mark_frame(frame_, FrameMark::sent));
  EXPECT_FALSE(has_unsent_detection(frame_));
  detect("streak", 0xA);
  EXPECT_TRUE(has_unsent_detection(frame_)) << "that it is sent was said before";
  EXPECT_FALSE(has_mark(frame_, FrameMark::sent));
}

TEST_F(FrameMarkTest, ANothingMarkGoesWhenSomethingIsFound) {
  ASSERT_TRUE(mark_frame(frame_, FrameMark::nothing));
  EXPECT_TRUE(lacks_sent_mark(frame_, 0xA));
  detect("streak", 0xB);
  EXPECT_FALSE(has_mark(frame_, FrameMark::nothing));
}

TEST_F(FrameMarkTest, AMarkThatCannotBeReadKeepsItsFrame) {
  ASSERT_TRUE(write_file_atomically(mark_path(frame_, FrameMark::detected), "streak 0x\n\n ?"));
  ASSERT_TRUE(write_file_atomically(mark_path(frame_, FrameMark::sent), "zzz\n"));
  EXPECT_TRUE(has_unsent_detection(frame_));
  ASSERT_TRUE(write_file_atomically(mark_path(frame_, FrameMark::sent), std::string(10'000, '0')));
  EXPECT_TRUE(has_unsent_detection(frame_));
}

TEST_F(FrameMarkTest, AFrameThatIsGoneTakesNoMark) {
  std::filesystem::remove(frame_);
  detect("streak", 0xA);
  send(0xA);
  EXPECT_FALSE(has_mark(frame_, FrameMark::detected));
  EXPECT_FALSE(has_mark(frame_, FrameMark::sent));
}

TEST(RunOfGoal, IsTheBeginOfItsId) {
  EXPECT_EQ(run_of_goal({0x12, 0x34, 0x56, 0x78, 9}), 0x12345678U);
  EXPECT_EQ(run_of_goal({}), 1U);
}

}  // namespace
}  // namespace srfs::image
