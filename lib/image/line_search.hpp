// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "image/frame.hpp"

namespace srfs::image {

/// A piece of a line on which there is more light than chance puts there.
struct LineHit {
  double x1;
  double y1;
  double x2;
  double y2;
  double significance;
};

/// Sums along all pieces of lines of 8, 16 ... 128 cells in all directions (fast discrete Radon transform of
/// dyadic strips), with the best piece of each neighbourhood.
/// @param significance  noise 1, correlated over @p correlation_cells (sigma of the filter that made it)
/// @param clip  what one cell counts at most, up to 8: one bright star makes no line
[[nodiscard]] std::vector<LineHit> search_lines(const Plane& significance, double correlation_cells,
                                                double least, float clip);

}  // namespace srfs::image
