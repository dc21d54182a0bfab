// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <fstream>

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/crc32c.hpp"
#include "hw/camera/camera_backends.hpp"
#include "hw/camera/pixel_format.hpp"
#include "hw/camera/sim_camera_protocol.hpp"
#include "image/file/frame_file.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::hw {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

const PixelFormat& format(std::string_view name) {
  for (const PixelFormat& f : pixel_formats()) {
    if (f.name == name) return f;
  }
  throw std::runtime_error("no such format");
}

std::vector<std::uint16_t> unpacked(std::string_view name, int width, int height, const Octets& octets,
                                    std::size_t row_step) {
  image::Grid<std::uint16_t> pixels(width, height);
  if (!unpack_pixels(format(name), octets, row_step, pixels)) return {};
  return {pixels.cells().begin(), pixels.cells().end()};
}

TEST(PixelFormat, UnpacksOctetsAndWordsOfEveryDepth) {
  EXPECT_THAT(unpacked("GREY", 2, 2, {1, 2, 99, 3, 255}, 3), ElementsAre(1, 2, 3, 255));
  EXPECT_THAT(unpacked("SRGGB8", 2, 1, {9, 8}, 2), ElementsAre(9, 8));
  EXPECT_THAT(unpacked("Y10", 2, 1, {0x34, 0x02, 0xFF, 0x03}, 4), ElementsAre(0x234, 0x3FF));
  EXPECT_THAT(unpacked("Y12", 2, 1, {0xFF, 0xFF, 0x01, 0x08}, 4), ElementsAre(0xFFF, 0x801))
      << "what is above twelve bits is cut off";
  EXPECT_THAT(unpacked("Y16", 1, 2, {0x34, 0x12, 0, 0, 0xFF, 0xFF}, 4), ElementsAre(0x1234, 0xFFFF));
  EXPECT_THAT(unpacked("SBGGR16", 1, 1, {0x34, 0x12}, 2), ElementsAre(0x1234));
}

TEST(PixelFormat, UnpacksMipiGroups) {
  // Pixels 0x3FF, 0x001, 0x2AA, 0x155. The fifth octet has the two low bits of each, the first pixel's
  // lowest.
  EXPECT_THAT(unpacked("Y10P", 4, 1, {0xFF, 0x00, 0xAA, 0x55, 0b01'10'01'11}, 5),
              ElementsAre(0x3FF, 0x001, 0x2AA, 0x155));
  EXPECT_THAT(unpacked("SGRBG10P", 5, 1, {1, 2, 3, 4, 0, 5, 0, 0, 0, 3}, 10), ElementsAre(4, 8, 12, 16, 23));
  EXPECT_THAT(unpacked("Y12P", 2, 1, {0xAB, 0x12, 0x3C}, 3), ElementsAre(0xABC, 0x123));
  EXPECT_THAT(unpacked("SRGGB12P", 3, 1, {0xAB, 0x12, 0x3C, 0xFF, 0, 0x0F}, 6),
              ElementsAre(0xABC, 0x123, 0xFFF));
}

TEST(PixelFormat, RefusesFramesThatAreShort) {
  image::Grid<std::uint16_t> pixels(4, 3);
  for (const PixelFormat& f : pixel_formats()) {
    const std::size_t row = row_octets(f, 4);
    EXPECT_TRUE(unpack_pixels(f, Octets(3 * row), row, pixels)) << f.name;
    EXPECT_FALSE(unpack_pixels(f, Octets(3 * row - 1), row, pixels)) << f.name;
    EXPECT_FALSE(unpack_pixels(f, Octets(100), row - 1, pixels)) << f.name;
    EXPECT_TRUE(unpack_pixels(f, Octets(2 * (row + 8) + row), row + 8, pixels)) << f.name << " padded";
    EXPECT_EQ(find_pixel_format(f.fourcc), &f);
  }
  EXPECT_EQ(find_pixel_format(0), nullptr);
}

TEST(OpenCamera, NamesWhatIsWrongWithTheUri) {
  const auto problem = [](const char* uri) {
    const auto camera = open_camera(uri, "/nonexistent");
    return camera ? std::string() : camera.error().message;
  };
  EXPECT_EQ(problem("v4l2:/dev/video0?width=1920&height=1080&line_us=14.8&gain_step_db=0.3"), "");
  EXPECT_EQ(problem("v4l2:/dev/video0?format=SRGGB12P&exposure_us=5000&controls=/dev/v4l-subdev2"), "");
  EXPECT_EQ(problem("sim:run/camera.sock"), "");
  EXPECT_EQ(problem("dir:pictures"), "");
  EXPECT_THAT(problem("usb:1"), HasSubstr("expected v4l2:, sim:, dir:"));
  EXPECT_THAT(problem("v4l2:/dev/video0?width=1"), HasSubstr("'width=1', expected width"));
  for (const char* option : {"zoom=2", "format=JPEG", "exposure_us=0", "line_us=x", "controls="}) {
    EXPECT_THAT(problem((std::string("v4l2:/dev/video0?") + option).c_str()),
                HasSubstr(fmt::format("'{}'", option)));
  }
  EXPECT_THAT(problem("dir:pictures?x=1"), HasSubstr("has no options"));
}

TEST(AbsentCamera, SaysSo) {
  for (const char* uri :
       {"v4l2:/nonexistent/video0", "v4l2:/dev/null", "sim:run/camera.sock", "dir:pictures"}) {
    const auto camera = open_camera(uri, "/nonexistent").value();
    const auto opened = camera->open();
    ASSERT_FALSE(opened) << uri;
    EXPECT_EQ(opened.error().kind, CameraFault::Kind::absent);
    EXPECT_FALSE(opened.error().reason.empty());
    EXPECT_FALSE(camera->prepare({}));
    EXPECT_FALSE(camera->begin());
    EXPECT_FALSE(camera->take(nanoseconds(0)));
    camera->abandon();
    camera->close();
  }
}

class FolderCameraTest : public testing::Test {
 protected:
  void add(const std::string& name, float value) {
    ASSERT_TRUE(image::write_fits(folder_.path() / name, image::Plane(8, 6, value)));
  }
  /// First pixel of the next frame; nullopt for an unsound frame.
  std::optional<std::uint16_t> next(Camera& camera) {
    if (!camera.prepare({microseconds(1), 0})) return std::nullopt;
    EXPECT_TRUE(camera.begin());
    const auto frame = camera.take(seconds(1));
    if (!frame || !*frame) return std::nullopt;
    EXPECT_EQ((*frame)->pixels.width(), 8);
    EXPECT_TRUE((*frame)->may_repeat);
    return (*frame)->pixels.at(0, 0);
  }
  testing_support::TemporaryFolder folder_;
};

TEST_F(FolderCameraTest, ShowsThePicturesByNameAndStartsOver) {
  add("b.fits", 20);
  add("a.fits", 10);
  ASSERT_TRUE(std::ofstream(folder_.path() / ".hidden"));
  const auto camera = make_folder_camera(folder_.path());
  EXPECT_THAT(camera->open().value(), HasSubstr("2 pictures of "));
  EXPECT_EQ(next(*camera), 10);
  EXPECT_EQ(next(*camera), 20);
  EXPECT_EQ(next(*camera), 10);
}

TEST_F(FolderCameraTest, KeepsTheValuesOfThePicture) {
  image::Plane plane(3, 1);
  plane.cells() = {0, 7, 65535};
  ASSERT_TRUE(image::write_fits(folder_.path() / "a.fits", plane));
  plane.cells() = {0, 7, 255};
  ASSERT_TRUE(image::write_fits(folder_.path() / "b.fits", plane));
  const auto camera = make_folder_camera(folder_.path());
  ASSERT_TRUE(camera->open());
  for (const auto& [last, bits] : {std::pair(65535, 16), std::pair(255, 8)}) {
    ASSERT_TRUE(camera->prepare({microseconds(1), 0}));
    ASSERT_TRUE(camera->begin());
    const auto frame = camera->take(seconds(1)).value().value();
    EXPECT_THAT(frame.pixels.cells(), ElementsAre(0, 7, last));
    EXPECT_EQ(frame.bits, bits);
  }
}

TEST_F(FolderCameraTest, PassesOverWhatIsNoPicture) {
  add("a.fits", 10);
  std::ofstream(folder_.path() / "b.txt") << "no picture";
  const auto camera = make_folder_camera(folder_.path());
  ASSERT_TRUE(camera->open());
  EXPECT_EQ(next(*camera), 10);
  const auto refused = camera->prepare({microseconds(1), 0});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().kind, CameraFault::Kind::unsound);
  EXPECT_THAT(refused.error().reason, HasSubstr("b.txt"));
  EXPECT_EQ(next(*camera), 10);
}

TEST_F(FolderCameraTest, HasItsFrameWhenTheExposureIsOver) {
  add("a.fits", 10);
  const auto camera = make_folder_camera(folder_.path());
  ASSERT_TRUE(camera->open());
  ASSERT_TRUE(camera->prepare({seconds(60), 3}));
  ASSERT_TRUE(camera->begin());
  const auto frame = camera->take(nanoseconds(0));
  ASSERT_TRUE(frame);
  EXPECT_FALSE(*frame);
  camera->abandon();
  EXPECT_FALSE(camera->take(nanoseconds(0)));
  EXPECT_FALSE(make_folder_camera(folder_.path() / "none")->open());
}

namespace sim = sim_camera;

/// Tests with the messages of a frame of 200 x 160 pixels.
class AssemblerTest : public testing::Test {
 protected:
  AssemblerTest() : pixels_(200, 160) {
    for (std::size_t i = 0; i < pixels_.size(); ++i) pixels_.cells()[i] = static_cast<std::uint16_t>(i);
    octets_ = {reinterpret_cast<const std::uint8_t*>(pixels_.cells().data()), pixels_.size() * 2};
    head_ = {5, 77, 123'456'789, 1000, 2.5F, 290, 200, 160, 12, crc32c(octets_)};
  }
  /// Sends the reply over the wire and into the assembler.
  auto give(const sim::Reply& reply) {
    const Octets message = sim::encode(reply);
    EXPECT_LE(message.size(), sim::message_octets);
    const auto decoded = sim::decode_reply(message);
    EXPECT_TRUE(decoded);
    return assembler_.on_reply(*decoded);
  }
  auto piece(std::size_t from, std::size_t size) {
    return give(sim::FramePiece{5, static_cast<std::uint32_t>(from), octets_.subspan(from, size)});
  }
  image::Grid<std::uint16_t> pixels_;
  OctetView octets_;
  sim::FrameHead head_;
  sim::FrameAssembler assembler_{200, 160, 12};
};

TEST_F(AssemblerTest, PutsAFrameTogether) {
  assembler_.expect(5);
  EXPECT_TRUE(give(head_));
  EXPECT_TRUE(piece(0, 60'000));
  EXPECT_TRUE(piece(60'000, 4000));
  const auto done = give(sim::FrameEnd{5});
  ASSERT_TRUE(done && *done);
  const CameraFrame& frame = **done;
  EXPECT_EQ(frame.pixels.cells(), pixels_.cells());
  EXPECT_EQ(frame.sequence, 77U);
  EXPECT_EQ(frame.begin.ns(), 123'456'789);
  EXPECT_EQ(frame.settings.exposure, microseconds(1000));
  EXPECT_EQ(frame.temperature_k, 290.0);
  EXPECT_EQ(frame.saturation_adu, 4095);
}

TEST_F(AssemblerTest, RefusesAShortFrame) {
  assembler_.expect(5);
  EXPECT_TRUE(give(head_));
  EXPECT_TRUE(piece(0, 60'000));
  EXPECT_EQ(give(sim::FrameEnd{5}).error(), "short: 60000 of 64000 octets");
}

TEST_F(AssemblerTest, RefusesATornFrame) {
  assembler_.expect(5);
  EXPECT_TRUE(give(head_));
  EXPECT_THAT(piece(100, 10).error(), HasSubstr("torn"));
  EXPECT_TRUE(piece(0, 10)) << "nobody waits for the rest";

  assembler_.expect(5);
  head_.crc ^= 1;
  EXPECT_TRUE(give(head_));
  EXPECT_TRUE(piece(0, 60'000));
  EXPECT_TRUE(piece(60'000, 4000));
  EXPECT_THAT(give(sim::FrameEnd{5}).error(), HasSubstr("checksum"));
}

TEST_F(AssemblerTest, RefusesAFrameOfAnotherSizeAndMoreThanAFrame) {
  assembler_.expect(5);
  head_.width = 4000;
  EXPECT_THAT(give(head_).error(), HasSubstr("the camera has 200 x 160"));
  head_.width = 200;
  assembler_.expect(5);
  EXPECT_TRUE(give(head_));
  EXPECT_TRUE(piece(0, 60'000));
  EXPECT_TRUE(piece(60'000, 4000));
  EXPECT_THAT(give(sim::FramePiece{5, 64'000, octets_.first(1)}).error(), HasSubstr("torn"));
}

TEST_F(AssemblerTest, DropsFramesThatNobodyWaitsFor) {
  EXPECT_TRUE(give(head_));
  assembler_.expect(6);
  EXPECT_TRUE(give(head_));
  EXPECT_TRUE(piece(0, 60'000));
  const auto end = give(sim::FrameEnd{5});
  ASSERT_TRUE(end);
  EXPECT_FALSE(*end);
}

TEST(SimCameraMessages, AreReadAsTheyWereWritten) {
  const auto settings = sim::decode_request(sim::encode(sim::SettingsRequest{1500, 2.5F}));
  EXPECT_EQ(std::get<sim::SettingsRequest>(settings.value()).exposure_us, 1500U);
  EXPECT_EQ(
      std::get<sim::BeginRequest>(sim::decode_request(sim::encode(sim::BeginRequest{9})).value()).number, 9U);
  EXPECT_TRUE(sim::decode_request(sim::encode(sim::AbandonRequest{})));
  Octets longer = sim::encode(sim::BeginRequest{9});
  longer.push_back(0);
  EXPECT_FALSE(sim::decode_request(longer));
  EXPECT_FALSE(sim::decode_request({}));
  EXPECT_FALSE(sim::decode_reply(Octets{0x82, 1, 2}));
  EXPECT_FALSE(sim::decode_reply(Octets{0x99}));
}

}  // namespace
}  // namespace srfs::hw
