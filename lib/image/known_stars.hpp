// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "image/clean_frame.hpp"
#include "image/detections.hpp"
#include "image/place_index.hpp"
#include "image/plate_solver.hpp"

namespace srfs::image {

/// The catalogue's stars in a frame whose attitude is known, as its pixels have to show them: what they
/// explain is no moving object.
class KnownStars {
 public:
  /// @param stars  those that were solved
  /// @return nothing where too few of them tell how bright the catalogue's stars are here
  [[nodiscard]] static std::optional<KnownStars> of(const PlateSolution& solution,
                                                    const std::vector<Star>& stars, int width, int height);

  /// Whether they are what a streak's light comes from: they have most of it, and an evenly lit line with
  /// half of its height is not there beside them. A streak that passes over stars has it.
  [[nodiscard]] bool explain(const Streak& streak, const CleanFrame& clean) const;

  /// Whether one of them is there, not much fainter.
  [[nodiscard]] bool explain(const Star& star) const;

 private:
  struct Known {
    double x;
    double y;
    double flux;  ///< ADU
  };
  struct Height {
    double value;  ///< in noise
    double sigma;
  };

  KnownStars(std::vector<Known> stars, double spread_px);
  [[nodiscard]] double light_along(const Streak& streak, double fwhm_px) const;
  [[nodiscard]] Height height_beside_stars(const Streak& streak, const CleanFrame& clean) const;

  std::vector<Known> stars_;  ///< brightest first
  PlaceIndex places_;
  double spread_px_;  ///< of the places that the solution says
};

/// Takes away the streaks that the catalogue's stars explain, and notes how many. @return those
std::vector<Streak> drop_known_stars(const KnownStars& known, const CleanFrame& clean,
                                     std::vector<Streak>& streaks, std::vector<std::string>& notes);

}  // namespace srfs::image
