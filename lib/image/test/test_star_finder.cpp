// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/star_finder.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <gmock/gmock.h>

#include "lib/image/test/skies.hpp"

namespace srfs::image {
namespace {

using hw_sim::SkyScene;
using hw_sim::SkyStar;

std::vector<Star> stars_in(const Frame& frame, FrameFindings& findings) {
  const CleanFrame clean = clean_frame(frame, findings);
  return find_stars(clean, {}).stars;
}

std::vector<Star> stars_in(const Frame& frame) {
  FrameFindings findings;
  return stars_in(frame, findings);
}

const Star* nearest(const std::vector<Star>& stars, double x, double y, double within) {
  const Star* best = nullptr;
  for (const Star& s : stars) {
    const double d = std::hypot(s.x - x, s.y - y);
    if (d <= within && (best == nullptr || d < std::hypot(best->x - x, best->y - y))) best = &s;
  }
  return best;
}

class StarsOfEveryWidth : public testing::TestWithParam<double> {};

TEST_P(StarsOfEveryWidth, AreFoundNearTheCramerRaoBoundWithTheirFluxAndWidth) {
  SkyScene scene = small_scene(GetParam(), 11);
  scene.gradient = 0.3;
  scene.curvature = 0.3;
  const std::vector<SkyStar> truth = lattice(scene, 40, 45.37);

  const std::vector<Star> found = stars_in(frame_of(scene, truth));

  EXPECT_GE(found.size(), truth.size());
  EXPECT_LE(found.size(), truth.size() + 4);  // noise yields two on average in frames of this size
  double squares = 0;
  for (const SkyStar& t : truth) {
    const Star* s = nearest(found, t.x, t.y, 1);
    ASSERT_NE(s, nullptr) << t.x << ", " << t.y;
    const hw_sim::StarLimits limits = hw_sim::star_limits(scene, t);
    squares += std::pow((s->x - t.x) / limits.x_px, 2) + std::pow((s->y - t.y) / limits.y_px, 2);
    EXPECT_NEAR(s->flux, t.flux_e, 0.2 * t.flux_e);
    EXPECT_NEAR(s->snr, 40, 18);  // the wings of so many stars count as noise
    EXPECT_NEAR(s->fwhm_px, std::hypot(GetParam(), 0.68), 0.3 * GetParam());  // the pixel widens the star
  }
  EXPECT_LT(std::sqrt(squares / (2.0 * static_cast<double>(truth.size()))),
            1.45);  // an RMS over 70 values scatters by 9 %
}

INSTANTIATE_TEST_SUITE_P(Fwhm, StarsOfEveryWidth, testing::Values(1.4, 2.2, 3.5, 5.0));

TEST(StarFinder, PutsPixelZeroAtTheCentreOfTheFirstPixel) {
  SkyScene scene = small_scene();
  std::vector<SkyStar> truth = lattice(scene, 100);
  truth.push_back({3.0, 5.0, hw_sim::flux_for_snr(scene, 3, 5, 300)});

  const std::vector<Star> found = stars_in(frame_of(scene, truth));

  const Star* s = nearest(found, 3, 5, 1);
  ASSERT_NE(s, nullptr);
  EXPECT_NEAR(s->x, 3.0, 0.05);
  EXPECT_NEAR(s->y, 5.0, 0.05);
}

TEST(StarFinder, TakesNeitherHotPixelsNorParticleTracksForStars) {
  SkyScene scene = small_scene(2.5, 5);
  const std::vector<SkyStar> truth = lattice(scene, 30);
  scene.hot_pixels = 200;
  scene.cosmic_rays = 10;

  FrameFindings findings;
  const std::vector<Star> found = stars_in(frame_of(scene, truth), findings);

  const auto real = std::count_if(found.begin(), found.end(), [&](const Star& s) {
    return std::any_of(truth.begin(), truth.end(),
                       [&](const SkyStar& t) { return std::hypot(s.x - t.x, s.y - t.y) < 2; });
  });
  EXPECT_GE(real, static_cast<long>(truth.size()) - 2);
  EXPECT_LE(static_cast<long>(found.size()) - real, 3);
  EXPECT_GT(findings.spikes, 150);
}

TEST(StarFinder, SeparatesTwoStarsThatTouch) {
  SkyScene scene = small_scene(3, 8);
  std::vector<SkyStar> truth = lattice(scene, 60, 70.3);
  truth.push_back({60, 55, hw_sim::flux_for_snr(scene, 60, 55, 80)});
  truth.push_back({64, 55, hw_sim::flux_for_snr(scene, 64, 55, 40)});

  const std::vector<Star> found = stars_in(frame_of(scene, truth));

  const Star* bright = nearest(found, 60, 55, 0.5);
  const Star* faint = nearest(found, 64, 55, 0.7);
  ASSERT_NE(bright, nullptr);
  ASSERT_NE(faint, nullptr);
  EXPECT_NE(bright, faint);
}

TEST(StarFinder, FindsAFaintStarThatABrightOneOutshines) {
  SkyScene scene = small_scene(4, 18);
  std::vector<SkyStar> truth = lattice(scene, 120, 70.3);
  truth.push_back({60, 55, hw_sim::flux_for_snr(scene, 60, 55, 120)});
  truth.push_back({63.2, 55.5, hw_sim::flux_for_snr(scene, 63.2, 55.5, 25)});

  const std::vector<Star> found = stars_in(frame_of(scene, truth));

  const Star* bright = nearest(found, 60, 55, 0.5);
  const Star* faint = nearest(found, 63.2, 55.5, 1);
  ASSERT_NE(bright, nullptr);
  ASSERT_NE(faint, nullptr);
  EXPECT_NE(bright, faint);
}

TEST(StarFinder, FindsBothOfTwoEqualStarsThatLookLikeOneWithoutAMiddle) {
  SkyScene scene = small_scene(4, 19);
  std::vector<SkyStar> truth = lattice(scene, 60, 70.3);
  truth.push_back({60, 55, hw_sim::flux_for_snr(scene, 60, 55, 45)});
  truth.push_back({65.1, 55.4, hw_sim::flux_for_snr(scene, 65.1, 55.4, 44)});

  const std::vector<Star> found = stars_in(frame_of(scene, truth));

  EXPECT_NE(nearest(found, 60, 55, 0.7), nullptr);
  EXPECT_NE(nearest(found, 65.1, 55.4, 0.7), nullptr);
}

TEST(StarFinder, TakesASkyOfOnlyAFewValuesForNoStars) {
  SkyScene scene = small_scene(1.6, 20);
  scene.background_e = 20;
  scene.read_noise_e = 3;
  scene.adu_step = 5.5;  // about as large as the noise
  scene.gradient = 0.3;

  const std::vector<Star> found = stars_in(frame_of(scene, lattice(scene, 60, 60.3)));

  EXPECT_LE(found.size(), lattice(scene, 60, 60.3).size() + 3);
}

TEST(StarFinder, PlacesASaturatedStarByItsFlanks) {
  SkyScene scene = small_scene(3, 9);
  scene.saturation_adu = 4000;
  std::vector<SkyStar> truth = lattice(scene, 50, 70.3);
  truth.push_back({150.3, 120.7, 300000});

  FrameFindings findings;
  const std::vector<Star> found = stars_in(frame_of(scene, truth), findings);

  EXPECT_GT(findings.saturated, 5);
  const Star* s = nearest(found, 150.3, 120.7, 0.5);
  ASSERT_NE(s, nullptr);
}

/// Number of true stars without a found star within a pixel.
std::ptrdiff_t count_lost(const std::vector<Star>& found, const std::vector<SkyStar>& truth) {
  return std::count_if(truth.begin(), truth.end(),
                       [&](const SkyStar& t) { return nearest(found, t.x, t.y, 1) == nullptr; });
}

constexpr int false_most = 3;  ///< from noise, in frames of this size

/// Number of found stars that are not in the truth.
std::ptrdiff_t count_false(const std::vector<Star>& found, const std::vector<SkyStar>& truth) {
  return std::count_if(found.begin(), found.end(), [&](const Star& s) {
    return std::none_of(truth.begin(), truth.end(),
                        [&](const SkyStar& t) { return std::hypot(t.x - s.x, t.y - s.y) <= 1; });
  });
}

class StarsFarOverSaturation : public testing::TestWithParam<double> {};

TEST_P(StarsFarOverSaturation, AreFoundWhereTheyAreAndNothingBesideThem) {
  for (const double beta : {0.0, 2.5}) {
    SkyScene scene = small_scene(GetParam(), 92);
    scene.moffat_beta = beta;
    std::vector<SkyStar> truth = lattice(scene, 60, 57.9);
    const std::size_t others = truth.size();
    for (const double flux : {1e5, 3e5, 1e6, 3e6})
      truth.push_back({49.6 + 50.3 * double(truth.size() - others), 118.3, flux});
    Frame frame = frame_of(scene, truth);
    saturate(frame, 4095);

    const std::vector<Star> found = stars_in(frame);

    for (std::size_t i = others; i < truth.size(); ++i) {
      const Star* s = nearest(found, truth[i].x, truth[i].y, 0.2);
      ASSERT_NE(s, nullptr) << truth[i].flux_e << ", beta " << beta;
      EXPECT_NEAR(std::log(s->flux / truth[i].flux_e), 0, std::log(2)) << beta;
    }
    EXPECT_EQ(count_lost(found, truth), 0) << beta;
    EXPECT_LE(count_false(found, truth), false_most) << beta;
  }
}

INSTANTIATE_TEST_SUITE_P(Fwhm, StarsFarOverSaturation, testing::Values(1.5, 2.2, 3.5));

TEST(StarFinder, FindsStarsWhosePlateauIsUneven) {
  SkyScene scene = small_scene(2.6, 93);
  std::vector<SkyStar> truth = lattice(scene, 60, 57.9);
  truth.push_back({120.3, 118.6, 3e5});
  truth.push_back({200.3, 118.6, 3e6});
  Frame frame = frame_of(scene, truth);
  saturate(frame, 4095);
  // The artefacts that JPEG leaves in a saturated core.
  for (int y = 0; y < scene.height; ++y) {
    for (int x = 0; x < scene.width; ++x) {
      float& v = frame.pixels.at(x, y);
      if (v >= 4095) v -= static_cast<float>((7 * x + 5 * y) % 9 == 0 ? 250 : (3 * x + 11 * y) % 5 / 3 * 60);
    }
  }
  const std::vector<Star> found = stars_in(frame);

  EXPECT_NE(nearest(found, 120.3, 118.6, 0.2), nullptr);
  EXPECT_NE(nearest(found, 200.3, 118.6, 0.2), nullptr);
  EXPECT_EQ(count_lost(found, truth), 0);
  EXPECT_LE(count_false(found, truth), false_most);
}

/// @param light  (along, across) in ADU, added around one saturated star among other stars
template <class Light>
void expect_only_stars(std::uint64_t seed, double angle, Light&& light) {
  SkyScene scene = small_scene(2.2, seed);
  std::vector<SkyStar> truth = lattice(scene, 60, 57.9);
  truth.push_back({163.3, 118.6, 3e6});
  Frame frame = frame_of(scene, truth);
  add_light(frame, 163.3, 118.6, angle, light);
  saturate(frame, 4095);

  const std::vector<Star> found = stars_in(frame);

  EXPECT_EQ(count_lost(found, truth), 0);
  EXPECT_LE(count_false(found, truth), false_most);
}

TEST(StarFinder, TakesTheHaloOfASaturatedStarForNoStars) {
  expect_only_stars(94, 0, [](double dx, double dy) {
    const double r = std::hypot(dx, dy);
    return 1e4 / std::pow(1 + r * r / 4, 1.25);
  });
}

TEST(StarFinder, TakesTheRaysOfASaturatedStarForNoStars) {
  const auto ray = [](double along, double across) {
    return 2500 / (1 + along * along / 16) * std::exp(-across * across / 1.5);
  };
  expect_only_stars(99, 0.3, [&](double dx, double dy) { return ray(dx, dy) + ray(dy, dx); });
}

TEST(StarFinder, FindsStarsUnderABrightSkyWhereOnePixelIsDark) {
  for (const float low : {0.0F, -32768.0F}) {
    SkyScene scene = small_scene(2.2, 95);
    scene.background_e = 3300;
    std::vector<SkyStar> truth = lattice(scene, 20, 57.9);
    truth.push_back({163.3, 118.6, 1e5});
    Frame frame = frame_of(scene, truth);
    saturate(frame, 4095);
    frame.pixels.at(7, 200) = low;

    const std::vector<Star> found = stars_in(frame);

    EXPECT_EQ(count_lost(found, truth), 0) << low;
    EXPECT_LE(count_false(found, truth), false_most) << low;
  }
}

/// A planet, the Moon or a lamp has flanks, but not those of a star.
TEST(StarFinder, TakesAGlowingDiscForNoStar) {
  for (const double radius : {12.0, 25.0, 40.0}) {
    SkyScene scene = small_scene(2.2, 96);
    const std::vector<SkyStar> truth = lattice(scene, 50, 57.9);
    Frame frame = frame_of(scene, truth);
    add_light(frame, 160.3, 120.6, 0, [&](double dx, double dy) {
      const double r = std::hypot(dx, dy);
      return r < radius ? 6000 : 300 * std::exp(-(r - radius) / 8);
    });
    saturate(frame, 4095);

    const std::vector<Star> found = stars_in(frame);

    EXPECT_TRUE(std::none_of(found.begin(), found.end(), [](const Star& s) { return s.flux > 1e6; }))
        << radius;
  }
}

/// A lens that is sharper than its pixels: most of a star's light is in one of them.
TEST(StarFinder, FindsStarsSharperThanThePixelsOfAFinder) {
  for (const double fwhm : {0.75, 0.9, 1.1}) {
    const hw_sim::LensScene scene = finder_scene(fwhm, 201);
    const std::vector<SkyStar> truth = lattice(scene, 30, 150);

    const std::vector<Star> found = stars_in(frame_of(scene, truth));

    // At some places in a pixel they look like a warm one.
    EXPECT_LE(count_lost(found, truth), static_cast<long>(truth.size()) / (fwhm < 0.9 ? 4 : 8)) << fwhm;
    EXPECT_LE(count_false(found, truth), false_most) << fwhm;
  }
}

/// Bright stars of a lens with coma have tails, and are saturated.
TEST(StarFinder, KeepsBrightStarsWithTails) {
  hw_sim::LensScene scene = finder_scene(1.9, 202);
  scene.lens.coma_px = 7;
  scene.lens.tilt_px = 2;
  scene.lens.wider = 0.8;
  const std::vector<SkyStar> truth = lattice(scene, 30, 3000);

  const std::vector<Star> found = stars_in(frame_of(scene, truth));

  for (const SkyStar& t : truth) EXPECT_NE(nearest(found, t.x, t.y, 4), nullptr) << t.x << ", " << t.y;
  EXPECT_LE(found.size(), 2 * truth.size());  // parts of tails look like stars
}

/// Tails of coma and halos are the same beside all bright stars; a companion is one star's alone.
TEST(StarFinder, TakesWhatBrightStarsHaveInCommonForNoCompanions) {
  hw_sim::LensScene scene = finder_scene(2.6, 207);
  scene.width = 640, scene.height = 480;
  scene.lens.coma_px = 14;
  scene.lens.wider = 0.7;
  scene.lens.halo_share = 0.25;
  std::vector<SkyStar> truth = lattice(scene, 60, 900);
  const SkyStar& bright = truth.at(truth.size() / 2);
  const SkyStar companion{bright.x - 6, bright.y + 5, bright.flux_e / 4};
  truth.push_back(companion);

  const std::vector<Star> found = stars_in(frame_of(scene, truth));

  for (const SkyStar& t : truth) EXPECT_NE(nearest(found, t.x, t.y, 4), nullptr) << t.x << ", " << t.y;
  EXPECT_NE(nearest(found, companion.x, companion.y, 1.5), nullptr);
  EXPECT_LE(found.size(), truth.size() + truth.size() / 2);
}

TEST(StarFinder, SaysWhichStarsAreSaturatedOrBlended) {
  SkyScene scene = small_scene(2.6, 203);
  scene.saturation_adu = 4000;
  std::vector<SkyStar> truth = lattice(scene, 60, 70.3);
  truth.push_back({150.3, 120.7, 300000});
  truth.push_back({60, 55, hw_sim::flux_for_snr(scene, 60, 55, 80)});
  truth.push_back({64, 55, hw_sim::flux_for_snr(scene, 64, 55, 60)});

  const std::vector<Star> found = stars_in(frame_of(scene, truth));

  ASSERT_NE(nearest(found, 150.3, 120.7, 0.5), nullptr);
  EXPECT_TRUE((nearest(found, 150.3, 120.7, 0.5)->flags & star_saturated) != 0);
  ASSERT_NE(nearest(found, 60, 55, 0.7), nullptr);
  EXPECT_TRUE((nearest(found, 60, 55, 0.7)->flags & star_blended) != 0);
  ASSERT_NE(nearest(found, truth[2].x, truth[2].y, 0.7), nullptr);
  EXPECT_EQ(nearest(found, truth[2].x, truth[2].y, 0.7)->flags, 0);
}

/// A warm sensor without a dark frame.
TEST(StarFinder, TakesWarmPixelsForNoStars) {
  hw_sim::LensScene scene = finder_scene(1.4, 204);
  scene.detector.warm_share = 0.02;
  scene.detector.warm_e = 80;
  scene.detector.column_pattern_e = 5;
  scene.detector.row_pattern_e = 4;
  const std::vector<SkyStar> truth = lattice(scene, 30, 300);

  const std::vector<Star> found = stars_in(frame_of(scene, truth));

  EXPECT_LE(count_lost(found, truth), 1);
  EXPECT_LE(count_false(found, truth), 6);
}

/// What JPEG leaves of faint noise is flat in most blocks and loud in some.
TEST(StarFinder, TakesTheBlocksOfAPhotographForNoStars) {
  hw_sim::LensScene scene = finder_scene(2.6, 205);
  scene.detector.gain_e_per_adu = 11;
  scene.detector.jpeg_quality = 82;
  scene.lens.vignette = 0.4;
  const std::vector<SkyStar> truth = lattice(scene, 40, 400);

  const std::vector<Star> found = stars_in(frame_of(scene, truth));

  EXPECT_LE(count_lost(found, truth), 1);
  EXPECT_LE(count_false(found, truth), 20);
}

TEST(StarFinder, TakesTheWidthThatTheOperatorGives) {
  const hw_sim::LensScene scene = finder_scene(3, 206);
  FrameFindings findings;
  const CleanFrame clean = clean_frame(frame_of(scene, {{100, 100, 3e4}}), findings, {.fwhm_px = 3});

  EXPECT_EQ(findings.fwhm_px, 3);
  EXPECT_TRUE(findings.notes.empty());
  EXPECT_NE(nearest(find_stars(clean, {}).stars, 100, 100, 0.5), nullptr);
}

TEST(StarFinder, FindsNothingInNoise) {
  std::size_t found = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed)
    found += stars_in(frame_of(small_scene(2.2, seed), {})).size();
  EXPECT_LE(found, 2U);
}

TEST(StarFinder, FindsNothingWhereThereIsNothing) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinite = std::numeric_limits<float>::infinity();
  for (const auto& [width, height] : {std::pair{1, 1}, {2, 1}, {1, 70}, {3, 3}, {17, 16}, {200, 100}}) {
    for (const float value : {0.0F, 65535.0F, -7.5F, 1e30F, nan, infinite}) {
      Frame frame;
      frame.pixels = Plane(width, height, value);
      FrameFindings findings;
      EXPECT_TRUE(stars_in(frame, findings).empty()) << width << " x " << height << " of " << value;
      EXPECT_FALSE(findings.notes.empty());
    }
  }
}

TEST(StarFinder, WorksAroundPixelsWithoutAValue) {
  SkyScene scene = small_scene(2.5, 4);
  const std::vector<SkyStar> truth = lattice(scene, 60);
  Frame frame = frame_of(scene, truth);
  for (int y = 100; y < 200; ++y) {
    for (int x = 0; x < 150; ++x) frame.pixels.at(x, y) = std::numeric_limits<float>::quiet_NaN();
  }

  FrameFindings findings;
  const std::vector<Star> found = stars_in(frame, findings);

  EXPECT_EQ(findings.invalid, 15000);
  for (const SkyStar& t : truth) {
    const bool visible = t.x > 155 || t.y < 95 || t.y > 205;
    const bool hidden = t.x < 145 && t.y > 105 && t.y < 195;
    if (visible) {
      EXPECT_NE(nearest(found, t.x, t.y, 0.5), nullptr) << t.x << ", " << t.y;
    }
    if (hidden) {
      EXPECT_EQ(nearest(found, t.x, t.y, 2), nullptr) << t.x << ", " << t.y;
    }
  }
}

TEST(StarFinder, IsNotMisledByTheKnotsOfAGalaxyThatOutnumberTheStars) {
  SkyScene scene = small_scene(2.5, 22);
  scene.width = scene.height = 400;
  const std::vector<SkyStar> truth = lattice(scene, 500, 115.3);
  Frame frame = frame_of(scene, truth);
  for (int k = 0; k < 90; ++k) {
    const double angle = 2.4 * k;
    const double kx = 200 + 17 * std::sqrt(k) * std::cos(angle);
    const double ky = 200 + 17 * std::sqrt(k) * std::sin(angle);
    const double sigma = 2.2 + 0.15 * (k % 5);
    for (int y = 0; y < scene.height; ++y) {
      for (int x = 0; x < scene.width; ++x)
        frame.pixels.at(x, y) +=
            static_cast<float>((300 + 20 * (k % 7)) *
                               std::exp(-((x - kx) * (x - kx) + (y - ky) * (y - ky)) / (2 * sigma * sigma)));
    }
  }

  const std::vector<Star> found = stars_in(frame);

  for (const SkyStar& t : truth) {
    const Star* s = nearest(found, t.x, t.y, 0.5);
    ASSERT_NE(s, nullptr) << t.x << ", " << t.y;
    EXPECT_NEAR(s->fwhm_px, 2.6, 0.5);
  }
}

TEST(StarFinder, TakesColumnPatternsForNoStars) {
  SkyScene scene = small_scene(2.2, 21);
  const std::vector<SkyStar> truth = lattice(scene, 25);
  scene.column_pattern_adu = 25;  // more than the noise of a pixel

  const std::vector<Star> found = stars_in(frame_of(scene, truth));

  EXPECT_LE(found.size(), truth.size() + 3);
  EXPECT_GE(found.size(), truth.size() - 3);
}

TEST(StarFinder, MeasuresTheNoiseWithoutAPatternOfColumns) {
  SkyScene scene = small_scene(2.2, 23);
  scene.width = 640, scene.height = 480;
  const std::vector<SkyStar> truth = lattice(scene, 7);
  FrameFindings plain;
  (void)stars_in(frame_of(scene, truth), plain);
  scene.column_pattern_adu = 1.2 * plain.noise;
  FrameFindings findings;

  const std::vector<Star> found = stars_in(frame_of(scene, truth), findings);

  EXPECT_NEAR(findings.noise, plain.noise, 0.05 * plain.noise);
  const auto seen = std::count_if(truth.begin(), truth.end(),
                                  [&](const SkyStar& t) { return nearest(found, t.x, t.y, 1.5) != nullptr; });
  EXPECT_GE(static_cast<double>(seen), 0.9 * static_cast<double>(truth.size()));
}

TEST(StarFinder, KnowsTheNoiseOfASkyThatIsCutOffAtItsLevel) {
  SkyScene scene = small_scene(2.2, 24);
  scene.width = 640, scene.height = 480;
  Frame frame = frame_of(scene, lattice(scene, 100));
  FrameFindings whole;
  (void)stars_in(frame, whole);
  const float level = static_cast<float>(whole.background);
  for (float& v : frame.pixels.cells()) v = std::max(v - level, 0.0F);
  FrameFindings findings;

  const std::vector<Star> found = stars_in(frame, findings);

  EXPECT_GT(findings.noise, 0.6 * whole.noise);
  EXPECT_LT(findings.noise, 1.25 * whole.noise);
  EXPECT_NEAR(findings.fwhm_px, whole.fwhm_px, 0.15);
  EXPECT_LT(found.size(), 1200U);  // skewed noise; several thousand if it is taken for a tenth
}

TEST(StarFinder, MeasuresStarsAboveAHorizon) {
  SkyScene scene = small_scene(3.2, 25);
  scene.width = 640, scene.height = 480;
  scene.background_e = 1500;
  Frame frame = frame_of(scene, lattice(scene, 100));
  FrameFindings whole;
  (void)stars_in(frame, whole);
  for (int y = 400; y < scene.height; ++y) {
    for (int x = 0; x < scene.width; ++x)
      frame.pixels.at(x, y) = 350 + 6 * static_cast<float>((7 * x + 5 * y) % 11);
  }
  FrameFindings findings;

  (void)stars_in(frame, findings);

  EXPECT_NEAR(findings.fwhm_px, whole.fwhm_px, 0.1);
  EXPECT_THAT(findings.notes, testing::Contains(testing::HasSubstr("is not searched")));
}

TEST(StarFinder, SearchesBesideDeadRowsAndColumns) {
  SkyScene scene = small_scene(2.2, 26);
  Frame frame = frame_of(scene, lattice(scene, 50));
  for (int x = 0; x < scene.width; ++x) frame.pixels.at(x, 100) = frame.pixels.at(x, 101) = 0;
  for (int y = 0; y < scene.height; ++y) frame.pixels.at(200, y) = frame.pixels.at(201, y) = 0;
  FrameFindings findings;

  (void)stars_in(frame, findings);

  EXPECT_THAT(findings.notes, testing::Not(testing::Contains(testing::HasSubstr("is not searched"))));
}

}  // namespace
}  // namespace srfs::image
