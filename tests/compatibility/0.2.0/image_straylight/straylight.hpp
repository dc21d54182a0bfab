// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>

#include "base/octets.hpp"

namespace srfs {

/// Stray light of the Sun, the Moon or the Earth in one frame.
struct Straylight {
  float sky_adu = 0;       ///< median of all pixels
  float gradient_adu = 0;  ///< brightest less darkest block of 16 by 16 in the frame, each by its median
  float saturated_fraction = 0;  ///< of the pixels at 65535, 0 to 1
};

/// @param pixels mono16, little endian, row by row without gaps
/// @return nullopt: not width x height pixels of two octets, or a side shorter than 16 pixels. About 10 ns a
/// pixel; no allocation beyond 512 KiB.
[[nodiscard]] std::optional<Straylight> measure_straylight(OctetView pixels, std::size_t width,
                                                           std::size_t height);

/// Tells a change from dark to bright and back, with a tenth of the limit as hysteresis.
class BrightSky {
 public:
  enum class Change { none, bright, dark };
  Change on_sky(float sky_adu, float limit_adu);
  [[nodiscard]] bool is_bright() const { return bright_; }

 private:
  bool bright_ = false;
};

}  // namespace srfs
