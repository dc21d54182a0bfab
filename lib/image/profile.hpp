// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "image/frame.hpp"

namespace srfs::image {

/// Height of a star's light over its place: (1 + gamma q)^(-1/gamma) at q = a dx^2 + 2 b dx dy + c dy^2,
/// gamma 0: exp(-q). Single precision, relative error below 1e-5 (gamma > 0.004) down to heights of 1e-9,
/// evaluated for many pixels at once.
struct Profile {
  float a;
  float b;
  float c;
  float gamma;
};

/// The pixels around a place, up to a radius, in any order; as many more as fill the last `lanes` have use 0.
struct Patch {
  static constexpr int lanes = 8;
  int x = 0;  ///< the pixel in the middle
  int y = 0;
  int radius = -1;
  std::vector<int> half;  ///< of each row of pixels: how many on either side of the middle
  std::vector<float> dx;  ///< of each pixel, from the one in the middle
  std::vector<float> dy;
  std::vector<float> light;
  std::vector<float> use;  ///< 1: a pixel to look at, 0: flawed or outside the frame
  [[nodiscard]] std::size_t size() const { return dx.size(); }
};

/// Fills a patch with the pixels up to @p radius (and half a pixel) from (x, y).
void take_patch(const Grid<float>& light, const Grid<std::uint8_t>& flaws, double x, double y, int radius,
                Patch& patch);

/// What the least-squares fit of a star at (x, y) of the frame needs to know of a patch: sums over its pixels
/// of products of the derivatives by x, y and height and of the residuum. Weight of a pixel: 1 / (1 + shot *
/// light of the model).
struct FitSums {
  float xx, xy, yy, xh, yh, hh, rx, ry, rh;
  float energy;  ///< of the profile, unweighted
};
[[nodiscard]] FitSums fit_sums(const Profile& profile, const Patch& patch, float x, float y, float height,
                               float shot);

/// The same for height and the logarithm of the width. @param narrower  factor of q
struct WidthSums {
  float ss, sh, hh, rs, rh;
};
[[nodiscard]] WidthSums width_sums(const Profile& profile, const Patch& patch, float x, float y, float height,
                                   float narrower, float shot);

/// The same for the profile itself: by a, b, c and gamma. Pixels that the profile explains badly count less,
/// and so do those of bright stars: @p model_error is the share of their light that the profile may miss.
struct ShapeSums {
  std::array<float, 10> normal;  ///< aa, ab, ac, ag, bb, bc, bg, cc, cg, gg
  std::array<float, 4> right;
};
[[nodiscard]] ShapeSums shape_sums(const Profile& profile, const Patch& patch, float x, float y, float height,
                                   float model_error);

/// Heights over the patch of a star at (x, y) of the frame. @param out  as large as the patch
void profile_heights(const Profile& profile, const Patch& patch, float x, float y, std::vector<float>& out);

/// Height and its derivatives by the place of the star, over a patch.
struct ProfileGradients {
  std::vector<float> height;
  std::vector<float> x;
  std::vector<float> y;
};
void profile_gradients(const Profile& profile, const Patch& patch, float x, float y, ProfileGradients& out);

/// What the least-squares fit of two stars together needs to know of a patch: sums of products of the
/// derivatives by x, y and height of the one, then of the other (upper triangle, row by row), and of the
/// residuum; chi squared. Weights as of fit_sums.
struct PairSums {
  std::array<float, 21> normal;
  std::array<float, 6> right;
  float mismatch;
};
[[nodiscard]] PairSums pair_sums(const std::array<ProfileGradients, 2>& stars, const Patch& patch,
                                 const std::array<float, 2>& heights, float shot);

/// Adds a star's light to @p n pixels of a row, the first of which is @p dx from it.
void add_profile(const Profile& profile, float height, float dx, float dy, float* row, int n);

}  // namespace srfs::image
