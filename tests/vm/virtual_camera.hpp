// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fcntl.h>
#include <linux/videodev2.h>
#include <sys/ioctl.h>

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "base/fd.hpp"

namespace srfs::vm {

/// Controls a capture device of the kernel's virtual video driver
/// (Documentation/admin-guide/media/vivid.rst): pictures of a test pattern, and every fault that the driver
/// can simulate. The camera back-end has the same device open at the same time.
class VirtualCamera {
 public:
  /// The capture devices of the driver; empty if the module is not loaded.
  static std::vector<std::filesystem::path> all() {
    std::vector<std::filesystem::path> found;
    for (int number = 0; number < 64; ++number) {
      const std::filesystem::path device = fmt::format("/dev/video{}", number);
      const Fd fd(::open(device.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC));
      v4l2_capability capability{};
      if (!fd || ::ioctl(fd.get(), VIDIOC_QUERYCAP, &capability) != 0) continue;
      if (std::string_view(reinterpret_cast<const char*>(capability.driver)) != "vivid") continue;
      if ((capability.device_caps & (V4L2_CAP_VIDEO_CAPTURE | V4L2_CAP_VIDEO_CAPTURE_MPLANE)) != 0)
        found.push_back(device);
    }
    return found;
  }

  explicit VirtualCamera(std::filesystem::path device)
      : path_(std::move(device)), fd_(::open(path_.c_str(), O_RDWR | O_NONBLOCK | O_CLOEXEC)) {
    EXPECT_TRUE(fd_) << path_;
    v4l2_capability capability{};
    EXPECT_EQ(::ioctl(fd_.get(), VIDIOC_QUERYCAP, &capability), 0);
    type_ = (capability.device_caps & V4L2_CAP_VIDEO_CAPTURE) != 0 ? V4L2_BUF_TYPE_VIDEO_CAPTURE
                                                                   : V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE;
    v4l2_queryctrl control{};
    for (control.id = V4L2_CTRL_FLAG_NEXT_CTRL; ::ioctl(fd_.get(), VIDIOC_QUERYCTRL, &control) == 0;
         control.id |= V4L2_CTRL_FLAG_NEXT_CTRL)
      controls_[reinterpret_cast<const char*>(control.name)] = control;
  }

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] bool is_multi_planar() const { return type_ == V4L2_BUF_TYPE_VIDEO_CAPTURE_MPLANE; }

  /// Sets the control @p name; a button ignores the value.
  void set(const std::string& name, std::int32_t value) {
    ASSERT_TRUE(controls_.contains(name)) << "no control '" << name << "'";
    v4l2_control control{.id = controls_.at(name).id, .value = value};
    EXPECT_EQ(::ioctl(fd_.get(), VIDIOC_S_CTRL, &control), 0) << name << ": " << errno_text(errno);
  }
  void press(const std::string& button) { set(button, 1); }
  void choose(const std::string& name, std::string_view item) {
    ASSERT_TRUE(controls_.contains(name)) << "no control '" << name << "'";
    v4l2_querymenu menu{};
    menu.id = controls_.at(name).id;
    for (std::int32_t i = controls_.at(name).minimum; i <= controls_.at(name).maximum; ++i) {
      menu.index = static_cast<std::uint32_t>(i);
      if (::ioctl(fd_.get(), VIDIOC_QUERYMENU, &menu) == 0 &&
          std::string_view(reinterpret_cast<const char*>(menu.name)) == item)
        return set(name, i);
    }
    ADD_FAILURE() << "'" << name << "' cannot be '" << item << "'";
  }
  [[nodiscard]] std::int32_t get(const std::string& name) const {
    v4l2_control control{.id = controls_.at(name).id, .value = 0};
    EXPECT_EQ(::ioctl(fd_.get(), VIDIOC_G_CTRL, &control), 0) << name;
    return control.value;
  }

  [[nodiscard]] std::set<std::uint32_t> formats() const {
    std::set<std::uint32_t> offered;
    v4l2_fmtdesc description{};
    description.type = type_;
    for (; ::ioctl(fd_.get(), VIDIOC_ENUM_FMT, &description) == 0; ++description.index)
      offered.insert(description.pixelformat);
    return offered;
  }

  void set_rate(std::uint32_t frames_per_s) {
    v4l2_streamparm rate{};
    rate.type = type_;
    rate.parm.capture.timeperframe = {1, frames_per_s};
    EXPECT_EQ(::ioctl(fd_.get(), VIDIOC_S_PARM, &rate), 0) << errno_text(errno);
  }

 private:
  std::filesystem::path path_;
  Fd fd_;
  std::uint32_t type_ = V4L2_BUF_TYPE_VIDEO_CAPTURE;
  std::map<std::string, v4l2_queryctrl> controls_;
};

}  // namespace srfs::vm
