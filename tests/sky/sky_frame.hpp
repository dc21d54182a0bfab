// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "hw_sim/sky.hpp"

/// Frames of a star field as a camera in orbit sees them, from the physics of the detector, with known truth.
/// Pure; the same scene gives the same frame on every machine of one floating-point format.
namespace srfs::hw_sim {

/// Optics, sky and detector. Electrons are `_e`, what the file holds is `_adu`.
struct SkyScene {
  int width = 640;
  int height = 480;
  double fwhm_px = 2.2;    ///< of the optics, before the pixels integrate
  double moffat_beta = 0;  ///< wings; 0: a Gaussian
  double ellipticity = 0;  ///< 1 - minor / major axis
  double major_axis_rad = 0;
  double background_e = 200;  ///< at the centre
  double gradient = 0;        ///< of the background from left to right and from top to bottom, relative
  double curvature = 0;       ///< how much darker the corners are, relative
  double read_noise_e = 6;
  double gain_e_per_adu = 1;
  double bias_adu = 300;
  double prnu = 0.005;            ///< response of the pixels, rms
  double column_pattern_adu = 0;  ///< offset of the columns, rms
  int hot_pixels = 0;
  int cosmic_rays = 0;
  double saturation_adu = 65535;
  double adu_step = 1;  ///< 16: 12 bits in 16
  std::uint64_t seed = 1;
  /// Of what is the same in all frames of one detector: response, columns, hot pixels. 0: as seed.
  std::uint64_t pattern_seed = 0;
};

/// What the best estimator could reach for a star alone: Fisher information of position and flux.
struct StarLimits {
  double snr;  ///< of the flux, shot noise of the star included
  double x_px;
  double y_px;
};

/// @return the frame in ADU, row by row
[[nodiscard]] std::vector<float> render_sky(const SkyScene& scene, const std::vector<SkyStar>& stars,
                                            const std::vector<SkyStreak>& streaks);

[[nodiscard]] StarLimits star_limits(const SkyScene& scene, const SkyStar& star);

/// Of a matched filter for the whole streak, background-limited.
[[nodiscard]] double streak_snr(const SkyScene& scene, const SkyStreak& streak);

/// Flux of a star with this background-limited SNR of a matched filter at (x, y).
[[nodiscard]] double flux_for_snr(const SkyScene& scene, double x, double y, double snr);

}  // namespace srfs::hw_sim
