// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/sky/sky_frame.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace srfs::hw_sim {
namespace {

constexpr double pi = std::numbers::pi;

/// Light of a point source on the pixels; sums to 1 over the plane.
class PointSpread {
 public:
  explicit PointSpread(const SkyScene& scene) : beta_(scene.moffat_beta), fwhm_(scene.fwhm_px) {
    // q = 1 in the half-light unit of the profile: exp(-q) or (1 + q)^-beta
    const double q_half = beta_ > 0 ? std::pow(2.0, 1 / beta_) - 1 : std::log(2.0);
    const double half = fwhm_ / 2;
    const double ratio = 1 - scene.ellipticity;
    const double major = q_half / (half * half) * ratio;  // the area stays
    const double minor = q_half / (half * half) / ratio;
    const double c = std::cos(scene.major_axis_rad);
    const double s = std::sin(scene.major_axis_rad);
    xx_ = major * c * c + minor * s * s;
    yy_ = major * s * s + minor * c * c;
    xy_ = (major - minor) * c * s;
    const double area = pi / std::sqrt(major * minor);
    norm_ = beta_ > 0 ? (beta_ - 1) / area : 1 / area;
  }

  [[nodiscard]] int radius() const { return static_cast<int>(std::ceil((beta_ > 0 ? 6 : 2.5) * fwhm_)) + 1; }

  /// Share of the pixel whose centre is (dx, dy) from the source.
  [[nodiscard]] double pixel(double dx, double dy) const {
    const double distance = std::hypot(dx, dy);
    const int n = distance < 1.5 * fwhm_ + 1 ? 7 : 3;
    double sum = 0;
    for (int j = 0; j < n; ++j) {
      for (int i = 0; i < n; ++i) sum += value(dx + (i + 0.5) / n - 0.5, dy + (j + 0.5) / n - 0.5);
    }
    return sum / (n * n);
  }

 private:
  [[nodiscard]] double value(double dx, double dy) const {
    const double q = xx_ * dx * dx + 2 * xy_ * dx * dy + yy_ * dy * dy;
    return norm_ * (beta_ > 0 ? std::pow(1 + q, -beta_) : std::exp(-q));
  }

  double beta_;
  double fwhm_;
  double xx_;
  double yy_;
  double xy_;
  double norm_;
};

double background(const SkyScene& scene, double x, double y) {
  const double u = x / scene.width - 0.5;
  const double v = y / scene.height - 0.5;
  return scene.background_e *
         std::max(0.02, 1 + scene.gradient * (u + v) - scene.curvature * 2 * (u * u + v * v));
}

double noise_variance(const SkyScene& scene, double x, double y) {
  const double rounding = scene.adu_step * scene.gain_e_per_adu;
  return background(scene, x, y) + scene.read_noise_e * scene.read_noise_e + rounding * rounding / 12;
}

class Canvas {
 public:
  explicit Canvas(const SkyScene& scene)
      : width_(scene.width),
        height_(scene.height),
        psf_(scene),
        e_(static_cast<std::size_t>(scene.width) * static_cast<std::size_t>(scene.height)) {
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) at(x, y) = background(scene, x, y);
    }
  }

  void add(const SkyStar& star) {
    const int r = psf_.radius();
    const int x0 = static_cast<int>(std::lround(star.x));
    const int y0 = static_cast<int>(std::lround(star.y));
    for (int y = std::max(0, y0 - r); y <= std::min(height_ - 1, y0 + r); ++y) {
      for (int x = std::max(0, x0 - r); x <= std::min(width_ - 1, x0 + r); ++x)
        at(x, y) += star.flux_e * psf_.pixel(x - star.x, y - star.y);
    }
  }

  void add(const SkyStreak& streak) {
    const double length = std::hypot(streak.x2 - streak.x1, streak.y2 - streak.y1);
    const int steps = std::max(1, static_cast<int>(std::ceil(length * 3)));
    for (int i = 0; i < steps; ++i) {
      const double t = (i + 0.5) / steps;
      add(SkyStar{streak.x1 + t * (streak.x2 - streak.x1), streak.y1 + t * (streak.y2 - streak.y1),
                  streak.flux_e / steps});
    }
  }

  double& at(int x, int y) {
    return e_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x)];
  }
  [[nodiscard]] const std::vector<double>& electrons() const { return e_; }

 private:
  int width_;
  int height_;
  PointSpread psf_;
  std::vector<double> e_;
};

/// A particle's track: charge along a line, not blurred by the optics.
void add_cosmic_ray(const SkyScene& scene, SkyRandom& random, std::vector<double>& e) {
  double x = random.uniform(0, scene.width);
  double y = random.uniform(0, scene.height);
  const double angle = random.uniform(0, 2 * pi);
  const double length = std::min(60.0, 1 - 5 * std::log(1 - random.uniform()));
  const double charge_e_px = 150 * std::exp(random.uniform(0, 2.5));
  for (double t = 0; t < length; t += 0.25) {
    const int xi = static_cast<int>(std::floor(x + t * std::cos(angle)));
    const int yi = static_cast<int>(std::floor(y + t * std::sin(angle)));
    if (xi < 0 || yi < 0 || xi >= scene.width || yi >= scene.height) break;
    e[static_cast<std::size_t>(yi) * static_cast<std::size_t>(scene.width) + static_cast<std::size_t>(xi)] +=
        0.25 * charge_e_px;
  }
}

}  // namespace

std::vector<float> render_sky(const SkyScene& scene, const std::vector<SkyStar>& stars,
                              const std::vector<SkyStreak>& streaks) {
  SkyRandom random(scene.seed);
  SkyRandom pattern((scene.pattern_seed != 0 ? scene.pattern_seed : scene.seed) ^ 0x5DEECE66DU);
  Canvas canvas(scene);
  for (const SkyStar& star : stars) canvas.add(star);
  for (const SkyStreak& streak : streaks) canvas.add(streak);
  std::vector<double> e = canvas.electrons();
  for (double& v : e) v = random.poisson(std::max(0.0, v * (1 + scene.prnu * pattern.normal())));
  for (int i = 0; i < scene.cosmic_rays; ++i) add_cosmic_ray(scene, random, e);
  const double noise_e = std::sqrt(noise_variance(scene, scene.width / 2.0, scene.height / 2.0));
  for (int i = 0; i < scene.hot_pixels; ++i) {
    const auto at = static_cast<std::size_t>(pattern.uniform() * static_cast<double>(e.size()));
    e[at] += noise_e * 5 * std::exp(pattern.uniform(0, 4));
  }
  std::vector<double> column_adu(static_cast<std::size_t>(scene.width));
  for (double& c : column_adu) c = scene.column_pattern_adu * pattern.normal();
  std::vector<float> adu(e.size());
  for (std::size_t i = 0; i < e.size(); ++i) {
    const double v = scene.bias_adu + column_adu[i % column_adu.size()] +
                     (e[i] + scene.read_noise_e * random.normal()) / scene.gain_e_per_adu;
    adu[i] = static_cast<float>(
        std::clamp(std::round(v / scene.adu_step) * scene.adu_step, 0.0, scene.saturation_adu));
  }
  return adu;
}

StarLimits star_limits(const SkyScene& scene, const SkyStar& star) {
  const PointSpread psf(scene);
  constexpr double h = 0.02;
  std::array<double, 6> f{};  // xx, xy, yy, xF, yF, FF
  const int r = psf.radius();
  const int x0 = static_cast<int>(std::lround(star.x));
  const int y0 = static_cast<int>(std::lround(star.y));
  for (int y = std::max(0, y0 - r); y <= std::min(scene.height - 1, y0 + r); ++y) {
    for (int x = std::max(0, x0 - r); x <= std::min(scene.width - 1, x0 + r); ++x) {
      const double dx = x - star.x;
      const double dy = y - star.y;
      const double p = psf.pixel(dx, dy);
      const double px = star.flux_e * (psf.pixel(dx - h, dy) - psf.pixel(dx + h, dy)) / (2 * h);
      const double py = star.flux_e * (psf.pixel(dx, dy - h) - psf.pixel(dx, dy + h)) / (2 * h);
      const double weight = 1 / (noise_variance(scene, x, y) + star.flux_e * p);
      f[0] += weight * px * px;
      f[1] += weight * px * py;
      f[2] += weight * py * py;
      f[5] += weight * p * p;
    }
  }
  const double det = f[0] * f[2] - f[1] * f[1];
  return {star.flux_e * std::sqrt(f[5]), std::sqrt(f[2] / det), std::sqrt(f[0] / det)};
}

double flux_for_snr(const SkyScene& scene, double x, double y, double snr) {
  const PointSpread psf(scene);
  double energy = 0;
  const int r = psf.radius();
  for (int j = -r; j <= r; ++j) {
    for (int i = -r; i <= r; ++i) {
      const double p = psf.pixel(i + std::round(x) - x, j + std::round(y) - y);
      energy += p * p;
    }
  }
  return snr * std::sqrt(noise_variance(scene, x, y) / energy);
}

double streak_snr(const SkyScene& scene, const SkyStreak& streak) {
  SkyScene dark = scene;
  dark.background_e = 0;
  Canvas canvas(dark);
  canvas.add(SkyStreak{streak.x1, streak.y1, streak.x2, streak.y2, streak.flux_e});
  double sum = 0;
  for (int y = 0; y < scene.height; ++y) {
    for (int x = 0; x < scene.width; ++x)
      sum += canvas.at(x, y) * canvas.at(x, y) / noise_variance(scene, x, y);
  }
  return std::sqrt(sum);
}

}  // namespace srfs::hw_sim
