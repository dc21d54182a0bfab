// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include <Eigen/Core>

namespace srfs::image {

/// A camera with radial distortion: which direction of the sky each pixel sees.
///
/// Pixels count from the frame's middle. With q from the optical axis and r = |q| / corner_px, a lens without
/// distortion would show q (1 + k1 r^2 + k2 r^4).
struct CameraModel {
  Eigen::Matrix3d to_sky;  ///< from the camera's axes (x right, y down, z ahead) to J2000
  double focal_px;
  bool mirrored = false;  ///< x counts to the left
  Eigen::Vector2d axis = Eigen::Vector2d::Zero();
  double k1 = 0;
  double k2 = 0;
  double corner_px = 1;  ///< half the frame's diagonal

  /// J2000, length 1.
  [[nodiscard]] Eigen::Vector3d direction(const Eigen::Vector2d& pixel) const;
  /// Where a direction is seen. @pre it is ahead of the camera
  [[nodiscard]] Eigen::Vector2d pixel(const Eigen::Vector3d& direction) const;
  [[nodiscard]] bool is_ahead(const Eigen::Vector3d& direction) const;
  /// Displacement at the frame's corners over their distance from the axis.
  [[nodiscard]] double distortion() const { return k1 + k2; }
};

/// Three small turns around the camera's axes, focal length, axis, k1, k2.
inline constexpr int camera_parameters = 8;
using CameraCovariance = Eigen::Matrix<double, camera_parameters, camera_parameters>;

enum class LensTerms : std::uint8_t { few, all };

struct CameraFit {
  double rms_px;     ///< of what is left, per axis, the stars weighed by their certainty
  double spread_px;  ///< the same from the median, all stars alike: a few wrong ones do not count
  CameraCovariance covariance;
};

/// A star in the frame and on the sky.
struct SeenStar {
  Eigen::Vector2d pixel;
  Eigen::Vector3d direction;
  double sigma_px = 1;  ///< of the place, per axis; only how they compare counts
};

/// Least squares from a first guess that is right within a few per cent. Lenses bend little and their axis
/// goes nearly through the middle: where few stars show more, that is assumed.
/// @param lens  few: k2 is left as it is, for stars in a part of the frame
/// @return an rms of 1e9 where there is no solution near the guess
[[nodiscard]] CameraFit fit_camera(CameraModel& camera, std::span<const SeenStar> stars, LensTerms lens);

/// Covariance of the direction of a pixel in the tangent plane, from that of the fit.
/// @return in rad^2, along the axes (first east, then north) of sky_axes()
[[nodiscard]] Eigen::Matrix2d direction_covariance(const CameraModel& camera, const CameraFit& fit,
                                                   const Eigen::Vector2d& pixel);

/// How a small step in the frame moves the direction: rad east and north per px right and down.
[[nodiscard]] Eigen::Matrix2d sky_per_px(const CameraModel& camera, const Eigen::Vector2d& pixel);

/// East and north of a direction, as columns.
[[nodiscard]] Eigen::Matrix<double, 3, 2> sky_axes(const Eigen::Vector3d& direction);

}  // namespace srfs::image
