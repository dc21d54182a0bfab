// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "image/plate_solver.hpp"
#include "image/tracklet_linker.hpp"

namespace srfs::image {

/// Magnitude of a flux of 1 ADU, by the stars of a solution; nothing where they are too few.
/// @param stars  those that were solved
[[nodiscard]] std::optional<Magnitude> zero_point_of(const PlateSolution& solution,
                                                     const std::vector<Star>& stars);

/// What turns pixels of one frame into measurements: where it looks, how bright its light is, when it was
/// taken.
class SkyMeasurement {
 public:
  /// @param stars  those that were solved
  SkyMeasurement(PlateSolution solution, const std::vector<Star>& stars, const Frame& frame);

  /// Ends, middle, times and magnitude. Which end was first is not known from one frame.
  [[nodiscard]] SkyTrail of(const Streak& streak) const;
  /// Adds to a point of a tracklet where it was in the middle of the exposure; a streak's first end becomes
  /// that where it was at the exposure's begin. @param vx, vy  of the tracklet, in its frame's pixels
  void add_to(TrackPoint& point, double vx, double vy) const;
  [[nodiscard]] const Attitude& attitude() const { return solution_.attitude; }

 private:
  [[nodiscard]] SkyPlace place(double x, double y, const Eigen::Matrix2d& covariance_px) const;
  /// @param floor  what the noise does not say, in magnitudes
  [[nodiscard]] std::optional<Magnitude> magnitude(double flux, double snr, double floor) const;

  PlateSolution solution_;
  Eigen::Vector2d middle_px_;
  std::optional<Magnitude> zero_point_;  ///< of a flux of 1 ADU
  std::optional<double> begin_s_;
  std::optional<double> exposure_s_;
};

/// Measures a sequence's streaks and tracklets. @param frames  of each frame; null: not solved
void add_sky(SequenceFindings& found, const std::vector<std::optional<SkyMeasurement>>& frames);

}  // namespace srfs::image
