// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/sky/lens_frame.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace srfs::hw_sim {
namespace {

constexpr double pi = std::numbers::pi;

/// Place in the field: direction from the middle and distance, 1 in the corner.
struct FieldPlace {
  FieldPlace(const LensScene& scene, double x, double y) {
    const double dx = x - scene.width / 2.0;
    const double dy = y - scene.height / 2.0;
    const double length = std::hypot(dx, dy);
    r = length / (std::hypot(scene.width, scene.height) / 2);
    ux = length > 0 ? dx / length : 1;
    uy = length > 0 ? dy / length : 0;
  }
  double r, ux, uy;
};

/// One blob of light: elliptic, along and across the radius.
struct Blob {
  double x, y, share, along_px, across_px;  ///< FWHM
};

/// A star: a core and, for coma, blobs that grow wider and fainter away from the middle.
std::vector<Blob> blobs_of(const LensScene& scene, double x, double y) {
  const FieldPlace at(scene, x, y);
  const Lens& lens = scene.lens;
  const double fwhm = lens.fwhm_px * (1 + lens.wider * at.r * at.r);
  const double stretch =
      std::exp(0.5 * std::log1p(std::abs(lens.astigmatism) * at.r * at.r) * (lens.astigmatism < 0 ? -1 : 1));
  const double tail_x = lens.coma_px * at.r * at.ux + lens.tilt_px;
  const double tail_y = lens.coma_px * at.r * at.uy;
  const double tail = std::hypot(tail_x, tail_y);
  constexpr int parts = 6;
  const double in_tail = tail > 0.05 ? 0.45 : 0;
  std::vector<Blob> still{{x, y, 1 - in_tail, fwhm * stretch, fwhm / stretch}};
  for (int k = 1; k <= parts && in_tail > 0; ++k) {
    const double d = 1.0 * k / parts;
    const double share = in_tail * 2 * (parts + 1 - k) / (parts * (parts + 1.0));
    const double wide = std::hypot(fwhm, 0.7 * d * tail);
    still.push_back({x + d * tail_x, y + d * tail_y, share, wide, wide});
  }
  const int moments =
      lens.drift_px > 0.05 ? std::max(2, static_cast<int>(std::ceil(2 * lens.drift_px / fwhm))) : 1;
  for (Blob& blob : still) blob.share *= 1 - lens.halo_share;
  if (lens.halo_share > 0)
    still.push_back({x, y, lens.halo_share, fwhm * lens.halo_wider, fwhm * lens.halo_wider});
  std::vector<Blob> blobs;
  for (int i = 0; i < moments; ++i) {
    for (Blob blob : still) {
      blob.y += ((i + 0.5) / moments - 0.5) * lens.drift_px;
      blob.share /= moments;
      blobs.push_back(blob);
    }
  }
  return blobs;
}

class Canvas {
 public:
  explicit Canvas(const LensScene& scene)
      : scene_(scene),
        e_(static_cast<std::size_t>(scene.width) * static_cast<std::size_t>(scene.height), 0.0) {}

  void add_blob(const Blob& blob, double flux, double beta) {
    const FieldPlace at(scene_, blob.x, blob.y);
    const double q_half = beta > 0 ? std::pow(2.0, 1 / beta) - 1 : std::log(2.0);
    const double along = q_half * 4 / (blob.along_px * blob.along_px);
    const double across = q_half * 4 / (blob.across_px * blob.across_px);
    const double area = pi / std::sqrt(along * across);
    const double norm = (beta > 0 ? (beta - 1) / area : 1 / area) * flux;
    const double wide = std::max(blob.along_px, blob.across_px);
    const int reach = static_cast<int>(std::ceil((beta > 0 ? 6 : 2.3) * wide)) + 1;
    const int x0 = static_cast<int>(std::lround(blob.x));
    const int y0 = static_cast<int>(std::lround(blob.y));
    for (int y = std::max(0, y0 - reach); y <= std::min(scene_.height - 1, y0 + reach); ++y) {
      for (int x = std::max(0, x0 - reach); x <= std::min(scene_.width - 1, x0 + reach); ++x) {
        const double far = std::max(std::abs(x - blob.x), std::abs(y - blob.y));
        const int n = far < 1 + wide ? (blob.across_px < 1.5 ? 6 : 3) : 1;
        double sum = 0;
        for (int j = 0; j < n; ++j) {
          for (int i = 0; i < n; ++i) {
            const double dx = x + (i + 0.5) / n - 0.5 - blob.x;
            const double dy = y + (j + 0.5) / n - 0.5 - blob.y;
            const double a = dx * at.ux + dy * at.uy;
            const double c = dy * at.ux - dx * at.uy;
            const double q = along * a * a + across * c * c;
            sum += beta > 0 ? std::pow(1 + q, -beta) : std::exp(-q);
          }
        }
        this->at(x, y) += norm * sum / (n * n);
      }
    }
  }

  void add(const SkyStar& star) {
    const FieldPlace at(scene_, star.x, star.y);
    const double light = star.flux_e * (1 - scene_.lens.vignette * at.r * at.r);
    for (const Blob& blob : blobs_of(scene_, star.x, star.y))
      add_blob(blob, light * blob.share, scene_.lens.moffat_beta);
  }

  void add(const LensTrail& trail, SkyRandom& random) {
    const double length = std::hypot(trail.x2 - trail.x1, trail.y2 - trail.y1);
    const double ux = (trail.x2 - trail.x1) / length;
    const double uy = (trail.y2 - trail.y1) / length;
    const double step = std::min(0.5, trail.fwhm_px / 4);
    const double keep = std::exp(-step / (1.5 * trail.fwhm_px));
    const double change = std::sqrt(1 - keep * keep);
    double brightness = random.normal();
    double beside = random.normal();
    const double phase = random.uniform() * trail.gap_px;
    for (double t = step / 2; t < length; t += step) {
      brightness = keep * brightness + change * random.normal();
      beside = keep * beside + change * random.normal();
      const double in_period = std::fmod(t + phase, trail.gap_px) / trail.gap_px;
      const bool at_end = t < 2 * step || t > length - 2 * step;  // what the truth calls its ends
      if (in_period < trail.gaps && !at_end) continue;
      const double light = trail.flux_e_px * step * std::max(0.05, 1 + trail.ragged * brightness);
      const double off = trail.wobble_px * beside;
      add_blob({trail.x1 + t * ux - off * uy, trail.y1 + t * uy + off * ux, 1, trail.fwhm_px, trail.fwhm_px},
               light, 0);
    }
  }

  double& at(int x, int y) {
    return e_[static_cast<std::size_t>(y) * static_cast<std::size_t>(scene_.width) +
              static_cast<std::size_t>(x)];
  }
  [[nodiscard]] std::vector<double>& electrons() { return e_; }

 private:
  const LensScene& scene_;
  std::vector<double> e_;
};

/// What JPEG keeps of a grey picture of 8 bits: blocks of 8 x 8, cosines, the standard's table.
class Jpeg {
 public:
  explicit Jpeg(int quality) {
    constexpr std::array<int, 64> table{
        16, 11,  10,  16, 24, 40, 51, 61, 12,  12,  14,  19,  26, 58, 60, 55,  14,  13,  16,  24, 40, 57,
        69, 56,  14,  17, 22, 29, 51, 87, 80,  62,  18,  22,  37, 56, 68, 109, 103, 77,  24,  35, 55, 64,
        81, 104, 113, 92, 49, 64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98,  112, 100, 103, 99};
    const int scale = quality < 50 ? 5000 / quality : 200 - 2 * quality;
    for (std::size_t i = 0; i < 64; ++i) steps_[i] = std::clamp((table[i] * scale + 50) / 100, 1, 255);
    for (int k = 0; k < 8; ++k) {
      for (int x = 0; x < 8; ++x)
        cosines_[index(x, k)] = (k == 0 ? std::sqrt(0.125) : 0.5) * std::cos((2 * x + 1) * k * pi / 16);
    }
  }

  void compress(std::vector<float>& adu, int width, int height) const {
    for (int y = 0; y < height; y += 8) {
      for (int x = 0; x < width; x += 8) compress_block(adu, width, height, x, y);
    }
  }

 private:
  static std::size_t index(int x, int y) { return static_cast<std::size_t>(8 * y + x); }

  void compress_block(std::vector<float>& adu, int width, int height, int x0, int y0) const {
    const auto pixel = [&](int x, int y) -> float& {
      return adu[static_cast<std::size_t>(std::min(y0 + y, height - 1)) * static_cast<std::size_t>(width) +
                 static_cast<std::size_t>(std::min(x0 + x, width - 1))];
    };
    std::array<double, 64> block{};
    for (int y = 0; y < 8; ++y)
      for (int x = 0; x < 8; ++x) block[index(x, y)] = double(pixel(x, y)) - 128;
    std::array<double, 64> waves{};
    for (int v = 0; v < 8; ++v) {
      for (int u = 0; u < 8; ++u) {
        double sum = 0;
        for (int y = 0; y < 8; ++y)
          for (int x = 0; x < 8; ++x)
            sum += block[index(x, y)] * cosines_[index(x, u)] * cosines_[index(y, v)];
        waves[index(u, v)] = std::round(sum / steps_[index(u, v)]) * steps_[index(u, v)];
      }
    }
    for (int y = 0; y < std::min(8, height - y0); ++y) {
      for (int x = 0; x < std::min(8, width - x0); ++x) {
        double sum = 0;
        for (int v = 0; v < 8; ++v)
          for (int u = 0; u < 8; ++u)
            sum += waves[index(u, v)] * cosines_[index(x, u)] * cosines_[index(y, v)];
        pixel(x, y) = static_cast<float>(std::clamp(std::round(sum + 128), 0.0, 255.0));
      }
    }
  }

  std::array<int, 64> steps_{};
  std::array<double, 64> cosines_{};
};

/// A particle's track: charge along a line, not blurred by the optics.
void add_cosmic_ray(const LensScene& scene, SkyRandom& random, Canvas& canvas) {
  const double x = random.uniform(0, scene.width);
  const double y = random.uniform(0, scene.height);
  const double angle = random.uniform(0, 2 * pi);
  const double length = std::min(60.0, 1 - 5 * std::log(1 - random.uniform()));
  const double charge_e_px = 150 * std::exp(random.uniform(0, 2.5));
  for (double t = 0; t < length; t += 0.25) {
    const int xi = static_cast<int>(std::floor(x + t * std::cos(angle)));
    const int yi = static_cast<int>(std::floor(y + t * std::sin(angle)));
    if (xi < 0 || yi < 0 || xi >= scene.width || yi >= scene.height) break;
    canvas.at(xi, yi) += 0.25 * charge_e_px;
  }
}

double background(const LensScene& scene, int x, int y) {
  const FieldPlace at(scene, x, y);
  return scene.detector.background_e * (1 - scene.lens.vignette * at.r * at.r);
}

}  // namespace

std::vector<float> render_lens(const LensScene& scene, const std::vector<SkyStar>& stars,
                               const std::vector<LensTrail>& trails) {
  SkyRandom random(scene.seed);
  SkyRandom pattern((scene.pattern_seed != 0 ? scene.pattern_seed : scene.seed) ^ 0x5DEECE66DU);
  const Detector& d = scene.detector;
  Canvas canvas(scene);
  for (const SkyStar& star : stars) canvas.add(star);
  for (const LensTrail& trail : trails) canvas.add(trail, random);
  for (int y = 0; y < scene.height; ++y) {
    for (int x = 0; x < scene.width; ++x) {
      double& e = canvas.at(x, y);
      e += background(scene, x, y);
      if (d.warm_share > 0 && pattern.uniform() < d.warm_share)
        e -= d.warm_e * std::log(1 - pattern.uniform());
      e = random.poisson(std::max(0.0, e));
    }
  }
  for (int i = 0; i < d.cosmic_rays; ++i) add_cosmic_ray(scene, random, canvas);
  std::vector<double> columns(static_cast<std::size_t>(scene.width));
  for (double& c : columns) c = d.column_pattern_e * pattern.normal();
  std::vector<float> adu(canvas.electrons().size());
  for (int y = 0; y < scene.height; ++y) {
    const double row = d.row_pattern_e * pattern.normal();
    for (int x = 0; x < scene.width; ++x) {
      const double e = canvas.at(x, y) + row + columns[static_cast<std::size_t>(x)] +
                       d.pixel_pattern_e * pattern.normal() + d.read_noise_e * random.normal();
      const double range = d.saturation_adu - d.bias_adu;
      const double linear = std::max(0.0, e / d.gain_e_per_adu);
      const double bent = d.gamma > 1 ? range * std::pow(linear / range, 1 / d.gamma) : e / d.gain_e_per_adu;
      adu[static_cast<std::size_t>(y) * columns.size() + static_cast<std::size_t>(x)] =
          static_cast<float>(std::clamp(std::round(bent + d.bias_adu), 0.0, d.saturation_adu));
    }
  }
  if (d.jpeg_quality > 0) Jpeg(d.jpeg_quality).compress(adu, scene.width, scene.height);
  return adu;
}

double sky_variance(const LensScene& scene) {
  const Detector& d = scene.detector;
  return d.background_e + d.read_noise_e * d.read_noise_e + d.gain_e_per_adu * d.gain_e_per_adu / 12;
}

std::vector<double> star_snrs(const LensScene& scene, const std::vector<SkyStar>& stars) {
  Canvas canvas(scene);
  const Lens& lens = scene.lens;
  const double wings = (lens.moffat_beta > 0 ? 6 : 2.3) * (lens.halo_share > 0 ? lens.halo_wider : 1);
  const int r = static_cast<int>(
                    std::ceil(2 * wings * lens.fwhm_px * (1 + lens.wider) * (1 + std::abs(lens.astigmatism)) +
                              3 * lens.coma_px)) +
                3;
  std::vector<double> snrs;
  for (const SkyStar& star : stars) {
    canvas.add(star);
    double sum = 0;
    for (int y = std::max(0, static_cast<int>(star.y) - r);
         y <= std::min(scene.height - 1, static_cast<int>(star.y) + r); ++y) {
      for (int x = std::max(0, static_cast<int>(star.x) - r);
           x <= std::min(scene.width - 1, static_cast<int>(star.x) + r); ++x) {
        double& e = canvas.at(x, y);
        sum += e * e / (sky_variance(scene) + e);
        e = 0;
      }
    }
    snrs.push_back(std::sqrt(sum));
  }
  return snrs;
}

double flux_for_snr(const LensScene& scene, double snr) {
  LensScene small = scene;
  small.width = small.height = 80;
  Canvas canvas(small);
  canvas.add(SkyStar{40.2, 39.8, 1});
  double energy = 0;
  for (const double v : canvas.electrons()) energy += v * v;
  return snr * std::sqrt(sky_variance(scene) / energy);
}

}  // namespace srfs::hw_sim
