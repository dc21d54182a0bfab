// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "hw/camera/camera.hpp"
#include "image/file/fits.hpp"

namespace srfs {

/// What is known of a frame beside its pixels.
struct FrameFacts {
  std::uint32_t task = 0;
  std::uint16_t number = 0;  ///< from 1
  std::string camera;        ///< as reported by open()
  std::string instrument;
  std::optional<UtcTime> begin;  ///< of the exposure; nothing: the time is not valid
  std::int32_t start_error_us = 0;
  struct Attitude {
    std::array<float, 4> quaternion;  ///< body to inertial, scalar last
    double age_s;                     ///< at the exposure's begin
  };
  std::optional<Attitude> attitude;
};

/// The FITS header of a frame: DATE-OBS, EXPTIME, GAIN, CAMERA, INSTRUME, TASK, FRAME, SATURATE and so on
/// (README). Pure.
[[nodiscard]] std::vector<image::FitsCard> frame_header(const hw::CameraFrame& frame,
                                                        const FrameFacts& facts);

}  // namespace srfs
