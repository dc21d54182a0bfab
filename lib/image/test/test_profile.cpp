// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/profile.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include "image/line_profile.hpp"
#include "image/psf.hpp"
#include "image/vector_math.hpp"

namespace srfs::image {
namespace {

TEST(VectorMath, AgreesWithTheStandardLibrary) {
  for (double x = -30; x <= 0; x += 0.037)
    EXPECT_NEAR(double(power_of_two(static_cast<float>(x))) / std::exp2(x), 1, 2e-5) << x;
  EXPECT_EQ(power_of_two(-1000), power_of_two(-30));
  for (double u = 1; u < 1e6; u *= 1.01)
    EXPECT_NEAR(double(log_of_two(static_cast<float>(u))), std::log2(double(static_cast<float>(u))), 2e-6)
        << u;
  for (double x = -6; x <= 6; x += 0.013) {
    const auto v = static_cast<float>(x);
    EXPECT_NEAR(double(share_below(v, bell(v))), 0.5 * (1 + std::erf(x / std::sqrt(2.0))), 1e-6) << x;
  }
}

class ProfileOfGamma : public testing::TestWithParam<double> {
 protected:
  const Psf psf_{{0.21, 0.02, 0.17, GetParam()}};

  [[nodiscard]] static Patch patch() {
    Patch p;
    take_patch(Plane(40, 40, 0.0F), Grid<std::uint8_t>(40, 40), 20, 20, 7, p);
    return p;
  }
};

TEST_P(ProfileOfGamma, HasItsHeight) {
  const Patch p = patch();
  std::vector<float> heights;
  profile_heights(psf_.profile(), p, 20.3F, 19.6F, heights);
  for (std::size_t i = 0; i < p.size(); ++i) {
    const double dx = p.x + double(p.dx[i]) - 20.3;
    const double dy = p.y + double(p.dy[i]) - 19.6;
    const double q = 0.21 * dx * dx + 2 * 0.02 * dx * dy + 0.17 * dy * dy;
    const double expected = GetParam() == 0 ? std::exp(-q) : std::pow(1 + GetParam() * q, -1 / GetParam());
    EXPECT_NEAR(double(heights[i]), expected, 2e-4 * expected + 1e-9);
  }
}

TEST_P(ProfileOfGamma, HasTheDerivativesThatDifferencesShow) {
  const Patch p = patch();
  ProfileGradients here, left, right, above, below;
  constexpr float h = 0.05F;
  profile_gradients(psf_.profile(), p, 20.3F, 19.6F, here);
  profile_gradients(psf_.profile(), p, 20.3F - h, 19.6F, left);
  profile_gradients(psf_.profile(), p, 20.3F + h, 19.6F, right);
  profile_gradients(psf_.profile(), p, 20.3F, 19.6F - h, above);
  profile_gradients(psf_.profile(), p, 20.3F, 19.6F + h, below);
  for (std::size_t i = 0; i < p.size(); ++i) {
    EXPECT_NEAR(here.x[i], (right.height[i] - left.height[i]) / (2 * h), 1e-3);
    EXPECT_NEAR(here.y[i], (below.height[i] - above.height[i]) / (2 * h), 1e-3);
  }
}

INSTANTIATE_TEST_SUITE_P(Gamma, ProfileOfGamma, testing::Values(0.0, 0.005, 0.2, 0.5));

/// A frame whose pixel values encode their position.
Plane numbered(int width, int height) {
  Plane plane(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) plane.at(x, y) = static_cast<float>(1000 * y + x);
  }
  return plane;
}

/// Checks the contents that any patch of a frame must have.
void expect_whole(const Patch& p, const Plane& frame, const Grid<std::uint8_t>& flaws) {
  EXPECT_EQ(p.size() % Patch::lanes, 0U);
  int pixels = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const int x = p.x + static_cast<int>(p.dx[i]);
    const int y = p.y + static_cast<int>(p.dy[i]);
    const bool usable = frame.contains(x, y) && flaws.at(x, y) == 0;
    if (p.use[i] == 0) continue;
    ++pixels;
    EXPECT_EQ(p.use[i], 1);
    EXPECT_TRUE(usable) << x << ' ' << y;
    EXPECT_EQ(p.light[i], usable ? frame.at(x, y) : -1);
  }
  int expected = 0;
  for (int y = 0; y < frame.height(); ++y) {
    for (int x = 0; x < frame.width(); ++x)
      expected += std::hypot(x - p.x, y - p.y) <= p.radius + 0.5 && flaws.at(x, y) == 0;
  }
  EXPECT_EQ(pixels, expected) << "around " << p.x << ", " << p.y << " to " << p.radius;
}

TEST(Patch, HoldsTheUsablePixelsOfTheFrameUpToItsRadiusOnce) {
  const Plane frame = numbered(43, 37);
  Grid<std::uint8_t> flaws(43, 37);
  flaws.at(1, 1) = flaws.at(20, 20) = flaws.at(42, 36) = 1;
  Patch p;  // reused, with the contents of the previous round
  for (const int radius : {2, 1, 12, 6, 9, 3, 20, 5}) {
    for (int y = -3; y < 40; y += 3) {
      for (int x = -3; x < 46; ++x) {
        take_patch(frame, flaws, x + 0.3, y - 0.4, radius, p);
        EXPECT_EQ(p.x, x);
        EXPECT_EQ(p.y, y);
        expect_whole(p, frame, flaws);
      }
    }
  }
}

TEST(LineSums, AreTheDerivativesThatDifferencesShow) {
  LinePixels pixels;
  for (int y = -8; y <= 8; ++y) {
    for (int x = -20; x <= 20; ++x) {
      pixels.x.push_back(static_cast<float>(x));
      pixels.y.push_back(static_cast<float>(y));
      pixels.light.push_back(0);
    }
  }
  const LineShape line{0, 0, 0.8F, 0.6F, -10, 9, 1.4F, 1.7F, 3};
  const auto light_of = [&](LineShape l) {
    std::vector<float> unit;
    line_heights(l, pixels, unit);
    for (float& v : unit) v *= l.height;
    return unit;
  };
  // The light is the model of a slightly displaced line, so the right side is the derivative times itself.
  const LineNoise noise{0, 0};
  constexpr float h = 0.02F;
  const auto moved = [&](std::size_t parameter) {
    LineShape l = line;
    if (parameter == 0) l.from += h;
    if (parameter == 1) l.to += h;
    if (parameter == 2) l.x -= h * l.uy, l.y += h * l.ux;
    if (parameter == 3)
      l.ux = std::cos(std::atan2(0.6F, 0.8F) + h), l.uy = std::sin(std::atan2(0.6F, 0.8F) + h);
    if (parameter == 4) l.height += h;
    if (parameter == 5) l.sigma_across += h;
    return l;
  };
  for (std::size_t k = 0; k < LineSums::parameters; ++k) {
    pixels.light = light_of(moved(k));
    const LineSums sums = line_sums(line, pixels, noise);
    const double expected = sums.normal[k][k] * double(h);
    EXPECT_NEAR(sums.right[k], expected, 0.08 * std::abs(expected) + 1e-3) << "parameter " << k;
  }
}

}  // namespace
}  // namespace srfs::image
