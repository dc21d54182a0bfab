// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <Eigen/Core>

#include "image/camera_model.hpp"
#include "image/detections.hpp"
#include "image/star_catalogue.hpp"

namespace srfs::image {

/// All widths of a field of view that can be asked for.
inline constexpr double field_least_deg = 2;
inline constexpr double field_most_deg = 60;

struct PlateOptions {
  double field_least_deg = image::field_least_deg;  ///< width of the frame
  double field_most_deg = image::field_most_deg;
};

/// Where a camera looks, its lens, and the stars that show it.
struct PlateSolution {
  struct Match {
    std::size_t star;  ///< of the list that was given
    float magnitude;   ///< V_T
  };
  Attitude attitude;
  CameraModel camera;
  CameraFit fit;
  std::vector<Match> matches;
};

/// How certain the place of a star is, per axis: its light's noise, and what no light makes better.
[[nodiscard]] double place_sigma_px(const Star& star);
inline constexpr double place_floor_px = 0.05;  ///< what no light makes a place better than

/// The stars that a solver knows and how far the patterns reach that it compares.
struct PlateScales {
  double faintest;
  std::span<const double> radii_deg;
  std::size_t neighbours;  ///< that a pattern is chosen from, 6 at most
};

/// For fields wider than 4 degrees, and for the narrower ones.
[[nodiscard]] const PlateScales& wide_scales();
[[nodiscard]] const PlateScales& narrow_scales();
/// Frames at least this wide are left to the wide scales.
inline constexpr double narrow_most_deg = 7;

/// The attitude of a camera and the distortion of its lens from its stars, without any idea of where it
/// looks or how wide its field is.
///
/// Patterns of four stars (one and three of the six brightest around it) are compared by their shape with
/// those of the catalogue; one that agrees gives an attitude, from which the camera is fitted to more and
/// more stars around the pattern. It is taken only if it explains so many that chance cannot.
class PlateSolver {
 public:
  /// Wide: takes a quarter of a second and 25 MB; narrow: a second and 80 MB.
  explicit PlateSolver(const PlateScales& scales);

  /// Takes a few milliseconds, 100 where there is no solution.
  /// @param stars  with the place of the frame's first pixel's centre as (0, 0), in any order
  /// @return nothing rather than what may be wrong
  [[nodiscard]] std::optional<PlateSolution> solve(const std::vector<Star>& stars, int width, int height,
                                                   const PlateOptions& options) const;

 private:
  friend class PlateSearch;

  /// Shape of four stars: two of them are (0, 0) and (1, 0), what is stored are the places of the others.
  using Code = std::array<float, 4>;
  struct Quad {
    std::array<std::int16_t, 4> code;  ///< in code_unit
    std::array<std::uint32_t, 4> stars;
  };
  struct Direction {
    Eigen::Vector3f direction;
    float magnitude;
  };

  static constexpr std::size_t neighbours_most = 6;
  static constexpr float code_unit = 1.0F / 16000;
  static constexpr float cell = 0.02F;        ///< of the index
  static constexpr float tolerance = 0.008F;  ///< of a code's numbers
  static constexpr std::size_t buckets = std::size_t{1} << 20;

  [[nodiscard]] static std::size_t bucket_of(const std::array<int, 4>& cells);
  [[nodiscard]] static std::size_t bucket_of(const Quad& quad);
  void add_patterns(double radius_rad, std::size_t neighbours);
  void sort_by_bucket();
  [[nodiscard]] Eigen::Vector3d direction(std::size_t star) const {
    return stars_[star].direction.cast<double>();
  }

  std::vector<Direction> stars_;  ///< brightest first
  SkyIndex sky_;
  std::vector<std::uint32_t> first_;  ///< quad of each bucket
  std::vector<Quad> quads_;
};

/// All fields: the wide scales first, of which there is one solver in a process while anybody uses it, then
/// the narrow ones, which are made when first needed. Both are freed with their last user.
class FieldSolver {
 public:
  FieldSolver();
  [[nodiscard]] std::optional<PlateSolution> solve(const std::vector<Star>& stars, int width, int height,
                                                   const PlateOptions& options);
  /// Why solve() found nothing, for people: names the bound of the field when an attitude beyond it explains
  /// the stars. Takes as long as solve(), and makes no solver: what the bounds keep out is not looked for
  /// among fields narrower than the wide scales have.
  [[nodiscard]] std::string why_unsolved(const std::vector<Star>& stars, int width, int height,
                                         const PlateOptions& options);

 private:
  [[nodiscard]] static std::shared_ptr<const PlateSolver> shared_wide();
  std::shared_ptr<const PlateSolver> wide_;
  std::unique_ptr<const PlateSolver> narrow_;
};

}  // namespace srfs::image
