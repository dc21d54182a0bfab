#pragma once

#include <algorithm>

#include "hw_sim/sky_frame.hpp"
#include "image/frame.hpp"

namespace srfs::image {

/// A frame of a simulated sky with its truth beside it.
[[nodiscard]] inline Frame frame_of(const hw_sim::SkyScene& scene, const std::vector<hw_sim::SkyStar>& stars,
                                    const std::vector<hw_sim::SkyStreak>& streaks = {}) {
  Frame frame;
  frame.pixels = Plane(scene.width, scene.height);
  const std::vector<float> adu = hw_sim::render_sky(scene, stars, streaks);
  std::copy(adu.begin(), adu.end(), frame.pixels.cells().begin());
  frame.step = static_cast<float>(scene.adu_step);
  return frame;
}

/// Small, so that a test takes milliseconds.
[[nodiscard]] inline hw_sim::SkyScene small_scene(double fwhm_px = 2.2, std::uint64_t seed = 1) {
  hw_sim::SkyScene scene;
  scene.width = 320;
  scene.height = 240;
  scene.fwhm_px = fwhm_px;
  scene.seed = seed;
  return scene;
}

/// Stars on a lattice that nothing else in the pixel grid has, far from each other.
[[nodiscard]] inline std::vector<hw_sim::SkyStar> lattice(const hw_sim::SkyScene& scene, double snr,
                                                          double spacing_px = 40.37) {
  std::vector<hw_sim::SkyStar> stars;
  for (double y = 20.1; y < scene.height - 18; y += spacing_px) {
    for (double x = 20.3; x < scene.width - 18; x += spacing_px)
      stars.push_back({x, y, hw_sim::flux_for_snr(scene, x, y, snr)});
  }
  return stars;
}

}  // namespace srfs::image
