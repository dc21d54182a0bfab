// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw/camera/frame_values.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace srfs::hw {

CameraFrame to_camera_frame(const image::Frame& picture) {
  constexpr float highest = 65535;
  float low = std::numeric_limits<float>::infinity();
  float high = -low;
  for (const float v : picture.pixels.cells()) {
    if (!std::isfinite(v)) continue;
    low = std::min(low, v);
    high = std::max(high, v);
  }
  if (low > high) low = high = 0;
  const bool whole = picture.step > 0 && low >= 0 && high <= highest;
  const float zero = whole ? 0 : low;
  const float factor = whole || high <= low ? 1 : highest / (high - low);

  CameraFrame frame;
  frame.pixels = image::Grid<std::uint16_t>::unset(picture.pixels.width(), picture.pixels.height());
  const auto value = [&](float v) {
    if (!std::isfinite(v)) v = low;
    return static_cast<std::uint16_t>(std::clamp((v - zero) * factor + 0.5F, 0.0F, highest));
  };
  std::transform(picture.pixels.cells().begin(), picture.pixels.cells().end(), frame.pixels.cells().begin(),
                 value);
  frame.bits = high <= 255 && whole ? 8 : 16;
  if (picture.saturation_adu && std::isfinite(*picture.saturation_adu))
    frame.saturation_adu = value(*picture.saturation_adu);
  frame.may_repeat = true;
  return frame;
}

}  // namespace srfs::hw
