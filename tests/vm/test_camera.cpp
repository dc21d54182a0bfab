// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The V4L2 back-end on the kernel's virtual video driver: one device with the single-planar and one with the
// multi-planar API.

#include <algorithm>
#include <map>
#include <optional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "hw/camera/camera.hpp"
#include "hw/camera/pixel_format.hpp"
#include "nodes/image_acquisition/frame_check.hpp"
#include "tests/vm/virtual_camera.hpp"
#include "tests/vm/virtual_can.hpp"

namespace srfs::hw {
namespace {

using testing::HasSubstr;
using vm::VirtualCamera;

constexpr microseconds exposure{5000};
constexpr int width = 320;
constexpr int height = 180;
/// The driver has no exposure control, so the options set the exposure.
constexpr const char* usual = "?width=320&height=180&exposure_us=5000";

std::unique_ptr<Camera> make(const VirtualCamera& device, const std::string& options = usual) {
  return open_camera("v4l2:" + device.path().string() + options, "/").value();
}

/// A device in the state after loading the module, with the picture that the tests expect.
class V4l2Test : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    const auto paths = VirtualCamera::all();
    if (paths.empty()) GTEST_SKIP() << "this kernel has no vivid (Debian's has)";
    for (const auto& path : paths) {
      VirtualCamera camera(path);
      if (camera.is_multi_planar() == GetParam()) device_.emplace(std::move(camera));
    }
    ASSERT_TRUE(device_) << "run_tests.py loads the module with both";
    device_->choose("Test Pattern", "75% Colorbar");
    device_->choose("OSD Text Mode", "None");
    device_->choose("Horizontal Movement", "No Movement");
    device_->choose("Timestamp Source", "End of Frame");
    device_->set("Percentage of Dropped Buffers", 0);
    device_->set_rate(30);
    camera_ = make(*device_);
  }

  void open() {
    const auto opened = camera_->open();
    ASSERT_TRUE(opened) << opened.error().reason;
  }
  void prepare(double gain_db = 0) {
    const auto prepared = camera_->prepare({exposure, gain_db});
    ASSERT_TRUE(prepared) << prepared.error().reason;
  }
  /// Why the open camera could not be prepared.
  std::string refusal_to_prepare(CameraFault::Kind kind, const CameraSettings& settings = {exposure, 0}) {
    const auto prepared = camera_->prepare(settings);
    if (prepared) return "it was prepared";
    EXPECT_EQ(prepared.error().kind, kind);
    return prepared.error().reason;
  }
  /// The frame or fault of one exposure; nullopt when neither arrives within @p patience.
  Result<std::optional<CameraFrame>, CameraFault> frame(nanoseconds patience = vm::patience) {
    if (auto begun = camera_->begin(); !begun) return Err(begun.error());
    return camera_->take(patience);
  }
  CameraFrame good_frame() {
    auto taken = frame();
    if (!taken || !*taken) {
      ADD_FAILURE() << (taken ? "no frame came" : taken.error().reason);
      return {};
    }
    return std::move(**taken);
  }
  void expect_works() {
    open();
    prepare();
    EXPECT_EQ(good_frame().pixels.width(), width);
    camera_->abandon();
  }

  std::optional<VirtualCamera> device_;
  std::unique_ptr<Camera> camera_;
};

TEST_P(V4l2Test, TakesTheDeepestFormatInTheSizeAskedFor) {
  const auto opened = camera_->open();
  ASSERT_TRUE(opened) << opened.error().reason;
  EXPECT_EQ(*opened, "vivid, 320 x 180, Y16");
  prepare();
  const CameraFrame taken = good_frame();
  EXPECT_EQ(taken.pixels.width(), width);
  EXPECT_EQ(taken.pixels.height(), height);
  EXPECT_EQ(taken.bits, 16);
  EXPECT_EQ(taken.saturation_adu, 65535);
  EXPECT_EQ(taken.settings.exposure, exposure);
}

TEST_P(V4l2Test, HasOneSizeOfTheDevicesForASizeThatItDoesNotOffer) {
  camera_ = make(*device_, "?width=333&height=188&exposure_us=5000");
  const auto opened = camera_->open();
  ASSERT_TRUE(opened) << opened.error().reason;
  EXPECT_EQ(*opened, "vivid, 320 x 180, Y16");
}

TEST_P(V4l2Test, SeesTheSamePictureInEveryFormat) {
  const auto offered = device_->formats();
  std::map<std::string, image::Grid<std::uint16_t>> of_eight_bits;  // by colour order
  std::size_t seen = 0;
  for (auto format = pixel_formats().rbegin(); format != pixel_formats().rend(); ++format) {
    if (!offered.contains(format->fourcc)) continue;
    SCOPED_TRACE(format->name);
    camera_ = make(*device_, usual + fmt::format("&format={}", format->name));
    open();
    prepare();
    const CameraFrame taken = good_frame();
    camera_->close();
    ++seen;
    ASSERT_EQ(taken.bits, format->bits);
    ASSERT_EQ(taken.pixels.size(), static_cast<std::size_t>(width) * height);
    const std::string order = format->bayer ? std::string(format->name.substr(0, 5)) : "grey";
    if (format->bits == 8) {
      of_eight_bits[order] = taken.pixels;
      const auto [least, most] =
          std::minmax_element(taken.pixels.cells().begin(), taken.pixels.cells().end());
      EXPECT_GT(*most - *least, 100) << "bars";
      continue;
    }
    ASSERT_TRUE(of_eight_bits.contains(order));
    const auto& coarse = of_eight_bits.at(order).cells();
    std::size_t others = 0;
    for (std::size_t i = 0; i < coarse.size(); ++i)
      others += std::abs((taken.pixels.cells()[i] >> (format->bits - 8)) - coarse[i]) > 1 ? 1 : 0;
    EXPECT_EQ(others, 0U) << "of " << coarse.size() << " pixels";
  }
  EXPECT_EQ(of_eight_bits.size(), 5U) << "grey and four orders";
  EXPECT_EQ(seen, 20U) << "of 8, 10, 12 and 16 bits";
}

TEST_P(V4l2Test, RefusesAFormatThatTheDeviceDoesNotOffer) {
  camera_ = make(*device_, usual + std::string("&format=Y12P"));
  const auto opened = camera_->open();
  ASSERT_FALSE(opened);
  EXPECT_THAT(opened.error().reason, HasSubstr("formats is Y12P"));
}

TEST_P(V4l2Test, GivesAnotherPictureWithEachExposureAndSaysWhenItBegan) {
  device_->choose("Horizontal Movement", "Move Right Fast");
  for (const char* stamp : {"End of Frame", "Start of Exposure"}) {
    SCOPED_TRACE(stamp);
    device_->choose("Timestamp Source", stamp);
    open();
    prepare();
    std::optional<CameraFrame> before;
    for (int n = 0; n < 4; ++n) {
      const MonotonicTime begun = monotonic_now();
      CameraFrame taken = good_frame();
      EXPECT_GE(taken.begin, begun);
      EXPECT_LE(taken.begin, monotonic_now());
      if (before) {
        EXPECT_GT(taken.sequence, before->sequence);
        EXPECT_FALSE(std::equal(taken.pixels.cells().begin(), taken.pixels.cells().end(),
                                before->pixels.cells().begin()));
      }
      before = std::move(taken);
    }
    camera_->close();
  }
}

TEST_P(V4l2Test, GoesOnCountingWhenItStreamsAgain) {
  device_->choose("Horizontal Movement", "Move Right Fast");
  FrameCheck check;  // treats a repeated number as a repeated frame
  open();
  std::uint32_t last = 0;
  for (int n = 0; n < 3; ++n) {
    prepare();
    const MonotonicTime begun = monotonic_now();
    const CameraFrame taken = good_frame();
    EXPECT_GT(taken.sequence, last) << "the driver begins at 0 again";
    EXPECT_EQ(check.judge(taken, begun), std::nullopt);
    last = taken.sequence;
    camera_->abandon();
    EXPECT_FALSE(camera_->take(nanoseconds(0))) << "nothing is under way";
    // The moving pattern restarts at its first position, so change it to avoid a repeated picture.
    device_->choose("Test Pattern", n % 2 == 0 ? "100% Colorbar" : "75% Colorbar");
    open();
  }
}

TEST_P(V4l2Test, LeavesOutFramesFromBeforeTheExposure) {
  open();
  prepare();
  static_cast<void>(good_frame());
  ::usleep(300'000);  // lets all buffers fill
  const MonotonicTime begun = monotonic_now();
  EXPECT_GE(good_frame().begin, begun);
}

TEST_P(V4l2Test, SetsTheGainAndRefusesWhatTheControlsCannot) {
  open();
  device_->set("Gain, Automatic", 1);
  prepare(12.3);
  EXPECT_EQ(device_->get("Gain, Automatic"), 0);
  EXPECT_EQ(device_->get("Gain"), 123) << "a tenth of a decibel each";
  EXPECT_THAT(refusal_to_prepare(CameraFault::Kind::bad_setting, {exposure, 60}),
              HasSubstr("gain is out of the camera's range"));
  EXPECT_THAT(refusal_to_prepare(CameraFault::Kind::bad_setting, {2 * exposure, 0}),
              HasSubstr("exposure is out of the camera's range"));
  prepare();
  EXPECT_TRUE(frame()) << "it is none the worse for it";

  camera_ = make(*device_, "?width=320&height=180");
  open();
  EXPECT_THAT(refusal_to_prepare(CameraFault::Kind::bad_setting), HasSubstr("exposure has no control"));
}

TEST_P(V4l2Test, SetsTheControlsOfAnotherDevice) {
  const auto paths = VirtualCamera::all();
  const auto other = std::find_if(paths.begin(), paths.end(),
                                  [&](const std::filesystem::path& path) { return path != device_->path(); });
  ASSERT_NE(other, paths.end());
  VirtualCamera sensor(*other);
  sensor.set("Gain, Automatic", 0);
  device_->set("Gain, Automatic", 0);
  device_->set("Gain", 7);
  camera_ = make(*device_, usual + std::string("&controls=") + sensor.path().string());
  open();
  prepare(20);
  EXPECT_EQ(sensor.get("Gain"), 200);
  EXPECT_EQ(device_->get("Gain"), 7);

  camera_ = make(*device_, usual + std::string("&controls=/nonexistent"));
  const auto opened = camera_->open();
  ASSERT_FALSE(opened);
  EXPECT_THAT(opened.error().reason, HasSubstr("/nonexistent: No such file"));
}

TEST_P(V4l2Test, SaysThatAnotherProgramHasTheStreamAndWorksAfterwards) {
  const auto other = make(*device_);
  ASSERT_TRUE(other->open());
  ASSERT_TRUE(other->prepare({exposure, 0}));
  const auto opened = camera_->open();
  const std::string why = opened ? refusal_to_prepare(CameraFault::Kind::absent) : opened.error().reason;
  EXPECT_THAT(why, testing::AnyOf(HasSubstr("busy"), HasSubstr("formats")));
  ASSERT_TRUE(other->begin());
  EXPECT_TRUE(other->take(vm::patience)) << "who had it first is not disturbed";
  other->close();
  expect_works();
}

TEST_P(V4l2Test, FailsWithAReasonWhereTheStreamCannotStartAndStartsTheNextTime) {
  const std::map<std::string, std::string> faults{
      {"Inject VIDIOC_REQBUFS Error", "request buffers"},
      {"Inject VIDIOC_QBUF Error", "queue"},
      {"Inject VIDIOC_STREAMON Error", "start the stream"},
  };
  for (const auto& [button, step] : faults) {
    SCOPED_TRACE(button);
    open();
    device_->press(button);
    EXPECT_THAT(refusal_to_prepare(CameraFault::Kind::absent), HasSubstr(": " + step + ": "));
    EXPECT_FALSE(camera_->begin());
    expect_works();
  }
}

TEST_P(V4l2Test, IsAbsentWhenTheStreamFailsAndWorksWhenOpenedAgain) {
  for (const char* button : {"Inject Fatal Streaming Error", "Inject VIDIOC_QBUF Error"}) {
    SCOPED_TRACE(button);
    open();
    prepare();
    static_cast<void>(good_frame());
    device_->press(button);
    const auto taken = frame();
    ASSERT_FALSE(taken);
    EXPECT_EQ(taken.error().kind, CameraFault::Kind::absent);
    EXPECT_FALSE(camera_->take(vm::patience)) << "at once";
    expect_works();
  }
}

TEST_P(V4l2Test, CallsAMarkedFrameUnsoundAndTakesTheNext) {
  open();
  prepare();
  std::optional<CameraFault> fault;
  for (int n = 0; n < 20 && !fault; ++n) {  // an earlier frame may carry the error flag
    ASSERT_TRUE(camera_->begin());
    device_->press("Inject V4L2_BUF_FLAG_ERROR");
    const auto taken = camera_->take(vm::patience);
    if (!taken) fault = taken.error();
  }
  ASSERT_TRUE(fault);
  EXPECT_EQ(fault->kind, CameraFault::Kind::unsound);
  EXPECT_THAT(fault->reason, HasSubstr("torn"));
  EXPECT_EQ(good_frame().pixels.width(), width) << "the stream goes on";
}

TEST_P(V4l2Test, WaitsNoLongerThanItsPatienceForFramesThatDoNotCome) {
  open();
  prepare();
  device_->set("Percentage of Dropped Buffers", 100);
  ASSERT_TRUE(camera_->begin());
  ::usleep(100'000);
  for (int n = 0; n < 3; ++n) {
    const MonotonicTime asked = monotonic_now();
    const auto taken = camera_->take(milliseconds(100));
    ASSERT_TRUE(taken) << taken.error().reason;
    EXPECT_TRUE(n == 0 || !*taken);
    EXPECT_LT(monotonic_now() - asked, seconds(5));
    const auto again = *taken ? camera_->begin() : Result<void, CameraFault>{};  // was in transfer already
    ASSERT_TRUE(again);
  }
  device_->set("Percentage of Dropped Buffers", 50);
  for (int n = 0; n < 5; ++n) EXPECT_EQ(good_frame().pixels.height(), height);
}

TEST_P(V4l2Test, IsAbsentWhenItIsUnpluggedAndBackWhenItIsPluggedIn) {
  open();
  prepare();
  static_cast<void>(good_frame());
  device_->press("Disconnect");
  auto taken = frame();
  // A frame may already be there; after it the fault follows.
  for (int n = 0; n < 10 && taken; ++n) taken = frame();
  ASSERT_FALSE(taken);
  EXPECT_EQ(taken.error().kind, CameraFault::Kind::absent);
  const auto opened = camera_->open();
  ASSERT_FALSE(opened) << "it is still away";
  EXPECT_THAT(opened.error().reason, HasSubstr("No such device"));

  const std::filesystem::path path = device_->path();
  device_.reset();  // the driver returns when its last user has closed it
  camera_ = nullptr;
  device_.emplace(path);
  camera_ = make(*device_);
  expect_works();
}

INSTANTIATE_TEST_SUITE_P(Vivid, V4l2Test, testing::Bool(), [](const auto& which) {
  return which.param ? std::string("MultiPlanar") : std::string("SinglePlanar");
});

}  // namespace
}  // namespace srfs::hw
