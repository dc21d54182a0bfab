// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/sky_measurement.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Dense>

namespace srfs::image {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double arcsec_per_rad = 180 * 3600 / std::numbers::pi;
constexpr double deg_per_rad = 180 / std::numbers::pi;
constexpr double fwhm_per_sigma = 2.3548;
/// Of a catalogue star's place: rounding, and what it moved since 2000.
constexpr double catalogue_sigma_arcsec = 0.1;
constexpr std::size_t zero_stars_least = 5;
/// How much less certain the ends of a streak are than its light allows, as simulated frames show.
constexpr double end_excess = 1.2;
/// Of a streak's light, in magnitudes: its wings are taken for sky.
constexpr double streak_light_sigma = 0.25;
constexpr double magnitude_per_share = 2.5 / std::numbers::ln10;

/// Of the places of a streak, from the information in its light: of a blurred line in noise of the sky.
struct StreakSigmas {
  double across_px;  ///< of the middle; at the ends twice as much
  double end_px;     ///< of each end, along
};

StreakSigmas sigmas_of(const Streak& s) {
  const double blur = s.width_px / fwhm_per_sigma;
  const double snr = std::max(s.snr, 1.0);
  const double across = std::numbers::sqrt2 * blur / snr;
  const double along =
      end_excess * std::sqrt(2 * std::sqrt(std::numbers::pi) * blur * std::max(s.length_px(), blur)) / snr;
  return {std::hypot(across, place_floor_px), std::hypot(along, place_floor_px)};
}

/// @param along, across  sigmas with respect to the streak's direction
Matrix2d turned(const Streak& s, double along, double across) {
  const double angle = std::atan2(s.y2 - s.y1, s.x2 - s.x1);
  Matrix2d axes;
  axes << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  return axes * Vector2d(along * along, across * across).asDiagonal() * axes.transpose();
}

}  // namespace

std::optional<Magnitude> zero_point_of(const PlateSolution& solution, const std::vector<Star>& stars) {
  std::vector<double> zeros;  // their median counts
  for (const PlateSolution::Match& m : solution.matches) {
    if (stars[m.star].flux > 0)
      zeros.push_back(static_cast<double>(m.magnitude) + 2.5 * std::log10(stars[m.star].flux));
  }
  if (zeros.size() < zero_stars_least) return std::nullopt;
  const auto middle = zeros.begin() + static_cast<std::ptrdiff_t>(zeros.size() / 2);
  const auto median = [&] {
    std::nth_element(zeros.begin(), middle, zeros.end());
    return *middle;
  };
  const double zero = median();
  const auto count = static_cast<double>(zeros.size());
  for (double& z : zeros) z = std::abs(z - zero);
  constexpr double normal_per_median = 1.4826;
  constexpr double median_per_mean = 1.2533;
  return Magnitude{zero, normal_per_median * median() * median_per_mean / std::sqrt(count)};
}

SkyMeasurement::SkyMeasurement(PlateSolution solution, const std::vector<Star>& stars, const Frame& frame)
    : solution_(std::move(solution)),
      middle_px_((frame.pixels.width() - 1) / 2.0, (frame.pixels.height() - 1) / 2.0),
      zero_point_(zero_point_of(solution_, stars)),
      begin_s_(frame.time_s),
      exposure_s_(frame.exposure_s) {}

SkyPlace SkyMeasurement::place(double x, double y, const Matrix2d& covariance_px) const {
  const Vector2d pixel = Vector2d(x, y) - middle_px_;
  const Vector3d direction = solution_.camera.direction(pixel);
  const Matrix2d turn = sky_per_px(solution_.camera, pixel);
  const Matrix2d covariance = arcsec_per_rad * arcsec_per_rad *
                                  (turn * covariance_px * turn.transpose() +
                                   direction_covariance(solution_.camera, solution_.fit, pixel)) +
                              catalogue_sigma_arcsec * catalogue_sigma_arcsec * Matrix2d::Identity();
  const double ra_deg = deg_per_rad * std::atan2(direction.y(), direction.x());
  const double east = std::sqrt(covariance(0, 0));
  const double north = std::sqrt(covariance(1, 1));
  return {ra_deg < 0 ? ra_deg + 360 : ra_deg, deg_per_rad * std::asin(std::clamp(direction.z(), -1.0, 1.0)),
          east, north, covariance(0, 1) / (east * north)};
}

std::optional<Magnitude> SkyMeasurement::magnitude(double flux, double snr, double floor) const {
  if (!zero_point_ || !(flux > 0)) return std::nullopt;
  return Magnitude{zero_point_->value - 2.5 * std::log10(flux),
                   std::hypot(zero_point_->sigma, magnitude_per_share / std::max(snr, 1.0), floor)};
}

SkyTrail SkyMeasurement::of(const Streak& s) const {
  const StreakSigmas sigmas = sigmas_of(s);
  SkyTrail trail;
  const Matrix2d at_end = turned(s, sigmas.end_px, 2 * sigmas.across_px);
  trail.first = place(s.x1, s.y1, at_end);
  trail.last = place(s.x2, s.y2, at_end);
  trail.middle = place((s.x1 + s.x2) / 2, (s.y1 + s.y2) / 2,
                       turned(s, sigmas.end_px / std::numbers::sqrt2, sigmas.across_px));
  trail.begin_s = begin_s_;
  trail.exposure_s = exposure_s_;
  trail.magnitude = magnitude(s.flux, s.snr, streak_light_sigma);
  return trail;
}

void SkyMeasurement::add_to(TrackPoint& point, double vx, double vy) const {
  if (point.streak) {
    Streak& s = *point.streak;
    if ((s.x2 - s.x1) * vx + (s.y2 - s.y1) * vy < 0) {
      std::swap(s.x1, s.x2);
      std::swap(s.y1, s.y2);
    }
    s.sky = of(s);
    s.sky->is_directed = true;
    point.sky = SkyPoint{s.sky->middle, begin_s_, exposure_s_, s.sky->magnitude};
    return;
  }
  const double sigma = place_sigma_px({point.x, point.y, point.flux, point.snr, point.fwhm_px});
  point.sky = SkyPoint{place(point.x, point.y, sigma * sigma * Matrix2d::Identity()), begin_s_, exposure_s_,
                       magnitude(point.flux, point.snr, 0)};
}

void add_sky(SequenceFindings& found, const std::vector<std::optional<SkyMeasurement>>& frames) {
  for (std::size_t k = 0; k < std::min(found.streaks.size(), frames.size()); ++k) {
    for (Streak& s : found.streaks[k]) {
      if (frames[k]) s.sky = frames[k]->of(s);
    }
  }
  for (Tracklet& t : found.tracklets) {
    for (TrackPoint& p : t.points) {
      const auto frame = static_cast<std::size_t>(p.frame);
      if (frame >= frames.size() || !frames[frame]) continue;
      // The velocity as the point's own frame shows it.
      const FrameTransform& to_reference = found.registrations[frame].registration.to_reference;
      const auto here = to_reference(p.x, p.y);
      const auto next = to_reference.inverse(here.x + t.vx, here.y + t.vy);
      frames[frame]->add_to(p, next.x - p.x, next.y - p.y);
    }
  }
}

}  // namespace srfs::image
