// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/known_stars.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "image/line_fit.hpp"
#include "image/sky_measurement.hpp"

namespace srfs::image {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double fwhm_per_sigma = 2.3548;
/// What the catalogue says of a star's light may be wrong by this share: colour, blends, stars that vary.
constexpr double flux_error = 0.3;
/// Of a streak's light, that the catalogue's stars on it have to have.
constexpr double light_share_least = 0.5;
/// Of its height, that a line beside the stars has to have, within so many sigmas.
constexpr double height_share_least = 0.5;
constexpr double height_sigmas = 1.5;
/// Of a star's light, that the catalogue's star in its place has to have.
constexpr double star_share_least = 0.3;
constexpr double margin_px = 5;  ///< around the frame
constexpr double radius_slack = 1.02;
constexpr double wings_fwhm = 4;  ///< how far a star's light reaches, at most

/// How far from the frame's middle its corners look.
double radius_of(const CameraModel& camera, int width, int height) {
  const Vector3d middle = camera.direction(Vector2d::Zero());
  double chord = 0;
  for (const double x : {-0.5, 0.5}) {
    for (const double y : {-0.5, 0.5})
      chord = std::max(chord, (camera.direction(Vector2d(x * width, y * height)) - middle).norm());
  }
  return 2 * std::asin(std::min(1.0, chord / 2));
}

}  // namespace

KnownStars::KnownStars(std::vector<Known> stars, double spread_px)
    : stars_(std::move(stars)), places_(stars_), spread_px_(spread_px) {}

std::optional<KnownStars> KnownStars::of(const PlateSolution& solution, const std::vector<Star>& stars,
                                         int width, int height) {
  const auto zero = zero_point_of(solution, stars);
  if (!zero) return std::nullopt;
  const CameraModel& camera = solution.camera;
  const double radius = radius_slack * radius_of(camera, width, height);
  std::vector<Known> known;
  for (const CatalogueStar& s : stars_around(camera.direction(Vector2d::Zero()), radius)) {
    if (!camera.is_ahead(s.direction)) continue;
    const Vector2d at = camera.pixel(s.direction) + Vector2d((width - 1) / 2.0, (height - 1) / 2.0);
    if (at.x() < -margin_px || at.y() < -margin_px || at.x() > width + margin_px ||
        at.y() > height + margin_px)
      continue;
    known.push_back({at.x(), at.y(), std::pow(10, 0.4 * (zero->value - s.magnitude))});
  }
  return KnownStars(std::move(known), std::max(solution.fit.spread_px, place_floor_px));
}

bool KnownStars::explain(const Streak& streak, const CleanFrame& clean) const {
  if (light_along(streak, clean.psf.fwhm_px()) < light_share_least * streak.flux) return false;
  const double unit = double(clean.noise_adu.at((streak.x1 + streak.x2) / 2, (streak.y1 + streak.y2) / 2));
  const double across = std::sqrt(2 * std::numbers::pi) * streak.width_px / fwhm_per_sigma;
  const double claimed = streak.flux / (std::max(1.0, streak.length_px()) * across * unit);
  const Height height = height_beside_stars(streak, clean);
  return height.value + height_sigmas * height.sigma < height_share_least * claimed;
}

/// Of the stars on it, in ADU.
double KnownStars::light_along(const Streak& s, double fwhm_px) const {
  const double length = std::max(1e-3, s.length_px());
  const double ux = (s.x2 - s.x1) / length;
  const double uy = (s.y2 - s.y1) / length;
  const double across_most = 0.8 * std::max(fwhm_px, s.width_px) + 0.5 + 2 * spread_px_;
  const double beyond = 0.7 * fwhm_px + 2 * spread_px_;
  double light = 0;
  places_.near((s.x1 + s.x2) / 2, (s.y1 + s.y2) / 2, length / 2 + across_most + beyond,
               [&](std::size_t k, double) {
                 const Known& star = stars_[k];
                 const double along = (star.x - s.x1) * ux + (star.y - s.y1) * uy;
                 const double across = std::abs((star.y - s.y1) * ux - (star.x - s.x1) * uy);
                 if (across < across_most && along > -beyond && along < length + beyond) light += star.flux;
               });
  return light;
}

/// Least squares of an evenly lit line, the stars' light taken away. What the catalogue and the solution may
/// say wrongly of a star counts as noise, for each star as a whole.
KnownStars::Height KnownStars::height_beside_stars(const Streak& streak, const CleanFrame& clean) const {
  const Line line{streak.x1, streak.y1, streak.x2, streak.y2};
  const double sigma = streak.width_px / fwhm_per_sigma;
  const double reach = 2 * sigma + 1;
  const double wings = wings_fwhm * clean.psf.fwhm_px();
  const double unit = double(clean.noise_adu.at((line.x1 + line.x2) / 2, (line.y1 + line.y2) / 2));
  double product = 0;
  double energy = 0;
  std::vector<double> by_star(stars_.size(), 0.0);
  std::vector<std::pair<std::size_t, double>> here;
  for_pixels_along(line, clean.signal.width(), clean.signal.height(), reach, 0,
                   [&](int x, int y, double, double across) {
                     if (clean.flaws.at(x, y) != 0) return;
                     double model = 0;
                     double variance = 1;
                     here.clear();
                     places_.near(x, y, wings, [&](std::size_t k, double distance) {
                       const Known& s = stars_[k];
                       const double height = s.flux / clean.psf.flux() / unit;
                       const double nearer = distance > spread_px_ ? 1 - spread_px_ / distance : 0;
                       const auto dx = static_cast<float>(x - s.x);
                       const auto dy = static_cast<float>(y - s.y);
                       const auto share = static_cast<float>(nearer);
                       const double light = height * double(clean.psf.height(dx, dy));
                       const double moved = height * double(clean.psf.height(share * dx, share * dy)) - light;
                       model += light;
                       variance += flux_error * flux_error * light * light + moved * moved;
                       here.emplace_back(k, light);
                     });
                     const double line_light = std::exp(-across * across / (2 * sigma * sigma));
                     const double weight = line_light / variance;
                     product += weight * (double(clean.signal.at(x, y)) - model);
                     energy += weight * line_light;
                     for (const auto& [k, light] : here) by_star[k] += weight * light;
                   });
  if (!(energy > 0)) return {0, 1e9};  // nothing is seen of it: not explained
  double squares = 1 / energy;
  for (const double light : by_star) squares += std::pow(flux_error * light / energy, 2);
  return {product / energy, std::sqrt(squares)};
}

bool KnownStars::explain(const Star& star) const {
  const double reach = std::max(1.0, 0.4 * star.fwhm_px) + 2 * spread_px_;
  bool is_there = false;
  places_.near(star.x, star.y, reach, [&](std::size_t k, double) {
    is_there = is_there || stars_[k].flux > star_share_least * star.flux;
  });
  return is_there;
}

std::vector<Streak> drop_known_stars(const KnownStars& known, const CleanFrame& clean,
                                     std::vector<Streak>& streaks, std::vector<std::string>& notes) {
  std::vector<Streak> dropped;
  std::erase_if(streaks, [&](const Streak& s) {
    const bool are_stars = known.explain(s, clean);
    if (are_stars) dropped.push_back(s);
    return are_stars;
  });
  if (!dropped.empty())
    notes.push_back(fmt::format("{} streaks are rows of the catalogue's stars: left out", dropped.size()));
  return dropped;
}

}  // namespace srfs::image
