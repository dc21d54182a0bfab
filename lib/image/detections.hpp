// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "image/psf.hpp"

namespace srfs::image {

/// What is unusual in a star, as bits.
enum StarFlag : std::uint8_t {
  star_saturated = 1,  ///< place and flux come from what is around its core
  star_blended = 2,    ///< touched by a star of similar brightness
  star_odd = 4,        ///< not of the frame's shape: coma, the edge of the field, more than one source
};

struct Star {
  double x;
  double y;
  double flux;             ///< ADU above the sky
  double snr;              ///< flux over its noise from the sky alone
  double fwhm_px;          ///< as the pixels show it
  std::uint8_t flags = 0;  ///< StarFlag
};

/// V_T, one standard deviation.
struct Magnitude {
  double value;
  double sigma;
};

/// A place on the sky, J2000, with its covariance.
struct SkyPlace {
  double ra_deg;
  double dec_deg;
  double sigma_east_arcsec;
  double sigma_north_arcsec;
  double correlation;
};

/// Where an object was in the middle of an exposure.
struct SkyPoint {
  SkyPlace place;
  std::optional<double> begin_s;  ///< of the exposure, seconds since 1970
  std::optional<double> exposure_s;
  std::optional<Magnitude> magnitude;
};

/// Where an object was during an exposure.
struct SkyTrail {
  SkyPlace first;
  SkyPlace last;
  SkyPlace middle;
  bool is_directed = false;  ///< it was at `first` at the begin; else perhaps at `last`
  std::optional<double> begin_s;
  std::optional<double> exposure_s;
  std::optional<Magnitude> magnitude;
};

/// Ends of the middle line of a moving object's light.
struct Streak {
  double x1;
  double y1;
  double x2;
  double y2;
  double snr;       ///< of all its light over the noise of the sky in a matched filter
  double flux;      ///< ADU above the sky
  double width_px;  ///< FWHM across
  /// How much its light changes along it, beside its mean; 0: evenly lit, or not measured.
  double raggedness = 0;
  std::optional<SkyTrail> sky = std::nullopt;

  [[nodiscard]] double length_px() const { return std::hypot(x2 - x1, y2 - y1); }
};

/// Of a place from a streak's middle line.
[[nodiscard]] inline double distance_px(const Streak& s, double x, double y) {
  const double length = std::max(1e-6, s.length_px());
  const double ux = (s.x2 - s.x1) / length;
  const double uy = (s.y2 - s.y1) / length;
  const double along = std::clamp((x - s.x1) * ux + (y - s.y1) * uy, 0.0, length);
  return std::hypot(x - s.x1 - along * ux, y - s.y1 - along * uy);
}

/// How the lens maps directions to pixels (CameraModel).
struct Lens {
  double focal_px;
  double axis_x;  ///< from the frame's middle
  double axis_y;
  double k1;  ///< k1 + k2: displacement at the corners over their distance
  double k2;
};

/// Where a frame looks and how it lies.
struct Attitude {
  double ra_deg;  ///< of the frame's middle, J2000
  double dec_deg;
  double roll_deg;         ///< direction of the frame's upper edge, from north over east
  double scale_arcsec_px;  ///< in the middle
  bool mirrored;           ///< east is to the right where north is up
  int stars;               ///< that the catalogue explains
  double rms_arcsec;       ///< of those, per axis
  double field_deg;        ///< width of the frame
  double rms_px;
  Lens lens;
};

/// A piece of a frame, or the frame made small, as a product of its own.
struct Cutout {
  int x, y;                                        ///< its first pixel in the frame
  std::variant<Grid<std::uint8_t>, Plane> pixels;  ///< for people to look at, or ADU
};

/// What one frame holds, by whatever method was asked for.
struct FrameFindings {
  std::vector<Star> stars;      ///< brightest first
  std::vector<Streak> streaks;  ///< most significant first
  std::optional<Attitude> attitude;
  std::optional<Cutout> cutout;
  double background = 0;  ///< median, ADU
  double noise = 0;       ///< median of the pixels' noise, ADU
  double fwhm_px = 0;     ///< measured in the frame; 0: too few stars to tell
  int spikes = 0;         ///< pixels taken for hot ones or cosmic rays
  int saturated = 0;      ///< pixels
  int invalid = 0;        ///< pixels without a value
  std::vector<std::string> notes;
};

}  // namespace srfs::image
