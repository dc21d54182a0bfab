// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "image/background.hpp"
#include "image/detections.hpp"

namespace srfs::image {

/// Why a pixel is not used, as bits.
enum PixelFlaw : std::uint8_t { flaw_invalid = 1, flaw_saturated = 2, flaw_spike = 4, flaw_no_sky = 8 };

/// A pixel sharper than the optics, with the light that was replaced, in noise.
struct Spike {
  int x;
  int y;
  float light;
};

/// A frame ready for detection: sky and fixed pattern taken away, in units of the local noise, single bright
/// pixels and particle tracks replaced.
struct CleanFrame {
  Plane signal;
  Grid<std::uint8_t> flaws;
  std::vector<Spike> spikes;  ///< each pixel once
  Surface noise_adu;
  Psf psf = Psf::round_gaussian(2.5);
  bool psf_measured = false;  ///< or given
  bool psf_unsure = false;    ///< of a lens sharper than its pixels: particles' tracks may have shown it
  double no_sky = 0;          ///< share of the frame with flaw_no_sky
};

/// Side of the squares that are judged to be sky or not.
inline constexpr int no_sky_cell_px = 32;

struct CleanOptions {
  double fwhm_px = 0;  ///< of the frame's stars, where the operator knows it; 0: measured
};

/// @param findings  gets the figures of the frame and notes on what is unusual in it
[[nodiscard]] CleanFrame clean_frame(const Frame& frame, FrameFindings& findings,
                                     const CleanOptions& options = {});

}  // namespace srfs::image
