// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include <opencv2/core/mat.hpp>

#include "base/octets.hpp"

namespace srfs {

/// What moved against the stars. Places in px of the frame; (0, 0) is the centre of its first pixel.
struct Motion {
  bool compared = false;  ///< false: the first frame, or the stars do not show how the camera turned
  float shift_x_px = 0;   ///< of the stars since the frame before
  float shift_y_px = 0;
  std::uint32_t movers = 0;
  float x_px = 0;  ///< middle of the brightest mover
  float y_px = 0;
  float length_px = 0;  ///< longer side of the smallest rectangle around it
  float snr = 0;        ///< its brightest pixel over the noise
};

/// Background subtraction: each frame is compared with the mean of those before it, moved as the stars moved.
/// Finds what is brighter than the noise by a factor and as large as a star, but not in front of a star that
/// is brighter. Half a second of CPU time for
/// two megapixels on the board; three frames of memory.
class MotionFinder {
 public:
  explicit MotionFinder(float least_snr = 8) : least_snr_(least_snr) {}
  /// @param pixels  mono16, little endian, row by row without gaps. Another size begins anew.
  /// @return nullopt: not width x height pixels, or a side shorter than 32 pixels
  [[nodiscard]] std::optional<Motion> on_frame(OctetView pixels, std::uint32_t width, std::uint32_t height);
  void set_least_snr(float least_snr) { least_snr_ = least_snr; }

 private:
  float least_snr_;
  cv::Mat before_;      ///< stars of the last frame, as they are compared
  cv::Mat background_;  ///< mean of all frames, where the last one shows their stars
};

}  // namespace srfs
