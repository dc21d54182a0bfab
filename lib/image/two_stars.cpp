// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/two_stars.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

namespace srfs::image {

using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Normal equations by x, y and height of the one, then of the other.
struct TwoStars::Equations {
  Eigen::Matrix<double, 6, 6> normal;
  Vector6 right;
  double mismatch;
};

void TwoStars::fill(const StarPair& stars, Equations& e) {
  for (std::size_t k = 0; k < 2; ++k)
    profile_gradients(profile_, patch_, static_cast<float>(stars.x[k]), static_cast<float>(stars.y[k]),
                      gradients_[k]);
  const PairSums sums = pair_sums(gradients_, patch_,
                                  {static_cast<float>(stars.height[0]), static_cast<float>(stars.height[1])},
                                  static_cast<float>(shot_));
  std::size_t k = 0;
  for (Eigen::Index a = 0; a < 6; ++a) {
    e.right[a] = double(sums.right[static_cast<std::size_t>(a)]);
    for (Eigen::Index b = a; b < 6; ++b) e.normal(a, b) = e.normal(b, a) = double(sums.normal[k++]);
  }
  e.mismatch = double(sums.mismatch);
}

double TwoStars::mismatch(const StarPair& stars) {
  Equations e;
  fill(stars, e);
  return e.mismatch;
}

std::optional<TwoStars::Found> TwoStars::fit(const StarPair& start, double fwhm_px) {
  StarPair stars = start;
  Equations e;
  for (int round = 0; round < 10; ++round) {
    fill(stars, e);
    e.normal.diagonal() *= 1.001;
    const Vector6 step = e.normal.ldlt().solve(e.right);
    if (!step.allFinite()) return std::nullopt;
    const double longest =
        std::max({std::abs(step[0]), std::abs(step[1]), std::abs(step[3]), std::abs(step[4])});
    const double part = std::min(1.0, 0.3 * fwhm_px / std::max(1e-9, longest));
    for (std::size_t k = 0; k < 2; ++k) {
      const auto at = static_cast<Eigen::Index>(3 * k);
      stars.x[k] += part * step[at];
      stars.y[k] += part * step[at + 1];
      stars.height[k] += part * step[at + 2];
    }
    if (!(stars.height[0] > 0) || !(stars.height[1] > 0)) return std::nullopt;
    if (longest < 0.01 * fwhm_px) break;
  }
  fill(stars, e);
  const Eigen::Matrix<double, 6, 6> inverse = e.normal.inverse();
  return Found{
      stars, e.mismatch, {std::sqrt(std::max(0.0, inverse(2, 2))), std::sqrt(std::max(0.0, inverse(5, 5)))}};
}

}  // namespace srfs::image
