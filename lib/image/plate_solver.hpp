// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "image/detections.hpp"
#include "image/star_catalogue.hpp"

namespace srfs::image {

struct PlateOptions {
  double field_least_deg = 4;  ///< width of the frame
  double field_most_deg = 20;
};

/// The attitude of a camera without distortion from its stars, without any idea of where it looks.
///
/// Patterns of four stars (one and three of the six brightest around it) are compared by their shape with
/// those of the catalogue; one that agrees gives an attitude, which is taken only if it explains so many
/// other stars that chance cannot.
class PlateSolver {
 public:
  /// Takes a quarter of a second and 25 MB. @param catalogue  brightest first
  explicit PlateSolver(const std::vector<CatalogueStar>& catalogue);

  /// Takes a few milliseconds, 50 where there is no solution.
  /// @param stars  with the place of the frame's first pixel's centre as (0, 0), in any order
  /// @return nothing rather than what may be wrong
  [[nodiscard]] std::optional<Attitude> solve(const std::vector<Star>& stars, int width, int height,
                                              const PlateOptions& options) const;

  /// Why solve() found nothing, for people: names the bound of the field when an attitude beyond it explains
  /// the stars. Takes as long as solve(). @param widest  all fields that may be asked for
  [[nodiscard]] std::string why_unsolved(const std::vector<Star>& stars, int width, int height,
                                         const PlateOptions& options, const PlateOptions& widest) const;

 private:
  friend class PlateSearch;

  /// Shape of four stars: two of them are (0, 0) and (1, 0), what is stored are the places of the others.
  using Code = std::array<float, 4>;
  struct Quad {
    Code code;
    std::array<std::uint32_t, 4> stars;
  };

  static constexpr int neighbours = 6;
  static constexpr float cell = 0.02F;        ///< of the index
  static constexpr float tolerance = 0.008F;  ///< of a code's numbers
  static constexpr std::size_t buckets = std::size_t{1} << 20;

  [[nodiscard]] static std::size_t bucket_of(const std::array<int, 4>& cells);
  void add_patterns(double radius_rad);

  std::vector<CatalogueStar> stars_;
  std::vector<Eigen::Vector3d> directions_;
  SkyIndex sky_;
  std::vector<std::uint32_t> first_;  ///< quad of each bucket
  std::vector<Quad> quads_;
};

}  // namespace srfs::image
