// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "image/frame.hpp"

namespace srfs::image {

/// A smooth surface over a frame, known at the centres of square cells.
class Surface {
 public:
  Surface() = default;
  Surface(Plane nodes, int cell_px);

  /// The surface along row @p y, cubic between the centres; @p out has one value a pixel.
  void row(int y, std::vector<float>& out) const;
  /// At a point, linear between the centres.
  [[nodiscard]] float at(double x, double y) const;
  [[nodiscard]] const Plane& nodes() const { return nodes_; }
  [[nodiscard]] Surface at_least(float value) const;
  /// @pre of the same frame size
  [[nodiscard]] Surface times(const Surface& other) const;

 private:
  Plane nodes_;
  Plane extended_;  ///< the nodes, and `beyond` more on each side
  int cell_px_ = 1;
};

/// Level and spread of the sky without its stars.
struct SkyLevel {
  Surface level;
  Surface noise;
};

/// Measures every cell by clipped statistics, then smooths over neighbouring cells by median. Pixels that are
/// not finite do not count; cells without enough of them get their neighbours' values.
/// @param lowest  value of the frame: what many pixels have may stand for less than it
/// @param noise_least  what the noise is at least: quantisation
[[nodiscard]] SkyLevel measure_sky(const Plane& pixels, float lowest, float noise_least);

/// The same of a plane that is nearly level 0, noise 1 already.
/// @param masked  pixels that do not count: not 0; nullptr: of filtered light, half of the rows
[[nodiscard]] SkyLevel measure_flattened(const Plane& signal, const Grid<std::uint8_t>* masked);

/// The cell that suits a frame: 64 px, less in small frames.
[[nodiscard]] int sky_cell_px(int width, int height);

/// The noise changes so slowly that one row of it serves so many rows of the frame.
inline constexpr int noise_rows = 8;

/// The middle value; rearranges @p values. @pre not empty
[[nodiscard]] float median_of(std::vector<float>& values);

/// Median, and the standard deviation by the median distance from it: a few values that do not belong to the
/// others change neither by much.
struct Middle {
  double value;
  double spread;
};
/// @pre not empty
[[nodiscard]] Middle middle_of(std::vector<float> values);

}  // namespace srfs::image
