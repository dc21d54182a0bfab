// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/camera_model.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include <Eigen/Dense>

namespace srfs::image {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

using Row = Eigen::Matrix<double, 1, camera_parameters>;
using Rows = Eigen::Matrix<double, 2, camera_parameters>;

// What is assumed of a lens: standard deviations.
constexpr double axis_spread = 0.015;  ///< over half the diagonal
constexpr double k1_spread = 0.05;
constexpr double k2_spread = 0.015;
constexpr double held_spread = 1e-6;

constexpr double turn_most_rad = 0.1;
constexpr double bend_most = 0.3;
constexpr int rounds_most = 8;
constexpr double fitted_numbers = 6;  ///< that a few stars determine
constexpr double scale_least = 0.04;  ///< of the variance of the places, to what is expected
constexpr double median_of_squares = 2 * std::numbers::ln2;  ///< of two normal numbers

Matrix2d side_of(const CameraModel& camera) {
  return Vector2d(camera.mirrored ? -1 : 1, 1).asDiagonal();
}

/// As a lens without distortion would show it, from the axis.
Vector2d straight(const CameraModel& camera, const Vector2d& pixel) {
  const Vector2d q = pixel - camera.axis;
  const double square = q.squaredNorm() / (camera.corner_px * camera.corner_px);
  return q * (1 + square * (camera.k1 + square * camera.k2));
}

/// Derivative of straight() by the pixel.
Matrix2d straight_slope(const CameraModel& camera, const Vector2d& pixel) {
  const Vector2d q = pixel - camera.axis;
  const double per = 1 / (camera.corner_px * camera.corner_px);
  const double square = q.squaredNorm() * per;
  return (1 + square * (camera.k1 + square * camera.k2)) * Matrix2d::Identity() +
         (2 * camera.k1 + 4 * camera.k2 * square) * per * q * q.transpose();
}

/// How what the sky shows minus what the frame shows grows with the parameters.
Rows slopes(const CameraModel& camera, const Vector2d& pixel, const Vector2d& flat) {
  const double f = camera.focal_px;
  const double u = flat.x();
  const double w = flat.y();
  const Vector2d q = pixel - camera.axis;
  const double square = q.squaredNorm() / (camera.corner_px * camera.corner_px);
  const Matrix2d side = side_of(camera);
  Rows rows;
  rows.row(0).head<4>() << f * u * w, -f * (1 + u * u), f * w, u;
  rows.row(1).head<4>() << f * (1 + w * w), -f * u * w, -f * u, w;
  rows.block<2, 2>(0, 4) = side * straight_slope(camera, pixel);
  rows.col(6) = -side * q * square;
  rows.col(7) = -side * q * square * square;
  return rows;
}

Vector2d flat_of(const CameraModel& camera, const Vector3d& direction) {
  const Vector3d v = camera.to_sky.transpose() * direction;
  return {v.x() / v.z(), v.y() / v.z()};
}

double weight_of(const SeenStar& star) {
  return 1 / (star.sigma_px * star.sigma_px);
}

Row assumptions(const CameraModel& camera, LensTerms lens) {
  Row weights = Row::Zero();
  const auto weight = [](double spread) { return 1 / (spread * spread); };
  weights[4] = weights[5] = weight(axis_spread * camera.corner_px);
  weights[6] = weight(k1_spread);
  weights[7] = weight(lens == LensTerms::all ? k2_spread : held_spread);
  return weights;
}

/// @return false where the step leads away from every camera
bool take_step(CameraModel& camera, const Eigen::Matrix<double, camera_parameters, 1>& step) {
  if (!step.allFinite() || step.head<3>().norm() > turn_most_rad) return false;
  // When the camera turns by this, the stars turn the other way in its axes.
  const Vector3d turn = step.head<3>();
  const double size = turn.norm();
  if (size > 0) camera.to_sky = camera.to_sky * Eigen::AngleAxisd(size, turn / size).toRotationMatrix();
  camera.focal_px += step[3];
  camera.axis += step.segment<2>(4);
  camera.k1 += step[6];
  camera.k2 += step[7];
  // Farther out is farther out, up to the corner.
  return camera.focal_px > 0 && std::abs(camera.k1) < bend_most && std::abs(camera.k2) < bend_most &&
         1 + 3 * camera.k1 + 5 * camera.k2 > bend_most && camera.axis.norm() < camera.corner_px / 4;
}

/// Squares of the distances between where the stars are seen and where the camera says.
std::vector<double> squares_left(const CameraModel& camera, std::span<const SeenStar> stars) {
  std::vector<double> squares;
  squares.reserve(stars.size());
  for (const SeenStar& s : stars)
    squares.push_back(
        (side_of(camera) * straight(camera, s.pixel) - camera.focal_px * flat_of(camera, s.direction))
            .squaredNorm());
  return squares;
}

}  // namespace

Vector3d CameraModel::direction(const Vector2d& pixel) const {
  const Vector2d u = side_of(*this) * straight(*this, pixel);
  return to_sky * Vector3d(u.x(), u.y(), focal_px).normalized();
}

bool CameraModel::is_ahead(const Vector3d& direction) const {
  return to_sky.col(2).dot(direction) > 0.1;
}

Vector2d CameraModel::pixel(const Vector3d& direction) const {
  const Vector2d wanted = focal_px * (side_of(*this) * flat_of(*this, direction));
  Vector2d pixel = axis + wanted;
  for (int round = 0; round < rounds_most; ++round) {
    const Vector2d step = straight_slope(*this, pixel).inverse() * (wanted - straight(*this, pixel));
    if (!step.allFinite()) break;
    pixel += step;
    if (step.squaredNorm() < 1e-8) break;
  }
  return pixel;
}

CameraFit fit_camera(CameraModel& camera, std::span<const SeenStar> stars, LensTerms lens) {
  const CameraFit none{1e9, 1e9, CameraCovariance::Zero()};
  CameraCovariance normal;
  for (int round = 0; round < rounds_most; ++round) {
    const Row weights = assumptions(camera, lens);
    normal = weights.transpose().asDiagonal();
    Eigen::Matrix<double, camera_parameters, 1> right;
    right << 0, 0, 0, 0, camera.axis, camera.k1, camera.k2;
    right = (-weights.transpose().array() * right.array()).eval();
    for (const SeenStar& s : stars) {
      const Vector2d flat = flat_of(camera, s.direction);
      const Rows rows = slopes(camera, s.pixel, flat);
      const double weight = weight_of(s);
      normal += weight * rows.transpose() * rows;
      right +=
          weight * rows.transpose() * (side_of(camera) * straight(camera, s.pixel) - camera.focal_px * flat);
    }
    const Eigen::Matrix<double, camera_parameters, 1> step = normal.ldlt().solve(right);
    if (!take_step(camera, step)) return none;
    if (step.head<3>().norm() * camera.focal_px < 1e-3 && std::abs(step[3]) < 1e-5 * camera.focal_px &&
        step.segment<2>(4).norm() < 1e-2 && step.tail<2>().norm() < 1e-5)
      break;
  }
  std::vector<double> squares = squares_left(camera, stars);
  if (squares.empty()) return none;
  double weighted = 0;
  double weights = 0;
  for (std::size_t i = 0; i < stars.size(); ++i) {
    weighted += weight_of(stars[i]) * squares[i];
    weights += weight_of(stars[i]);
  }
  const auto middle = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
  std::nth_element(squares.begin(), middle, squares.end());
  // What is fitted leaves less than the noise.
  const double scale = weighted / std::max(1.0, 2.0 * static_cast<double>(stars.size()) - fitted_numbers);
  return {std::sqrt(weighted / (2 * weights)), std::sqrt(*middle / median_of_squares),
          std::max(scale, scale_least) * normal.inverse()};
}

Eigen::Matrix<double, 3, 2> sky_axes(const Vector3d& direction) {
  const Vector3d east = std::hypot(direction.x(), direction.y()) > 1e-9
                            ? Vector3d(-direction.y(), direction.x(), 0).normalized()
                            : Vector3d(0, 1, 0);
  Eigen::Matrix<double, 3, 2> axes;
  axes << east, direction.cross(east);
  return axes;
}

Matrix2d sky_per_px(const CameraModel& camera, const Vector2d& pixel) {
  const Vector2d u = side_of(camera) * straight(camera, pixel);
  const Vector3d ray(u.x(), u.y(), camera.focal_px);
  const Vector3d unit = ray.normalized();
  // Of the ray's length, only what is across it turns the direction.
  const Eigen::Matrix<double, 3, 2> across =
      (Eigen::Matrix3d::Identity() - unit * unit.transpose()).leftCols<2>() / ray.norm();
  return sky_axes(camera.to_sky * unit).transpose() * camera.to_sky * across * side_of(camera) *
         straight_slope(camera, pixel);
}

Matrix2d direction_covariance(const CameraModel& camera, const CameraFit& fit, const Vector2d& pixel) {
  const Rows rows = slopes(camera, pixel, flat_of(camera, camera.direction(pixel)));
  // What the parameters move on the flat image, as a step in the frame.
  const Matrix2d step = (side_of(camera) * straight_slope(camera, pixel)).inverse();
  const Matrix2d in_frame = step * rows * fit.covariance * rows.transpose() * step.transpose();
  const Matrix2d turn = sky_per_px(camera, pixel);
  return turn * in_frame * turn.transpose();
}

}  // namespace srfs::image
