// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <opencv2/core/mat.hpp>

#include "base/octets.hpp"
#include "image/frame.hpp"

/// Frames as OpenCV sees them, without a copy: for methods that are written in OpenCV (libopencv-core-dev,
/// libopencv-imgproc-dev). A view is valid as long as the frame, and may not be written to: OpenCV has no
/// matrix of constant values. A header of its own: who does not include it needs no OpenCV.
namespace srfs::image {

/// CV_32F, height x width. A pixel without a value is NaN, which OpenCV's filters spread.
[[nodiscard]] inline cv::Mat view_of(const Plane& plane) {
  if (plane.empty()) return {};
  return {plane.height(), plane.width(), CV_32F, const_cast<float*>(plane.row(0))};
}

/// CV_16U, height x width, of a frame as it comes by /image/raw. Little-endian computers alone.
/// @param pixels  mono16, row by row without gaps
/// @return empty: not width x height pixels of two octets, none at all, or more than frame_pixels_max
[[nodiscard]] inline cv::Mat view_of_mono16(OctetView pixels, std::uint32_t width, std::uint32_t height) {
  const std::uint64_t count = std::uint64_t{width} * height;
  if (count == 0 || count > frame_pixels_max || pixels.size() != 2 * count) return {};
  return {static_cast<int>(height), static_cast<int>(width), CV_16U,
          const_cast<std::uint8_t*>(pixels.data())};
}

}  // namespace srfs::image
