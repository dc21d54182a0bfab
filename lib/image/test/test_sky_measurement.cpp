// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/sky_measurement.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <Eigen/Dense>

#include "image/method.hpp"
#include "lib/image/test/skies.hpp"
#include "tests/build_kind.hpp"

namespace srfs::image {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using hw_sim::SkyRandom;
using hw_sim::SkyStreak;

constexpr double per_degree = std::numbers::pi / 180;
constexpr double faintest_seen = 9;  ///< magnitude at SNR 6

/// A field of the catalogue's sky, 12 degrees wide, with streaks.
struct RealSky {
  CameraModel camera;
  hw_sim::SkyScene scene;
  std::vector<hw_sim::SkyStar> stars;
  std::vector<SkyStreak> streaks;

  [[nodiscard]] double flux(double magnitude) const {
    return hw_sim::flux_for_snr(scene, 320, 240,
                                std::min(3000.0, 6 * std::pow(10, 0.4 * (faintest_seen - magnitude))));
  }
  [[nodiscard]] Vector3d direction(double x, double y) const {
    return camera.direction(Vector2d(x - 319.5, y - 239.5));
  }
};

RealSky real_sky(SkyRandom& random, std::uint64_t seed) {
  RealSky sky;
  sky.scene.width = 640;
  sky.scene.height = 480;
  sky.scene.seed = seed;
  const Vector3d z = direction_of(random.uniform(0, 360), std::asin(random.uniform(-1, 1)) / per_degree);
  const Eigen::Matrix<double, 3, 2> axes = sky_axes(z);
  sky.camera.to_sky << -axes.col(0), -axes.col(1), z;
  sky.camera.focal_px = 320 / std::tan(6 * per_degree);
  sky.camera.corner_px = 400;
  for (const CatalogueStar& s : bright_stars()) {
    if (s.direction.dot(z) < 0.98) continue;
    const Vector2d p = sky.camera.pixel(s.direction) + Vector2d(319.5, 239.5);
    if (p.x() > -5 && p.y() > -5 && p.x() < 645 && p.y() < 485)
      sky.stars.push_back({p.x(), p.y(), sky.flux(s.magnitude)});
  }
  for (int i = 0; i < 4; ++i) {
    const double half = random.uniform(12, 60);
    const double angle = random.uniform(0, 2 * std::numbers::pi);
    const double x = random.uniform(80, 560);
    const double y = random.uniform(80, 400);
    SkyStreak s{x - half * std::cos(angle), y - half * std::sin(angle), x + half * std::cos(angle),
                y + half * std::sin(angle), 1};
    s.flux_e = 15 * std::exp(random.uniform(0, 1.5)) / hw_sim::streak_snr(sky.scene, s);
    sky.streaks.push_back(s);
  }
  return sky;
}

std::vector<Streak> measured(const RealSky& sky) {
  Frame frame = frame_of(sky.scene, sky.stars, sky.streaks);
  frame.time_s = 1000000;
  frame.exposure_s = 2;
  const MethodEntry* entry = *find_method("streak");
  const std::array<std::string, 1> given{"sky=1"};
  return entry->make(*Parameters::parse(entry->parameters, given))->process(frame)->streaks;
}

/// Of an error, beside the stated covariance: its square is 2 on average.
double deviation(const SkyPlace& place, const Vector3d& truth) {
  const Vector3d found = direction_of(place.ra_deg, place.dec_deg);
  const Vector2d error = 3600 / per_degree * sky_axes(truth).transpose() * (found - truth);
  const double mixed = place.correlation * place.sigma_east_arcsec * place.sigma_north_arcsec;
  Eigen::Matrix2d covariance;
  covariance << std::pow(place.sigma_east_arcsec, 2), mixed, mixed, std::pow(place.sigma_north_arcsec, 2);
  return std::sqrt(error.dot(covariance.inverse() * error));
}

/// Errors beside the stated sigmas.
class Deviations {
 public:
  /// @param median  of such a deviation where the sigmas are right
  explicit Deviations(double median) : median_(median) {}
  void add(double value) { values_.push_back(value); }
  [[nodiscard]] std::size_t count() const { return values_.size(); }
  /// Of the middle one: 1 where the sigmas are right. Few measurements are disturbed by something else.
  [[nodiscard]] double scale() const {
    std::vector<double> sorted = values_;
    std::sort(sorted.begin(), sorted.end());
    return sorted.at(sorted.size() / 2) / median_;
  }
  [[nodiscard]] double share_above(double value) const {
    const auto above = std::count_if(values_.begin(), values_.end(), [&](double v) { return v > value; });
    return static_cast<double>(above) / static_cast<double>(values_.size());
  }

 private:
  std::vector<double> values_;
  double median_;
};

TEST(SkyMeasurement, OfStreaksIsAsFarFromTheTruthAsItSays) {
  SkyRandom random(2027);
  const double median_of_two = std::sqrt(2 * std::numbers::ln2);
  Deviations ends(median_of_two);
  Deviations middles(median_of_two);
  constexpr std::uint64_t skies = testing_support::slow ? 2 : 14;
  for (std::uint64_t k = 0; k < skies; ++k) {
    const RealSky sky = real_sky(random, k + 1);
    for (const Streak& s : measured(sky)) {
      ASSERT_TRUE(s.sky);
      EXPECT_EQ(s.sky->begin_s, 1000000);
      for (const SkyStreak& t : sky.streaks) {
        const bool turned = std::hypot(s.x1 - t.x2, s.y1 - t.y2) < std::hypot(s.x1 - t.x1, s.y1 - t.y1);
        const SkyPlace& first = turned ? s.sky->last : s.sky->first;
        const SkyPlace& last = turned ? s.sky->first : s.sky->last;
        const Vector3d begin = sky.direction(t.x1, t.y1);
        if ((direction_of(first.ra_deg, first.dec_deg) - begin).norm() * sky.camera.focal_px > 6) continue;
        ends.add(deviation(first, begin));
        ends.add(deviation(last, sky.direction(t.x2, t.y2)));
        middles.add(deviation(s.sky->middle, sky.direction((t.x1 + t.x2) / 2, (t.y1 + t.y2) / 2)));
        const double magnitude = faintest_seen - 2.5 * std::log10(t.flux_e / sky.flux(faintest_seen));
        EXPECT_NEAR(s.sky->magnitude.value().value, magnitude, 4 * s.sky->magnitude->sigma);
      }
    }
  }
  EXPECT_GT(ends.count(), 5 * skies);
  for (const Deviations* of : {&ends, &middles}) {
    EXPECT_GT(of->scale(), testing_support::slow ? 0.4 : 0.8);  // of fewer
    EXPECT_LT(of->scale(), testing_support::slow ? 2.5 : 1.2);
    EXPECT_LT(of->share_above(4), testing_support::slow ? 0.3 : 0.1);
  }
}

}  // namespace
}  // namespace srfs::image
