// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "image/clean_frame.hpp"
#include "image/star_finder.hpp"
#include "image/tracklet_linker.hpp"

namespace srfs::image {

/// One frame through the matched filter, without its stars: what a faint object adds to.
struct FaintLight {
  Grid<std::int8_t> light;  ///< in units of the noise over faint_units; faint_hidden: not seen
  double fwhm_px = 0;
  double flux_of_noise = 0;  ///< ADU of a point as bright as the noise
};
inline constexpr float faint_units = 12;
inline constexpr std::int8_t faint_hidden = -128;

/// @param field  with its residual, as find_stars() gives it
/// @param known  of each of its stars: the catalogue has it; empty: not known
[[nodiscard]] FaintLight faint_light(const CleanFrame& clean, const StarField& field,
                                     const std::vector<bool>& known);

struct FaintOptions {
  double snr_least = 8.5;  ///< of all frames together
  double speed_most = 40;  ///< px per frame
};

/// Objects too faint for one frame (synthetic tracking, shift and stack). Two points of different frames say
/// how an object may move; the light of all frames is summed along that motion and every one near by. What
/// stands on the sky or on the detector, or shines in few frames, is none. Pure. At most ten million pairs of
/// points are looked at; where there are more, every frame's faintest points are left out.
/// @param light  of each frame
/// @param times  of each frame, from the reference frame's
/// @param found  of the same frames: registrations, and what they show already: that is left out
/// @return most significant first; points where the light is, in frames that show some
[[nodiscard]] std::vector<Tracklet> find_faint(const std::vector<FaintLight>& light,
                                               const std::vector<double>& times,
                                               const SequenceFindings& found, const FaintOptions& options);

}  // namespace srfs::image
