// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "image/frame.hpp"

namespace srfs::image {

/// @p in correlated with a round Gaussian whose squares sum to 1: white noise of spread 1 stays one of
/// spread 1. Edges count as zero.
/// @param out  another plane, of any size before
/// @param hidden  pixels that count as zero: not 0; nullptr: none
void gaussian_filter(const Plane& in, float sigma_px, Plane& out, const Grid<std::uint8_t>* hidden = nullptr);

/// Takes away what is larger than a streak is wide: the mean of the clipped surroundings, 33 values wide.
void high_pass(Plane& plane);

}  // namespace srfs::image
