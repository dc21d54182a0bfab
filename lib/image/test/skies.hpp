// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>

#include "image/frame.hpp"
#include "tests/sky/lens_frame.hpp"
#include "tests/sky/sky_frame.hpp"

namespace srfs::image {

/// A frame of a simulated sky with the given stars and streaks.
[[nodiscard]] inline Frame frame_of(const hw_sim::SkyScene& scene, const std::vector<hw_sim::SkyStar>& stars,
                                    const std::vector<hw_sim::SkyStreak>& streaks = {}) {
  Frame frame;
  frame.pixels = Plane(scene.width, scene.height);
  const std::vector<float> adu = hw_sim::render_sky(scene, stars, streaks);
  std::copy(adu.begin(), adu.end(), frame.pixels.cells().begin());
  frame.step = static_cast<float>(scene.adu_step);
  return frame;
}

/// A frame of a small real camera with the given stars and trails.
[[nodiscard]] inline Frame frame_of(const hw_sim::LensScene& scene, const std::vector<hw_sim::SkyStar>& stars,
                                    const std::vector<hw_sim::LensTrail>& trails = {}) {
  Frame frame;
  frame.pixels = Plane(scene.width, scene.height);
  const std::vector<float> adu = hw_sim::render_lens(scene, stars, trails);
  std::copy(adu.begin(), adu.end(), frame.pixels.cells().begin());
  frame.step = 1;
  return frame;
}

/// A finder camera of 8 bits, noise of two steps.
[[nodiscard]] inline hw_sim::LensScene finder_scene(double fwhm_px, std::uint64_t seed) {
  hw_sim::LensScene scene;
  scene.width = 320;
  scene.height = 240;
  scene.lens.fwhm_px = fwhm_px;
  scene.detector = {
      .background_e = 60, .read_noise_e = 6, .gain_e_per_adu = 5, .bias_adu = 6, .saturation_adu = 255};
  scene.seed = seed;
  return scene;
}

/// Stars far from each other with SNR that grows from star to star.
[[nodiscard]] inline std::vector<hw_sim::SkyStar> lattice(const hw_sim::LensScene& scene, double snr_least,
                                                          double snr_most, double spacing_px = 48.37) {
  std::vector<hw_sim::SkyStar> stars;
  const double unit = hw_sim::flux_for_snr(scene, 1);
  for (double y = 24.1; y < scene.height - 20; y += spacing_px) {
    for (double x = 24.3; x < scene.width - 20; x += spacing_px) {
      const double share = std::fmod(0.618034 * static_cast<double>(stars.size()), 1);
      stars.push_back({x, y, unit * snr_least * std::pow(snr_most / snr_least, share)});
    }
  }
  return stars;
}

/// A scene small enough for a test to take only milliseconds.
[[nodiscard]] inline hw_sim::SkyScene small_scene(double fwhm_px = 2.2, std::uint64_t seed = 1) {
  hw_sim::SkyScene scene;
  scene.width = 320;
  scene.height = 240;
  scene.fwhm_px = fwhm_px;
  scene.seed = seed;
  return scene;
}

/// Stars far from each other, on a lattice that does not match the pixel grid.
[[nodiscard]] inline std::vector<hw_sim::SkyStar> lattice(const hw_sim::SkyScene& scene, double snr,
                                                          double spacing_px = 40.37) {
  std::vector<hw_sim::SkyStar> stars;
  for (double y = 20.1; y < scene.height - 18; y += spacing_px) {
    for (double x = 20.3; x < scene.width - 18; x += spacing_px)
      stars.push_back({x, y, hw_sim::flux_for_snr(scene, x, y, snr)});
  }
  return stars;
}

/// Adds light(along, across), in ADU, around a point, with the axis in the given direction.
template <class Light>
void add_light(Frame& frame, double x0, double y0, double angle, Light&& light) {
  const double ux = std::cos(angle);
  const double uy = std::sin(angle);
  for (int y = 0; y < frame.pixels.height(); ++y) {
    for (int x = 0; x < frame.pixels.width(); ++x)
      frame.pixels.at(x, y) +=
          static_cast<float>(light((x - x0) * ux + (y - y0) * uy, (y - y0) * ux - (x - x0) * uy));
  }
}

inline void saturate(Frame& frame, float most_adu) {
  for (float& v : frame.pixels.cells()) v = std::min(v, most_adu);
}

}  // namespace srfs::image
