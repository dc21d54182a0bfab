// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "hw/camera/camera.hpp"
#include "hw/camera/pixel_format.hpp"

/// Constructors of the back-ends; open_camera.cpp and tests use them.
namespace srfs::hw {

/// What a V4L2 driver does not tell.
struct V4l2Options {
  std::uint32_t width = 0;  ///< 0: as the driver has it
  std::uint32_t height = 0;
  double line_us = 0;         ///< V4L2_CID_EXPOSURE counts lines of this length; 0: units of 100 us
  double gain_step_db = 0.1;  ///< one unit of the gain control
  /// Of a camera whose exposure cannot be set: it is always so long. 0: there is a control.
  microseconds fixed_exposure{0};
  const PixelFormat* format = nullptr;  ///< none: the best that the driver offers
  /// Sub-device with the sensor's controls, where the capture device has none of them; empty: that has them
  std::filesystem::path controls;
};

[[nodiscard]] std::unique_ptr<Camera> make_v4l2_camera(const std::filesystem::path& device,
                                                       const V4l2Options& options);
[[nodiscard]] std::unique_ptr<Camera> make_sim_camera(const std::filesystem::path& socket);
[[nodiscard]] std::unique_ptr<Camera> make_folder_camera(const std::filesystem::path& folder);

}  // namespace srfs::hw
