// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_acquisition/capture_sequence.hpp"

#include <gtest/gtest.h>

#include <mission/structures.hpp>

namespace srfs {
namespace {

CaptureRequest good() {
  CaptureRequest request;
  request.task = 17;
  request.exposure = milliseconds(100);
  request.frames = 3;
  request.interval = milliseconds(500);
  return request;
}

TEST(CaptureRequest, IsRefusedOutOfRangeWithWhatWasExpected) {
  EXPECT_FALSE(refuse(good()));
  const auto expect_refused = [](auto change, const std::string& words) {
    CaptureRequest request = good();
    change(request);
    const auto refused = refuse(request);
    ASSERT_TRUE(refused) << words;
    EXPECT_EQ(refused->code, mission::failure::bad_argument);
    EXPECT_NE(refused->reason.find(words), std::string::npos) << refused->reason;
  };
  expect_refused([](CaptureRequest& r) { r.task = 0; }, "task 0");
  expect_refused([](CaptureRequest& r) { r.exposure = microseconds(0); }, "exposure 0 us");
  expect_refused([](CaptureRequest& r) { r.exposure = microseconds(60'000'001); }, "60000000");
  expect_refused([](CaptureRequest& r) { r.gain_db = std::nan(""); }, "gain");
  expect_refused([](CaptureRequest& r) { r.gain_db = -0.1; }, "gain");
  expect_refused([](CaptureRequest& r) { r.frames = 0; }, "0 frames");
  expect_refused([](CaptureRequest& r) { r.frames = 257; }, "257 frames");
  expect_refused([](CaptureRequest& r) { r.interval = milliseconds(3'600'001); }, "interval");
}

TEST(CaptureRequest, InThePastIsRefusedUnlessItMayBeLate) {
  const UtcTime now(seconds(1000));
  EXPECT_FALSE(refuse_past(now, now, nanoseconds(0)));
  EXPECT_FALSE(refuse_past(now - milliseconds(900), now, seconds(1)));
  const auto refused = refuse_past(now - milliseconds(1500), now, seconds(1));
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->code, mission::failure::capture_time_past);
  EXPECT_EQ(refused->reason, "the start was 1.500 s ago");
}

TEST(CaptureSequence, HasItsFramesDueAtTheInterval) {
  CaptureSequence sequence(3, milliseconds(500));
  EXPECT_EQ(sequence.due(), nanoseconds(0));
  sequence.on_sound(10);
  EXPECT_EQ(sequence.due(), milliseconds(500));
  sequence.on_sound(-30);
  EXPECT_EQ(sequence.next(), 2);
  EXPECT_EQ(sequence.due(), milliseconds(1000));
  EXPECT_FALSE(sequence.all_taken());
  sequence.on_sound(20);
  EXPECT_TRUE(sequence.all_taken());
  EXPECT_EQ(sequence.largest_start_error_us(), -30);
}

TEST(CaptureSequence, WithoutAnIntervalIsDueAsSoonAsItCan) {
  CaptureSequence sequence(2, nanoseconds(0));
  EXPECT_EQ(sequence.due(), nanoseconds(0)) << "the first at the start";
  sequence.on_sound(0);
  EXPECT_EQ(sequence.due(), std::nullopt);
}

TEST(CaptureSequence, TriesAFrameThreeTimes) {
  CaptureSequence sequence(2, seconds(1));
  EXPECT_TRUE(sequence.on_unsound());
  EXPECT_TRUE(sequence.on_unsound());
  sequence.on_sound(0);
  EXPECT_TRUE(sequence.on_unsound()) << "the next frame has tries of its own";
  EXPECT_TRUE(sequence.on_unsound());
  EXPECT_FALSE(sequence.on_unsound());
  EXPECT_EQ(sequence.next(), 1);
}

TEST(StartError, IsSignedMicrosecondsWithinItsRange) {
  const MonotonicTime due(seconds(5));
  EXPECT_EQ(start_error_us(due + microseconds(70), due), 70);
  EXPECT_EQ(start_error_us(due - microseconds(3), due), -3);
  EXPECT_EQ(start_error_us(due + seconds(86400), due), INT32_MAX);
}

}  // namespace
}  // namespace srfs
