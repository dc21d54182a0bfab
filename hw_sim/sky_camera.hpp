// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "base/time.hpp"
#include "hw_sim/sky.hpp"
#include "image/frame.hpp"

namespace srfs::sim {

/// Where the camera looks instead of where the simulated attitude control points it.
struct FixedPointing {
  double ra_deg = 0;
  double dec_deg = 0;
  double roll_deg = 0;  ///< of the upper edge, from north over east
  double drift_arcsec_s = 0;
};

/// Objects that cross the field.
struct DebrisSettings {
  double interval_s = 0;  ///< about so often, while frames are taken; 0: only on request
  double rate_deg_s = 1.5;
  double magnitude = 4;
};

/// A 12-bit sensor behind a lens of 50 mm aperture. The camera's axes are the body's: it looks along +Z,
/// x of the picture is +X, y is +Y.
struct SkyCameraSettings {
  int width = 1920;
  int height = 1080;
  int bits = 12;
  double field_deg = 16;  ///< along the width
  double fwhm_px = 2.2;
  double background_e_s = 400;        ///< of a pixel: the sky's
  double magnitude_zero_e_s = 1.0e7;  ///< what a star of magnitude 0 gives
  double read_noise_e = 6;
  double gain_e_per_adu = 4;  ///< at 0 dB
  double bias_adu = 64;
  double prnu = 0.005;     ///< response of the pixels, rms
  int hot_pixels = 200;    ///< 5 to 270 times as bright as the sky
  double warm_share = 0;   ///< of the pixels that have dark current
  double warm_e_s = 1000;  ///< theirs, on average
  std::uint64_t seed = 1;
  std::optional<FixedPointing> pointing;
  DebrisSettings debris;
  bool switched = false;  ///< it has power only while its load switch is on
};

/// Attitude of the camera during an exposure.
struct CameraPose {
  Eigen::Quaterniond attitude = Eigen::Quaterniond::Identity();  ///< body to J2000, at the begin
  Eigen::Vector3d rate_rad_s = Eigen::Vector3d::Zero();          ///< body frame
  [[nodiscard]] Eigen::Quaterniond after(double seconds) const;
};
[[nodiscard]] CameraPose pose_of(const FixedPointing& pointing, double seconds);

/// What is really on a frame.
struct SkyTruth {
  double ra_deg = 0;  ///< of the middle at the begin of the exposure
  double dec_deg = 0;
  double roll_deg = 0;
  double scale_arcsec_px = 0;              ///< in the middle
  std::vector<hw_sim::SkyStar> stars;      ///< brightest first; in the middle of their motion
  std::vector<hw_sim::SkyStreak> streaks;  ///< of debris
};

struct SkyPicture {
  image::Grid<std::uint16_t> pixels;
  SkyTruth truth;
};

/// Renders what the camera sees: the Tycho-2 stars to magnitude 8.5, drawn out by the motion of the camera,
/// and debris. Fast: the sensor's pattern and a table of noise are made once. Pure but for its state: the
/// same calls give the same frames.
class SkyCamera {
 public:
  /// @param between_pieces  called again and again while a frame is rendered, some 20 us of work apart
  explicit SkyCamera(const SkyCameraSettings& settings, std::function<void()> between_pieces = {});
  ~SkyCamera();
  SkyCamera(const SkyCamera&) = delete;
  SkyCamera& operator=(const SkyCamera&) = delete;

  /// @param begin_s  of the exposure, on any scale that does not go back
  [[nodiscard]] SkyPicture expose(const CameraPose& pose, double begin_s, double exposure_s, double gain_db);
  /// An object crosses the middle of the next frame.
  void pass_next() { pass_next_ = true; }
  /// A covered lens lets no light in: what is left is the detector's own.
  void set_covered(bool covered) { covered_ = covered; }

 private:
  struct Sky;
  /// On a great circle at a constant rate.
  struct Pass {
    Eigen::Vector3d direction;  ///< at the epoch
    Eigen::Vector3d axis;
    double epoch_s;
    double magnitude;
    [[nodiscard]] Eigen::Vector3d at(double t_s, double rate_rad_s) const;
  };
  [[nodiscard]] std::optional<Eigen::Vector2d> project(const Eigen::Quaterniond& attitude,
                                                       const Eigen::Vector3d& direction) const;
  void begin_passes(const CameraPose& pose, double begin_s);
  void draw_line(const Eigen::Vector2d& from, const Eigen::Vector2d& to, double flux_e);
  void draw_point(double x, double y, double flux_e);
  void draw_stars(const CameraPose& pose, double exposure_s, SkyTruth& truth);
  void draw_debris(const CameraPose& pose, double begin_s, double exposure_s, SkyTruth& truth);
  void read_out(double exposure_s, double gain_db, image::Grid<std::uint16_t>& pixels);
  [[nodiscard]] bool touches(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const;

  SkyCameraSettings settings_;
  std::function<void()> between_pieces_;
  double focal_px_;
  double sigma_px_;
  std::unique_ptr<Sky> sky_;
  hw_sim::SkyRandom random_;
  image::Plane response_;  ///< to the background
  image::Plane dark_e_s_;  ///< current of the hot and warm pixels
  image::Plane light_e_;
  std::vector<float> noise_;
  std::vector<Pass> passes_;
  double next_pass_s_ = 0;
  bool pass_next_ = false;
  bool covered_ = false;
};

}  // namespace srfs::sim
