// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Writes the frames for ./run bench image with their truth: NAME.fits and NAME.json for a frame, NAME_0.fits
// to NAME_7.fits and NAME.json for a sequence. Every frame has different optics, sky and detector, so that no
// method can be tuned to one of them.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <string>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <Eigen/Dense>
#include <nlohmann/json.hpp>

#include "base/file.hpp"
#include "base/text.hpp"
#include "image/file/fits.hpp"
#include "image/file/frame_file.hpp"
#include "image/star_catalogue.hpp"
#include "tests/bench/lossless.hpp"
#include "tests/sky/lens_frame.hpp"
#include "tests/sky/sky_frame.hpp"

namespace {

using namespace srfs;
using namespace srfs::hw_sim;
using Json = nlohmann::ordered_json;

struct Options {
  std::string folder;
  std::string set = "stars";
  int frames = 10;
  int width = 960;
  int height = 720;
  std::uint64_t seed = 1;
};

SkyScene random_scene(const Options& o, SkyRandom& random) {
  SkyScene s;
  s.width = o.width;
  s.height = o.height;
  s.fwhm_px = random.uniform(1.2, 5);
  s.moffat_beta = random.uniform() < 0.5 ? 0 : random.uniform(2.5, 5);
  s.ellipticity = random.uniform(0, 0.15);
  s.major_axis_rad = random.uniform(0, std::numbers::pi);
  s.background_e = 20 * std::exp(random.uniform(0, 4.5));
  s.gradient = random.uniform(-0.4, 0.4);
  s.curvature = random.uniform(0, 0.5);
  s.read_noise_e = random.uniform(2, 12);
  s.gain_e_per_adu = std::exp(random.uniform(-1, 1.2));
  s.prnu = random.uniform(0, 0.01);
  s.adu_step = random.uniform() < 0.3 ? 16 * 0.25 / s.gain_e_per_adu : 1;
  s.adu_step = std::max(1.0, std::round(s.adu_step));
  const double megapixels = o.width * o.height / 1e6;
  s.hot_pixels = static_cast<int>(random.uniform(50, 500) * megapixels);
  s.cosmic_rays = static_cast<int>(random.uniform(5, 80) * megapixels);
  s.seed = static_cast<std::uint64_t>(random.uniform() * 1e15);
  return s;
}

/// Star counts grow with the inverse of the flux, as for real stars at moderate galactic latitudes.
std::vector<SkyStar> random_stars(const SkyScene& scene, SkyRandom& random, double per_megapixel) {
  std::vector<SkyStar> stars;
  const int n = static_cast<int>(per_megapixel * scene.width * scene.height / 1e6);
  for (int i = 0; i < n; ++i) {
    const double x = random.uniform(-0.5, scene.width - 0.5);
    const double y = random.uniform(-0.5, scene.height - 0.5);
    const double snr = std::min(3000.0, 4 / (1 - random.uniform()));
    stars.push_back({x, y, flux_for_snr(scene, x, y, snr)});
  }
  return stars;
}

std::vector<SkyStreak> random_streaks(const SkyScene& scene, SkyRandom& random, int count, double shortest,
                                      double longest) {
  std::vector<SkyStreak> streaks;
  for (int i = 0; i < count; ++i) {
    const double length = std::exp(random.uniform(std::log(shortest), std::log(longest)));
    const double angle = random.uniform(0, 2 * std::numbers::pi);
    const double hx = length / 2 * std::cos(angle);
    const double hy = length / 2 * std::sin(angle);
    const double mx = std::abs(hx) + 8;
    const double my = std::abs(hy) + 8;
    const double x = random.uniform(mx, scene.width - 1 - mx);
    const double y = random.uniform(my, scene.height - 1 - my);
    SkyStreak streak{x - hx, y - hy, x + hx, y + hy, 1};
    const double snr = 12 * std::exp(random.uniform(0, 1.6));
    streak.flux_e = snr / streak_snr(scene, streak);
    streaks.push_back(streak);
  }
  return streaks;
}

Json truth_of(const SkyScene& scene, const std::vector<SkyStar>& stars,
              const std::vector<SkyStreak>& streaks) {
  Json truth{{"fwhm", scene.fwhm_px},
             {"beta", scene.moffat_beta},
             {"background_e", scene.background_e},
             {"read_noise_e", scene.read_noise_e},
             {"gain", scene.gain_e_per_adu},
             {"stars", Json::array()},
             {"streaks", Json::array()}};
  for (const SkyStar& s : stars) {
    const StarLimits limits = star_limits(scene, s);
    truth["stars"].push_back({{"x", s.x},
                              {"y", s.y},
                              {"snr", limits.snr},
                              {"flux_adu", s.flux_e / scene.gain_e_per_adu},
                              {"limit_x", limits.x_px},
                              {"limit_y", limits.y_px}});
  }
  for (const SkyStreak& s : streaks)
    truth["streaks"].push_back(
        {{"x1", s.x1}, {"y1", s.y1}, {"x2", s.x2}, {"y2", s.y2}, {"snr", streak_snr(scene, s)}});
  return truth;
}

void write(const Options& o, int number, const SkyScene& scene, const std::vector<SkyStar>& stars,
           const std::vector<SkyStreak>& streaks, const Json& attitude = nullptr) {
  image::Plane plane(scene.width, scene.height);
  const std::vector<float> adu = render_sky(scene, stars, streaks);
  std::copy(adu.begin(), adu.end(), plane.cells().begin());
  const std::vector<image::FitsCard> cards{{"DATE-OBS", std::string("2026-11-26T12:00:00.000000")},
                                           {"EXPTIME", 2.0}};
  const std::string name = fmt::format("{}/{}_{:03}", o.folder, o.set, number);
  if (const auto written = write_file_atomically(name + ".fits", as_text(image::encode_fits(plane, cards)));
      !written)
    throw std::runtime_error(written.error().message);
  Json truth = truth_of(scene, stars, streaks);
  if (!attitude.is_null()) truth["attitude"] = attitude;
  std::ofstream(name + ".json") << truth.dump();
}

// --- sequences ---

constexpr int frames_of_sequence = 8;
constexpr int frames_of_faint = 12;

int frames_in(const Options& o) {
  return o.set == "faint" ? frames_of_faint : frames_of_sequence;
}

/// Position of a sequence's frame on the sky: sky = shift + rotated pixel, around the centre of the frame.
struct Pointing {
  double shift_x;
  double shift_y;
  double turn_rad;
};

SkyStar seen(const Options& o, const Pointing& p, const SkyStar& s) {
  const double x = s.x - p.shift_x - o.width / 2.0;
  const double y = s.y - p.shift_y - o.height / 2.0;
  const double c = std::cos(p.turn_rad);
  const double d = std::sin(p.turn_rad);
  return {c * x + d * y + o.width / 2.0, c * y - d * x + o.height / 2.0, s.flux_e};
}

/// An object that moves evenly over the sky and leaves a trail in each frame.
struct SkyMover {
  double x, y;    ///< at the middle of the exposure of frame 0
  double vx, vy;  ///< px per frame
  double trail_px;
  double snr;  ///< in each frame
};

std::vector<SkyMover> random_movers(const Options& o, SkyRandom& random) {
  std::vector<SkyMover> movers;
  const auto add = [&](double speed, double trail, double snr) {
    const double angle = random.uniform(0, 2 * std::numbers::pi);
    SkyMover m{0, 0, speed * std::cos(angle), speed * std::sin(angle), trail, snr};
    const double middle = (frames_in(o) - 1) / 2.0;
    m.x = random.uniform(0.1, 0.9) * o.width - middle * m.vx;
    m.y = random.uniform(0.1, 0.9) * o.height - middle * m.vy;
    movers.push_back(m);
  };
  if (o.set == "faint") {
    for (int i = 0; i < 4; ++i) {
      const double speed = std::exp(random.uniform(std::log(1.5), std::log(20.0)));
      add(speed, 0.1 * speed, random.uniform(3, 4));
    }
    return movers;
  }
  for (int i = 0; i < 3; ++i) {
    const double speed = std::exp(random.uniform(std::log(1.5), std::log(20.0)));
    add(speed, 0.1 * speed, random.uniform(4.5, 5.5));
  }
  for (int i = 0; i < 4; ++i) {
    const double speed = std::exp(random.uniform(std::log(1.5), std::log(20.0)));
    add(speed, 0.1 * speed, random.uniform(5.5, 15));
  }
  for (int i = 0; i < 2; ++i) {
    const double trail = random.uniform(10, 20);
    add(trail * random.uniform(1.2, 2.5), trail, random.uniform(12, 40));
  }
  return movers;
}

/// A mover's trail in frame @p k.
SkyStreak trail_of(const Options& o, const SkyScene& scene, const Pointing& p, const SkyMover& m, int k) {
  const double speed = std::hypot(m.vx, m.vy);
  const double hx = m.vx / speed * m.trail_px / 2;
  const double hy = m.vy / speed * m.trail_px / 2;
  const double x = m.x + k * m.vx;
  const double y = m.y + k * m.vy;
  const SkyStar a = seen(o, p, {x - hx, y - hy, 0});
  const SkyStar b = seen(o, p, {x + hx, y + hy, 0});
  SkyStreak streak{a.x, a.y, b.x, b.y, 1};
  // The trail is as bright everywhere as at the centre of the frame.
  SkyStreak there = streak;
  const double dx = scene.width / 2.0 - (a.x + b.x) / 2;
  const double dy = scene.height / 2.0 - (a.y + b.y) / 2;
  there.x1 += dx, there.x2 += dx, there.y1 += dy, there.y2 += dy;
  streak.flux_e = m.snr / streak_snr(scene, there);
  return streak;
}

void make_sequence(const Options& o, SkyRandom& random, int number) {
  SkyScene scene = random_scene(o, random);
  scene.pattern_seed = scene.seed;
  SkyScene wide = scene;  // includes the sky around the first frame, for the pointing drift
  const double margin = 150;
  const double density = std::exp(random.uniform(std::log(150.0), std::log(1500.0)));
  wide.width += static_cast<int>(2 * margin), wide.height += static_cast<int>(2 * margin);
  std::vector<SkyStar> sky = random_stars(wide, random, density);
  for (SkyStar& s : sky) s.x -= margin, s.y -= margin;
  const std::vector<SkyMover> movers = random_movers(o, random);
  const double drift = random.uniform(0, 12);
  const double drift_angle = random.uniform(0, 2 * std::numbers::pi);
  const double turn = random.uniform(-3e-4, 3e-4);
  Json truth{{"fwhm", scene.fwhm_px},
             {"width", o.width},
             {"height", o.height},
             {"frames", Json::array()},
             {"movers", Json::array()}};
  for (const SkyMover& m : movers)
    truth["movers"].push_back({{"snr", m.snr}, {"trail", m.trail_px}, {"points", Json::array()}});
  const std::string name = fmt::format("{}/{}_{:03}", o.folder, o.set, number);
  for (int k = 0; k < frames_in(o); ++k) {
    const Pointing p{k * drift * std::cos(drift_angle) + 0.5 * random.normal(),
                     k * drift * std::sin(drift_angle) + 0.5 * random.normal(), k * turn};
    std::vector<SkyStar> stars;
    for (const SkyStar& s : sky) stars.push_back(seen(o, p, s));
    std::vector<SkyStreak> trails;
    for (std::size_t i = 0; i < movers.size(); ++i) {
      trails.push_back(trail_of(o, scene, p, movers[i], k));
      const SkyStreak& t = trails.back();
      truth["movers"][i]["points"].push_back({{"x1", t.x1}, {"y1", t.y1}, {"x2", t.x2}, {"y2", t.y2}});
    }
    scene.seed = static_cast<std::uint64_t>(random.uniform() * 1e15);
    image::Plane plane(scene.width, scene.height);
    const std::vector<float> adu = render_sky(scene, stars, trails);
    std::copy(adu.begin(), adu.end(), plane.cells().begin());
    if (const auto written = image::write_fits(fmt::format("{}_{}.fits", name, k), plane); !written)
      throw std::runtime_error(written.error().reason);
    truth["frames"].push_back({{"shift_x", p.shift_x}, {"shift_y", p.shift_y}, {"turn_rad", p.turn_rad}});
  }
  std::ofstream(name + ".json") << truth.dump();
}

// --- small real cameras ---

/// A lens with faults in front of a finder camera of 8 bits, of a sensor without a dark, or of one whose
/// frames are compressed.
LensScene random_lens(const Options& o, SkyRandom& random) {
  LensScene s;
  s.width = o.width;
  s.height = o.height;
  const double kind = random.uniform();
  const bool finder = kind < 0.35;
  const bool jpeg = kind > 0.7;
  s.lens.fwhm_px = finder ? random.uniform(0.85, 2.4)
                   : jpeg ? random.uniform(1.6, 4)
                          : random.uniform(1.0, 4);
  s.lens.moffat_beta = random.uniform() < 0.5 ? 0 : random.uniform(2.5, 5);
  s.lens.wider = random.uniform(0, 1);
  s.lens.astigmatism = random.uniform(-0.5, 0.8);
  s.lens.coma_px = random.uniform() < 0.3 ? 0 : random.uniform(1, 4) * s.lens.fwhm_px;
  s.lens.tilt_px = random.uniform() < 0.7 ? 0 : random.uniform(0.5, 2) * s.lens.fwhm_px;
  s.lens.drift_px = random.uniform() < 0.75 ? 0 : random.uniform(0.5, 2) * s.lens.fwhm_px;
  if (random.uniform() < 0.5) {
    s.lens.halo_share = random.uniform(0.05, 0.35);
    s.lens.halo_wider = random.uniform(3, 7);
  }
  s.lens.vignette = random.uniform(0, 0.6);
  Detector& d = s.detector;
  d.background_e = 20 * std::exp(random.uniform(0, 3));
  d.read_noise_e = random.uniform(3, 12);
  const double noise_e = std::sqrt(d.background_e + d.read_noise_e * d.read_noise_e);
  const double megapixels = o.width * o.height / 1e6;
  if (finder || jpeg) {
    d.gain_e_per_adu = noise_e / random.uniform(0.6, 3);
    d.bias_adu = random.uniform(2, 12);
    d.saturation_adu = 255;
    if (random.uniform() < (jpeg ? 0.5 : 0.15)) {
      d.gamma = random.uniform(1.5, 2.4);
      // The noise of the sky is as many steps as without.
      const double range = d.saturation_adu - d.bias_adu;
      const double steps = noise_e / d.gain_e_per_adu;
      const double sky = std::pow(steps * d.gamma * d.background_e / noise_e / range, d.gamma);
      d.gain_e_per_adu = d.background_e / (range * sky);
    }
    if (jpeg) d.jpeg_quality = static_cast<int>(random.uniform(75, 97));
  } else {
    d.gain_e_per_adu = noise_e / random.uniform(3, 12);
    d.saturation_adu = 4095;
  }
  if (!jpeg) {
    d.column_pattern_e = random.uniform(0, 0.8) * noise_e;
    d.row_pattern_e = random.uniform(0, 0.6) * noise_e;
    d.pixel_pattern_e = random.uniform(0, 0.6) * noise_e;
    d.warm_share = 0.02 * std::pow(random.uniform(), 2);
    d.warm_e = random.uniform(2, 12) * noise_e;
    d.cosmic_rays = static_cast<int>(random.uniform(0, 30) * megapixels);
  }
  s.seed = static_cast<std::uint64_t>(random.uniform() * 1e15);
  return s;
}

std::vector<SkyStar> lens_stars(const LensScene& scene, SkyRandom& random, double per_megapixel) {
  std::vector<SkyStar> stars;
  const double unit = flux_for_snr(scene, 1);
  const int n = static_cast<int>(per_megapixel * scene.width * scene.height / 1e6);
  for (int i = 0; i < n; ++i) {
    const double x = random.uniform(-0.5, scene.width - 0.5);
    const double y = random.uniform(-0.5, scene.height - 0.5);
    const bool bright = random.uniform() < 0.12;  // as many in each decade, as finders show
    const double snr = bright ? 30 * std::exp(random.uniform(0, 6.5)) : 4 / (1 - random.uniform());
    stars.push_back({x, y, unit * std::min(20000.0, snr)});
  }
  return stars;
}

/// Wider or sharper than stars, ragged, with gaps; a third of them across the whole frame.
LensTrail random_trail(const LensScene& scene, SkyRandom& random) {
  LensTrail t{};
  t.fwhm_px = std::max(0.6, scene.lens.fwhm_px * 0.6 * std::exp(random.uniform(0, std::log(4 / 0.6))));
  t.ragged = random.uniform() < 0.4 ? 0 : random.uniform(0, 0.6);
  t.wobble_px = random.uniform() < 0.5 ? 0 : random.uniform(0, 0.3) * t.fwhm_px;
  t.gaps = random.uniform() < 0.6 ? 0 : random.uniform(0.1, 0.4);
  t.gap_px = random.uniform(12, 45);
  const double across = std::hypot(t.fwhm_px, 0.7);
  const double height = 2.5 * std::exp(random.uniform(0, 3.3));  // of its middle, in noise
  t.flux_e_px = height * std::sqrt(sky_variance(scene)) * across * 1.0645;
  const double angle = random.uniform(0, std::numbers::pi);
  const double ux = std::cos(angle);
  const double uy = std::sin(angle);
  const double x = random.uniform(0.25, 0.75) * scene.width;
  const double y = random.uniform(0.25, 0.75) * scene.height;
  double half = random.uniform(20, 180);
  const bool whole = random.uniform() < 0.34;
  const double right = scene.width - 1;
  const double bottom = scene.height - 1;
  const auto until = [&](double way) {  // the frame's edge, or the end
    double t_most = whole ? 1e9 : half;
    if (way * ux > 1e-9) t_most = std::min(t_most, (right - x) / (way * ux));
    if (way * ux < -1e-9) t_most = std::min(t_most, -x / (way * ux));
    if (way * uy > 1e-9) t_most = std::min(t_most, (bottom - y) / (way * uy));
    if (way * uy < -1e-9) t_most = std::min(t_most, -y / (way * uy));
    return t_most;
  };
  const double back = until(-1);
  const double ahead = until(1);
  t.x1 = x - back * ux, t.y1 = y - back * uy;
  t.x2 = x + ahead * ux, t.y2 = y + ahead * uy;
  return t;
}

/// Makes the detector one of 12 bits whose pattern is stronger than its noise, behind sharp optics.
void strengthen_pattern(SkyRandom& random, LensScene& scene) {
  Detector& d = scene.detector;
  const double noise_e = std::sqrt(sky_variance(scene));
  d = {.background_e = d.background_e, .read_noise_e = d.read_noise_e, .saturation_adu = 4095};
  d.gain_e_per_adu = noise_e / random.uniform(3, 12);
  d.column_pattern_e = random.uniform(0.2, 1.5) * noise_e;
  d.row_pattern_e = random.uniform(0, 0.8) * noise_e;
  d.pixel_pattern_e = random.uniform(0.2, 1.5) * noise_e;
  d.warm_share = random.uniform(0.01, 0.1);
  d.warm_e = random.uniform(5, 30) * noise_e;
  d.cosmic_rays = static_cast<int>(random.uniform(0, 30) * scene.width * scene.height / 1e6);
  scene.lens.fwhm_px = random.uniform(0.9, 2);
  scene.pattern_seed = scene.seed;
}

void write_lens_frame(const LensScene& scene, const std::vector<SkyStar>& stars,
                      const std::vector<LensTrail>& trails, const std::string& path) {
  image::Frame frame;
  frame.pixels = image::Plane(scene.width, scene.height);
  frame.exposure_s = 1;
  const std::vector<float> adu = render_lens(scene, stars, trails);
  std::copy(adu.begin(), adu.end(), frame.pixels.cells().begin());
  if (const auto written = image::write_fits(path, frame); !written)
    throw std::runtime_error(written.error().reason);
}

constexpr int darks_of_frame = 8;

/// Frames of the same detector without light.
void write_darks(LensScene scene, SkyRandom& random, const std::string& name) {
  scene.detector.background_e = 0;
  for (int k = 0; k < darks_of_frame; ++k) {
    scene.seed = static_cast<std::uint64_t>(random.uniform() * 1e15);
    write_lens_frame(scene, {}, {}, fmt::format("{}_dark_{}.fits", name, k));
  }
}

void make_lens_frame(const Options& o, SkyRandom& random, int number) {
  LensScene scene = random_lens(o, random);
  if (o.set == "pattern") strengthen_pattern(random, scene);
  const double density = std::exp(random.uniform(std::log(100.0), std::log(1500.0)));
  const std::vector<SkyStar> stars = lens_stars(scene, random, density);
  std::vector<LensTrail> trails;
  for (int i = 0; i < (o.set == "trails" ? 2 : 0); ++i) trails.push_back(random_trail(scene, random));
  const std::string name = fmt::format("{}/{}_{:03}", o.folder, o.set, number);
  write_lens_frame(scene, stars, trails, name + ".fits");
  if (o.set == "pattern") write_darks(scene, random, name);
  Json truth{{"fwhm", scene.lens.fwhm_px},
             {"coma", scene.lens.coma_px + scene.lens.tilt_px},
             {"drift", scene.lens.drift_px},
             {"wider", scene.lens.wider},
             {"astigmatism", scene.lens.astigmatism},
             {"gamma", scene.detector.gamma},
             {"halo", scene.lens.halo_share},
             {"jpeg_quality", scene.detector.jpeg_quality},
             {"saturation", scene.detector.saturation_adu},
             {"warm_share", scene.detector.warm_share},
             {"noise_adu", std::sqrt(sky_variance(scene)) / scene.detector.gain_e_per_adu},
             {"stars", Json::array()},
             {"streaks", Json::array()}};
  const std::vector<double> snrs = star_snrs(scene, stars);
  for (std::size_t i = 0; i < stars.size(); ++i)
    truth["stars"].push_back({{"x", stars[i].x}, {"y", stars[i].y}, {"snr", snrs[i]}});
  for (const LensTrail& t : trails)
    truth["streaks"].push_back(
        {{"x1", t.x1},
         {"y1", t.y1},
         {"x2", t.x2},
         {"y2", t.y2},
         {"width", std::hypot(t.fwhm_px, 0.7)},
         {"height", t.flux_e_px / std::hypot(t.fwhm_px, 0.7) / 1.0645 / std::sqrt(sky_variance(scene))},
         {"ragged", t.ragged},
         {"gaps", t.gaps}});
  std::ofstream(name + ".json") << truth.dump();
}

// --- real sky ---

/// Of a lens: the width of its field, and how far it displaces the frame's corners (over their distance).
struct Optics {
  double field_deg;
  double distortion;
};

/// Sets `plate` and `passes`: 6 to 15 degrees without distortion; set `lens`: 2 to 60 degrees, all widths as
/// likely in logarithm, up to 5 % of distortion.
Optics random_optics(const Options& o, SkyRandom& random) {
  if (o.set != "lens") return {random.uniform(6, 15), 0};
  const double field_deg = 2 * std::pow(30.0, random.uniform());
  return {field_deg, random.uniform(-0.05, 0.05)};
}

struct SeenStar {
  double x;
  double y;
  double magnitude;
};

/// What a camera sees of the catalogue.
struct SkyView {
  struct Axes {
    Eigen::Vector3d middle, right, down;
  };
  Axes axes;
  int width;
  int height;
  double focal_px;
  double distortion;  ///< at the corners, over their distance from the middle

  [[nodiscard]] std::vector<SeenStar> stars(double known_to, double faintest) const {
    std::vector<SeenStar> seen;
    const double corner_px = std::hypot(width, height) / 2;
    for (const image::CatalogueStar& s : image::bright_stars(known_to)) {
      const double ahead = s.direction.dot(axes.middle);
      if (ahead < 0.75 || s.magnitude > faintest) continue;
      const Eigen::Vector2d flat =
          focal_px / ahead * Eigen::Vector2d(s.direction.dot(axes.right), s.direction.dot(axes.down));
      const double square = flat.squaredNorm() / (corner_px * corner_px);
      if (square > 1.5) continue;  // farther out the polynomial turns back
      const double x = (width - 1) / 2.0 + flat.x() * (1 + distortion * square);
      const double y = (height - 1) / 2.0 + flat.y() * (1 + distortion * square);
      if (x > -5 && y > -5 && x < width + 4 && y < height + 4) seen.push_back({x, y, s.magnitude});
    }
    return seen;
  }
};

SkyView view_of(const Options& o, const Eigen::Vector3d& middle, double roll_deg, double focal_px,
                double distortion) {
  const double roll = roll_deg * std::numbers::pi / 180;
  const Eigen::Vector3d east = Eigen::Vector3d(-middle.y(), middle.x(), 0).normalized();
  const Eigen::Vector3d north = middle.cross(east);
  const Eigen::Vector3d down = -std::cos(roll) * north - std::sin(roll) * east;
  return {{middle, down.cross(middle), down}, o.width, o.height, focal_px, distortion};
}

/// A field at a random pointing, with the catalogue's stars and random fainter ones.
void make_plate(const Options& o, SkyRandom& random, int number) {
  using Eigen::Vector3d;
  SkyScene scene = random_scene(o, random);
  scene.fwhm_px = random.uniform(1.4, 3.5);
  const auto [field_deg, distortion] = random_optics(o, random);
  const double known_to = o.set != "lens" ? 8.5 : image::faintest_of_catalogue;
  const double ra_deg = random.uniform(0, 360);
  const double dec_deg = std::asin(random.uniform(-1, 1)) * 180 / std::numbers::pi;
  const double roll_deg = random.uniform(0, 360);
  // Magnitude at SNR 6. A wide lens collects less light.
  const double faintest = o.set != "lens"
                              ? random.uniform(8, 9.5)
                              : random.uniform(10, 11.5) - 2 * std::log(field_deg / 2) / std::log(3.0);
  const double focal_px = o.width / 2.0 / std::tan(field_deg * std::numbers::pi / 360);
  const SkyView view = view_of(o, image::direction_of(ra_deg, dec_deg), roll_deg, focal_px, distortion);
  const Vector3d middle = view.axes.middle;
  const Vector3d right = view.axes.right;
  const Vector3d down = view.axes.down;
  const auto flux = [&](double x, double y, double magnitude) {
    return flux_for_snr(scene, x, y, std::min(20000.0, 6 * std::pow(10, 0.4 * (faintest - magnitude))));
  };
  std::vector<SkyStar> stars;
  for (const SeenStar& s : view.stars(known_to, faintest + 1.5))
    stars.push_back({s.x, s.y, flux(s.x, s.y, s.magnitude)});
  // Star counts triple with each magnitude.
  const double known = static_cast<double>(stars.size());
  const int fainter = static_cast<int>(known * (std::pow(3.0, std::max(0.0, faintest + 0.5 - known_to)) - 1));
  for (int i = 0; i < fainter; ++i) {
    const double x = random.uniform(0, o.width);
    const double y = random.uniform(0, o.height);
    const double share = random.uniform(std::pow(3.0, known_to - faintest - 0.5), 1);
    stars.push_back({x, y, flux(x, y, faintest + 0.5 + std::log(share) / std::log(3.0))});
  }
  std::vector<SkyStreak> streaks;
  Json ends = Json::array();
  const auto place = [&](double x, double y) {
    const Vector3d d =
        ((x - (o.width - 1) / 2.0) * right + (y - (o.height - 1) / 2.0) * down + focal_px * middle)
            .normalized();
    const double turn = std::atan2(d.y(), d.x()) * 180 / std::numbers::pi;
    return Json{{"ra_deg", turn < 0 ? turn + 360 : turn},
                {"dec_deg", std::asin(d.z()) * 180 / std::numbers::pi}};
  };
  if (o.set == "passes") streaks = random_streaks(scene, random, 5, 20, 200);
  for (const SkyStreak& s : streaks) {
    const double zero_flux = flux((s.x1 + s.x2) / 2, (s.y1 + s.y2) / 2, faintest);
    ends.push_back({{"x1", s.x1},
                    {"y1", s.y1},
                    {"x2", s.x2},
                    {"y2", s.y2},
                    {"first", place(s.x1, s.y1)},
                    {"last", place(s.x2, s.y2)},
                    {"magnitude", faintest - 2.5 * std::log10(s.flux_e / zero_flux)}});
  }
  write(o, number, scene, stars, streaks,
        {{"passes", ends},
         {"ra_deg", ra_deg},
         {"dec_deg", dec_deg},
         {"roll_deg", roll_deg},
         {"field_deg", field_deg},
         {"distortion", distortion},
         {"scale_arcsec_px", 180 * 3600 / std::numbers::pi / focal_px}});
}

// --- the Milky Way ---

/// The densest fields of the catalogue, 8 to 25 degrees wide.
SkyView random_dense_view(const Options& o, SkyRandom& random) {
  using Eigen::Vector3d;
  const Vector3d pole = image::direction_of(192.859, 27.128);
  const Vector3d ahead = image::direction_of(266.405, -28.936);  // the galaxy's middle
  const double longitude = random.uniform(0, 2 * std::numbers::pi);
  const Vector3d middle = (std::cos(longitude) * ahead + std::sin(longitude) * pole.cross(ahead) +
                           random.uniform(-0.1, 0.1) * pole)
                              .normalized();
  const double field_deg = 8 * std::pow(3.0, random.uniform());
  const double focal_px = o.width / 2.0 / std::tan(field_deg * std::numbers::pi / 360);
  return view_of(o, middle, random.uniform(0, 360), focal_px, random.uniform(-0.02, 0.02));
}

/// With streaks of SNR 8 and more among the stars.
void make_dense(const Options& o, SkyRandom& random, int number) {
  SkyScene scene = random_scene(o, random);
  scene.fwhm_px = random.uniform(1.4, 3.5);
  const SkyView view = random_dense_view(o, random);
  const double faintest = random.uniform(8.5, 10);  // at SNR 6
  std::vector<SkyStar> stars;
  for (const SeenStar& s : view.stars(image::faintest_of_catalogue, faintest + 1.5)) {
    const double snr = 6 * std::pow(10, 0.4 * (faintest - s.magnitude) + 0.04 * random.normal());
    stars.push_back({s.x, s.y, flux_for_snr(scene, s.x, s.y, std::min(20000.0, snr))});
  }
  std::vector<SkyStreak> streaks = random_streaks(scene, random, 6, 15, 200);
  for (SkyStreak& s : streaks) s.flux_e *= 8.0 / 12;
  write(o, number, scene, stars, streaks, Json{{"ra_deg", 0}});
}

/// Through the lens of a small camera of 8 bits, mostly compressed; no streak.
void make_finder(const Options& o, SkyRandom& random, int number) {
  LensScene scene = random_lens(o, random);
  while (scene.detector.saturation_adu > 255) scene = random_lens(o, random);
  const SkyView view = random_dense_view(o, random);
  const double faintest = random.uniform(8, 9.5);
  const double unit = flux_for_snr(scene, 1);
  std::vector<SkyStar> stars;
  for (const SeenStar& s : view.stars(image::faintest_of_catalogue, faintest + 1.5)) {
    const double snr = 6 * std::pow(10, 0.4 * (faintest - s.magnitude) + 0.04 * random.normal());
    stars.push_back({s.x, s.y, unit * std::min(20000.0, snr)});
  }
  const std::string name = fmt::format("{}/{}_{:03}", o.folder, o.set, number);
  write_lens_frame(scene, stars, {}, name + ".fits");
  std::ofstream(name + ".json") << Json{
      {"fwhm", scene.lens.fwhm_px},
      {"jpeg_quality", scene.detector.jpeg_quality},
      {"streaks", Json::array()}}.dump();
}

void make(const Options& o) {
  SkyRandom random(o.seed);
  if (o.set == "lossless") {
    std::puts(bench::measure_lossless(o.width, o.height, o.frames, o.seed).dump().c_str());
    return;
  }
  if (o.set == "plate" || o.set == "lens" || o.set == "passes") {
    for (int i = 0; i < o.frames; ++i) make_plate(o, random, i);
    return;
  }
  if (o.set == "dense" || o.set == "finder") {
    for (int i = 0; i < o.frames; ++i)
      o.set == "dense" ? make_dense(o, random, i) : make_finder(o, random, i);
    return;
  }
  if (o.set == "sequence" || o.set == "faint") {
    for (int i = 0; i < o.frames; ++i) make_sequence(o, random, i);
    return;
  }
  if (o.set == "camera" || o.set == "trails" || o.set == "pattern") {
    for (int i = 0; i < o.frames; ++i) make_lens_frame(o, random, i);
    return;
  }
  for (int i = 0; i < o.frames; ++i) {
    const SkyScene scene = random_scene(o, random);
    const double density = std::exp(random.uniform(std::log(150.0), std::log(2500.0)));
    const auto stars = random_stars(scene, random, o.set == "empty" ? 0 : density);
    std::vector<SkyStreak> streaks;
    if (o.set == "streaks") streaks = random_streaks(scene, random, 4, 20, 250);
    if (o.set == "short") streaks = random_streaks(scene, random, 6, 10, 20);
    write(o, i, scene, stars, streaks);
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Writes frames of simulated skies and their truth"};
  Options options;
  app.add_option("FOLDER", options.folder)->required()->check(CLI::ExistingDirectory);
  app.add_option("--set", options.set, "What is in them; lossless: measures how they are packed, writes none")
      ->check(CLI::IsMember({"stars", "streaks", "short", "empty", "sequence", "plate", "lens", "camera",
                             "trails", "pattern", "passes", "dense", "finder", "faint", "lossless"}))
      ->capture_default_str();
  app.add_option("--frames", options.frames, "Frames, or sequences of eight (faint: twelve)")
      ->check(CLI::Range(1, 999))
      ->capture_default_str();
  app.add_option("--width", options.width)->check(CLI::Range(64, 8192))->capture_default_str();
  app.add_option("--height", options.height)->check(CLI::Range(64, 8192))->capture_default_str();
  app.add_option("--seed", options.seed)->capture_default_str();
  try {
    app.parse(argc, argv);
    make(options);
  } catch (const CLI::ParseError& e) {
    return app.exit(e);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "bench_image: %s\n", e.what());
    return 1;
  }
  return 0;
}
