// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "image/profile.hpp"

namespace srfs::image {

/// x, y and height of two stars.
struct StarPair {
  std::array<double, 2> x;
  std::array<double, 2> y;
  std::array<double, 2> height;
};

/// Two stars on one patch, fitted together. Chi squared: weight of a pixel 1 / (1 + shot * light of the
/// model).
class TwoStars {
 public:
  struct Found {
    StarPair stars;
    double mismatch;  ///< chi squared
    std::array<double, 2> height_errors;
  };

  /// @param patch  as long as this lives
  TwoStars(const Profile& profile, const Patch& patch, double shot)
      : profile_(profile), patch_(patch), shot_(shot) {}

  [[nodiscard]] double mismatch(const StarPair& stars);
  /// @return nothing where it does not settle with both of them bright
  [[nodiscard]] std::optional<Found> fit(const StarPair& start, double fwhm_px);
  /// Light of both at a pixel of the patch, as of the last call.
  [[nodiscard]] float light(const StarPair& stars, std::size_t pixel) const {
    return static_cast<float>(stars.height[0]) * gradients_[0].height[pixel] +
           static_cast<float>(stars.height[1]) * gradients_[1].height[pixel];
  }

 private:
  struct Equations;
  void fill(const StarPair& stars, Equations& equations);

  Profile profile_;
  const Patch& patch_;
  double shot_;
  std::array<ProfileGradients, 2> gradients_;
};

}  // namespace srfs::image
