// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_processing/task_order.hpp"

#include <gmock/gmock.h>
#include <mission/structures.hpp>

#include "base/file.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs {
namespace {

using testing::HasSubstr;

ProcessRequest request(std::string method, std::string parameters = "") {
  return {17, {"frames/0000000017/0001.fits"}, std::move(method), std::move(parameters), 65536, false};
}

TEST(TaskOrder, TakesTheMethodWithItsParametersSeparatedByCommas) {
  const auto order = check_request(request("streak", "threshold=9, min_length=20,"));
  ASSERT_TRUE(order) << order.error().reason;
  EXPECT_EQ(order->method->name, "streak");
  EXPECT_EQ(order->parameters["threshold"], 9);
  EXPECT_EQ(order->parameters["min_length"], 20);
  EXPECT_EQ(order->parameters["stars"], 0);
}

TEST(TaskOrder, RefusesWhatThereIsNotAndSaysWhatThereIs) {
  const auto method = check_request(request("comets"));
  ASSERT_FALSE(method);
  EXPECT_EQ(method.error().failure_code, mission::failure::unknown_method);
  EXPECT_THAT(method.error().reason, HasSubstr("available: star_centroid"));

  for (const char* parameters : {"size=3", "threshold=abc", "threshold=1e9", "threshold", ",threshold=8"}) {
    const auto refused = check_request(request("streak", parameters));
    ASSERT_FALSE(refused) << parameters;
    EXPECT_EQ(refused.error().failure_code, mission::failure::bad_method_parameter) << parameters;
  }

  ProcessRequest empty = request("streak");
  empty.files.clear();
  EXPECT_EQ(check_request(empty).error().failure_code, mission::failure::no_usable_frame);
}

TEST(TaskOrder, WithoutAMethodIsForFullFramesOnly) {
  ProcessRequest frames = request("");
  EXPECT_EQ(check_request(frames).error().failure_code, mission::failure::unknown_method);
  frames.full_frames = true;
  const auto order = check_request(frames);
  ASSERT_TRUE(order);
  EXPECT_EQ(order->method, nullptr);
}

TEST(FramePath, StaysBelowTheFolderOfImages) {
  const testing_support::TemporaryFolder folder;
  const auto images = folder.path() / "images";
  ASSERT_TRUE(write_file_atomically(images / "frames/0000000017/0001.fits", "x"));
  ASSERT_TRUE(write_file_atomically(folder.path() / "secret", "x"));
  std::filesystem::create_symlink(folder.path() / "secret", images / "frames/link.fits");

  EXPECT_TRUE(frame_path(images, "frames/0000000017/0001.fits"));
  for (const char* name : {"", "/etc/passwd", "../secret", "frames/../../secret",
                           "frames/./0000000017/0001.fits", "frames/link.fits", "frames/.hidden",
                           "frames/none.fits", "frames//0000000017/0001.fits/", "frames/\x01"}) {
    EXPECT_FALSE(frame_path(images, name)) << name;
  }
  EXPECT_FALSE(frame_path(images, std::string("frames\0/x", 9)));
}

}  // namespace
}  // namespace srfs
