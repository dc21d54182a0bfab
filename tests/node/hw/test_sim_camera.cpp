// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The simulated camera at one end of its socket, the flight software's back-end at the other.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "hw/camera/camera_backends.hpp"
#include "hw_sim/camera_device.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::sim {
namespace {

using hw::CameraFault;
using testing::HasSubstr;

class SimCameraTest : public testing::Test {
 protected:
  void serve(int width = 320, int height = 240) {
    SkyCameraSettings settings;
    settings.width = width;
    settings.height = height;
    settings.pointing = FixedPointing{84.05, -1.2, 0, 0};
    auto device = CameraDevice::create(socket_, settings);
    ASSERT_TRUE(device) << device.error();
    device_ = std::move(*device);
    camera_ = hw::make_sim_camera(socket_);
    const auto opened = camera_->open();
    ASSERT_TRUE(opened) << opened.error().reason;
  }
  Result<std::optional<hw::CameraFrame>, CameraFault> shoot(microseconds exposure = milliseconds(5)) {
    if (auto ready = camera_->prepare({exposure, 0}); !ready) return Err(ready.error());
    if (auto begun = camera_->begin(); !begun) return Err(begun.error());
    return camera_->take(seconds(10));
  }
  testing_support::TemporaryFolder folder_;
  const std::filesystem::path socket_ = folder_.path() / "camera.sock";
  std::unique_ptr<CameraDevice> device_;
  std::unique_ptr<hw::Camera> camera_;
};

TEST_F(SimCameraTest, DeliversTheFrameThatWasExposedWhenAsked) {
  serve();
  const MonotonicTime before = monotonic_now();
  const auto frame = shoot(milliseconds(20));
  ASSERT_TRUE(frame) << frame.error().reason;
  ASSERT_TRUE(*frame);
  EXPECT_EQ((*frame)->pixels.width(), 320);
  EXPECT_EQ((*frame)->pixels.height(), 240);
  EXPECT_EQ((*frame)->bits, 12);
  EXPECT_GT((*frame)->begin, before);
  EXPECT_LT((*frame)->begin, monotonic_now() - milliseconds(20));
  EXPECT_EQ((*frame)->settings.exposure, milliseconds(20));
  const nlohmann::json truth = device_->truth();
  EXPECT_EQ(truth.at("sequence"), (*frame)->sequence);
  EXPECT_GT(truth.at("star_count"), 10);
  EXPECT_EQ(shoot().value()->sequence, (*frame)->sequence + 1);
}

TEST_F(SimCameraTest, RefusesWhatItCannotDo) {
  serve();
  const auto refused = camera_->prepare({seconds(61), 0});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, CameraFault::Kind::bad_setting);
  EXPECT_FALSE(camera_->prepare({milliseconds(1), 60}));
  EXPECT_TRUE(shoot());
}

TEST_F(SimCameraTest, SaysWhatIsWrongWithAFrameAndTakesTheNextOne) {
  serve();
  ASSERT_TRUE(shoot());
  device_->misbehave(CameraMisbehaviour::cut_short, 1);
  const auto cut = shoot();
  ASSERT_FALSE(cut);
  EXPECT_EQ(cut.error().kind, CameraFault::Kind::unsound);
  EXPECT_THAT(cut.error().reason, HasSubstr("short"));
  device_->misbehave(CameraMisbehaviour::torn, 1);
  EXPECT_THAT(shoot().error().reason, HasSubstr("torn"));
  const auto before = shoot();
  ASSERT_TRUE(before && *before);
  device_->misbehave(CameraMisbehaviour::repeated, 1);
  const auto again = shoot();
  ASSERT_TRUE(again && *again) << "sound in itself: the node finds that";
  EXPECT_EQ((*again)->sequence, (*before)->sequence);
  EXPECT_EQ((*again)->pixels.cells(), (*before)->pixels.cells());
  EXPECT_TRUE(shoot());
}

TEST_F(SimCameraTest, IsGoneWhenUnpluggedAndBackWhenPluggedIn) {
  serve();
  ASSERT_TRUE(shoot());
  device_->misbehave(CameraMisbehaviour::absent, 1);
  Result<std::optional<hw::CameraFrame>, CameraFault> frame = std::optional<hw::CameraFrame>{};
  for (int i = 0; i < 200 && frame; ++i) frame = shoot();
  ASSERT_FALSE(frame);
  EXPECT_EQ(frame.error().kind, CameraFault::Kind::absent);
  EXPECT_FALSE(camera_->open());
  device_->misbehave(CameraMisbehaviour::none, 1);
  Result<std::string, CameraFault> opened = camera_->open();
  const MonotonicTime until = monotonic_now() + seconds(10);
  while (!opened && monotonic_now() < until) opened = camera_->open();
  ASSERT_TRUE(opened) << opened.error().reason;
  EXPECT_TRUE(shoot());
}

TEST_F(SimCameraTest, IsAbsentWithoutPowerEvenWhenPluggedIn) {
  serve();
  device_->set_power(false);
  device_->misbehave(CameraMisbehaviour::none, 1);
  const MonotonicTime deadline = monotonic_now() + seconds(10);
  while (shoot() && monotonic_now() < deadline) {
  }
  const auto opened = camera_->open();
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().kind, CameraFault::Kind::absent);
  device_->set_power(true);
  while (!camera_->open() && monotonic_now() < deadline) {
  }
  EXPECT_TRUE(shoot());
}

TEST_F(SimCameraTest, GivesAnExposureUpForTheNext) {
  serve();
  ASSERT_TRUE(camera_->prepare({seconds(60), 0}));
  ASSERT_TRUE(camera_->begin());
  EXPECT_FALSE(*camera_->take(milliseconds(20)));
  camera_->abandon();
  const auto frame = shoot();
  ASSERT_TRUE(frame && *frame);
  EXPECT_EQ((*frame)->settings.exposure, milliseconds(5));
}

TEST_F(SimCameraTest, DeliversFramesOfTwoMegapixelsOneAfterTheOther) {
  serve(1920, 1080);
  ASSERT_TRUE(shoot());
  constexpr int frames = 10;
  const MonotonicTime start = monotonic_now();
  for (int i = 0; i < frames; ++i) {
    const auto frame = shoot(milliseconds(20));
    ASSERT_TRUE(frame && *frame);
  }
  const double frames_s = frames / std::chrono::duration<double>(monotonic_now() - start).count();
  RecordProperty("frames_per_second", std::to_string(frames_s));
  std::printf("%.1f frames a second; longest rendering %d us\n", frames_s,
              device_->counters().at("longest_render_us").get<int>());
}

}  // namespace
}  // namespace srfs::sim
