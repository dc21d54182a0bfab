// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "image/clean_frame.hpp"
#include "image/line_fit.hpp"

namespace srfs::image {

/// Where in a frame lines mean something: not where there are trees, buildings or the Earth, and not along
/// its edge.
class SearchedSky {
 public:
  explicit SearchedSky(const CleanFrame& clean);

  /// Where the noise is many times that of the calm quarter of the frame.
  [[nodiscard]] bool is_in_unrest(const Line& line) const;
  /// Too much of it lies at edges of something dark, where every line is one of its own.
  [[nodiscard]] bool is_beside_no_sky(const Line& line) const;
  /// Both ends at the same edge of the frame, where nothing is seen on the other side.
  /// @param width_px  of the light
  [[nodiscard]] bool is_along_edge(const Line& line, double width_px) const;

 private:
  const CleanFrame& clean_;
  float calm_noise_adu_;
};

/// Places along a line that are checked.
inline constexpr int places_of_line = 9;

/// Of how many of the places along a line it is true.
template <class Is>
[[nodiscard]] int places_along(const Line& l, Is&& is) {
  int count = 0;
  for (int k = 0; k < places_of_line; ++k) {
    const double t = (k + 0.5) / places_of_line;
    count += is(l.x1 + t * (l.x2 - l.x1), l.y1 + t * (l.y2 - l.y1));
  }
  return count;
}

}  // namespace srfs::image
