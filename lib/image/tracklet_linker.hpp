// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "image/calibration.hpp"
#include "image/defect_map.hpp"
#include "image/detections.hpp"
#include "image/registration.hpp"

namespace srfs::image {

/// One frame of a sequence as far as linking needs it.
struct FrameDetections {
  std::vector<Star> stars;  ///< faint ones too, brightest first
  /// Of each star: the catalogue has it, whatever the other frames show; empty: not known.
  std::vector<bool> is_known_star;
  std::vector<Streak> streaks;
  int width = 0;
  int height = 0;
  double fwhm_px = 0;
  std::optional<double> time_s;
};

/// A moving object in one frame, in that frame's pixels.
struct TrackPoint {
  int frame;
  double x;
  double y;
  double snr;
  std::optional<Streak> streak;
  double flux = 0;
  double fwhm_px = 0;
  std::optional<SkyPoint> sky = std::nullopt;
};

/// A moving object over a sequence: evenly along a straight line.
struct Tracklet {
  std::vector<TrackPoint> points;
  double x0, y0;  ///< at the time of the reference frame, in its pixels
  double vx, vy;  ///< px per frame, or per second where all frames have their time
  double snr;     ///< of all points together
  double rms_px;  ///< of the points beside the line
};

struct FrameRegistration {
  bool registered = false;
  Registration registration;
};

/// What a sequence of frames holds together.
struct SequenceFindings {
  std::vector<Tracklet> tracklets;  ///< most significant first
  std::vector<std::vector<Streak>>
      streaks;  ///< of each frame, without those that stand still among the stars
  std::vector<FrameRegistration> registrations;  ///< of each frame, to the reference frame
  int reference = 0;                             ///< the reference frame
  bool timed = false;                            ///< velocities are per second
  std::vector<Defect> defects;                   ///< of the detector, strongest first
  std::optional<Master> master;                  ///< of the detector
  std::vector<std::string> notes;
};

struct LinkOptions {
  int hits_least = 5;      ///< in sequences of eight and more; five eighths of shorter ones, but three
  double snr_least = 8.5;  ///< of all points together
  double speed_most = 40;  ///< px per frame; four times that of what is seen as streaks
};

/// Registers the frames on each other by their stars, takes away what stands still on the sky or on the
/// detector, and links the rest along straight lines.
[[nodiscard]] SequenceFindings link_tracklets(const std::vector<FrameDetections>& frames,
                                              const LinkOptions& options);

}  // namespace srfs::image
