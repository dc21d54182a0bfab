// Writes the frames of ./run bench image with their truth: NAME.fits and NAME.json each. Every frame has
// another optics, sky and detector, so that nothing can be tuned to one of them.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <numbers>
#include <string>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "hw_sim/sky_frame.hpp"
#include "image/frame_file.hpp"

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

/// Numbers grow as the inverse of the flux, as of real stars at moderate galactic latitudes.
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
           const std::vector<SkyStreak>& streaks) {
  image::Plane plane(scene.width, scene.height);
  plane.cells() = render_sky(scene, stars, streaks);
  const std::string name = fmt::format("{}/{}_{:03}", o.folder, o.set, number);
  if (const auto written = image::write_fits(name + ".fits", plane); !written)
    throw std::runtime_error(written.error().reason);
  std::ofstream(name + ".json") << truth_of(scene, stars, streaks).dump();
}

void make(const Options& o) {
  SkyRandom random(o.seed);
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
  app.add_option("--set", options.set, "What is in them")
      ->check(CLI::IsMember({"stars", "streaks", "short", "empty"}))
      ->capture_default_str();
  app.add_option("--frames", options.frames)->check(CLI::Range(1, 999))->capture_default_str();
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
