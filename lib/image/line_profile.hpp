// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace srfs::image {

/// Pixels along a line, in any order.
struct LinePixels {
  std::vector<float> x;
  std::vector<float> y;
  std::vector<float> light;
  [[nodiscard]] std::size_t size() const { return light.size(); }
};

/// The light of a point that moves evenly from one end to the other, blurred by a Gaussian. Along the line
/// positions count from a point on it.
struct LineShape {
  float x, y;          ///< the point
  float ux, uy;        ///< direction, length 1
  float from, to;      ///< ends
  float sigma_along;   ///< px
  float sigma_across;  ///< px
  float height;        ///< along the middle line, far from the ends
};

/// What a pixel's variance is: 1 + shot * model + (error * model)^2. What the line explains worse than three
/// of that counts less: stars beside it.
struct LineNoise {
  float shot;
  float model_error;
};

/// Sums of the least-squares fit, by from, to, offset across, turn (rad), height and sigma_across.
struct LineSums {
  static constexpr std::size_t parameters = 6;
  std::array<std::array<double, parameters>, parameters> normal{};  ///< upper triangle
  std::array<double, parameters> right{};
  double energy = 0;  ///< of the light for height 1, unweighted
};
/// @param with_ends  false: from and to do not change, what belongs to them stays 0
[[nodiscard]] LineSums line_sums(const LineShape& line, const LinePixels& pixels, const LineNoise& noise,
                                 bool with_ends = true);

/// Chi squared of @p light of the pixels beside @p model times the line; the line gives the variance in any
/// case.
[[nodiscard]] double line_mismatch(const LineShape& line, float model, const LinePixels& pixels,
                                   const LineNoise& noise);

/// Where the pixels are along a line, from its point, and the light there of one without ends for height 1.
void line_places(const LineShape& line, const LinePixels& pixels, std::vector<float>& along,
                 std::vector<float>& endless);

/// Light of the line at the pixels for height 1.
void line_heights(const LineShape& line, const LinePixels& pixels, std::vector<float>& out);

}  // namespace srfs::image
