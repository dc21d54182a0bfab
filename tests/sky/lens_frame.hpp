// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "hw_sim/sky.hpp"

/// Frames as small real cameras make them: lenses whose shape changes over the field, detectors of 8 bits
/// without a dark, compressed files, trails that are no even lines. With known truth; pure.
namespace srfs::hw_sim {

struct Lens {
  double fwhm_px = 2;      ///< in the middle, before the pixels integrate
  double moffat_beta = 0;  ///< wings; 0: a Gaussian
  double wider = 0;        ///< how much wider stars are in the corner, relative
  double astigmatism = 0;  ///< how much longer than wide in the corner, relative; below 0: across the radius
  double coma_px = 0;      ///< length of the tail in the corner, away from the middle
  double tilt_px = 0;      ///< length of a tail to the right that all stars have: a lens that stands askew
  double drift_px = 0;     ///< length of the way that all stars move downwards during the exposure
  double halo_share = 0;   ///< of a star's light, scattered around it by glass and dust
  double halo_wider = 6;   ///< FWHM of that beside the star's
  double vignette = 0;     ///< how much darker the corner is, relative
};

struct Detector {
  double background_e = 50;
  double read_noise_e = 4;
  double gain_e_per_adu = 1;
  double bias_adu = 300;
  double saturation_adu = 65535;
  double gamma = 1;  ///< of the response, from the bias to saturation: pictures made for the eye have 2.2
  double column_pattern_e = 0;  ///< offsets of columns, rms
  double row_pattern_e = 0;
  double pixel_pattern_e = 0;  ///< offset of each pixel, rms
  double warm_share = 0;       ///< of the pixels: with an exponential dark current
  double warm_e = 0;           ///< mean of it
  int cosmic_rays = 0;
  int jpeg_quality = 0;  ///< of 8-bit frames, 1 to 100; 0: not compressed
};

struct LensScene {
  int width = 640;
  int height = 480;
  Lens lens;
  Detector detector;
  std::uint64_t seed = 1;
  std::uint64_t pattern_seed = 0;  ///< of what is the same in all frames of one detector. 0: as seed
};

/// A trail as satellites, aircraft and meteors draw them.
struct LensTrail {
  double x1, y1, x2, y2;
  double flux_e_px;      ///< along it, on average of the parts without gaps
  double fwhm_px = 2;    ///< across, before the pixels integrate
  double ragged = 0;     ///< relative rms of its brightness, over a few widths
  double wobble_px = 0;  ///< rms of its middle line beside the straight one
  double gaps = 0;       ///< share of the length that is dark
  double gap_px = 20;    ///< length of a gap and what follows it
};

/// @return the frame in ADU, row by row
[[nodiscard]] std::vector<float> render_lens(const LensScene& scene, const std::vector<SkyStar>& stars,
                                             const std::vector<LensTrail>& trails);

/// What a matched filter that knows its shape makes of each star alone, its shot noise included.
[[nodiscard]] std::vector<double> star_snrs(const LensScene& scene, const std::vector<SkyStar>& stars);
/// A star's flux for this SNR without its own shot noise, in the middle.
[[nodiscard]] double flux_for_snr(const LensScene& scene, double snr);
/// Variance of a pixel of dark sky in the middle, electrons, without the fixed pattern.
[[nodiscard]] double sky_variance(const LensScene& scene);

}  // namespace srfs::hw_sim
