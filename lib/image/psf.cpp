// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/psf.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Dense>

#include "image/rows.hpp"

namespace srfs::image {
namespace {

constexpr float height_least = 6;  ///< of a candidate, in noise
constexpr std::size_t candidates_max = 4000;
constexpr std::size_t stars_max = 60;
/// What a pixel and the narrowest optics make: below it are hot pixels and particle tracks.
struct Sharpest {
  double sigma_px;
  double fwhm_px;
  std::size_t stars;  ///< of this shape, at least
  float beside;       ///< share of the light of a pixel that its four neighbours have on average
};
constexpr Sharpest usual{0.5, 1.25, 3, 0.12F};
/// Of lenses that are sharper than their pixels: only where no star is as wide as usual.
constexpr Sharpest sharp{0.4, 0.95, 8, 0.05F};
constexpr double sigma_most_px = 6;

struct Candidate {
  int x;
  int y;
  float height;
  double sigma = 0;
};

/// A hot pixel has no light beside it; what counts as light is three times the noise of four pixels.
bool has_light_beside(const Plane& signal, const Candidate& c, const Sharpest& least) {
  const float beside = (signal.at(c.x - 1, c.y) + signal.at(c.x + 1, c.y) + signal.at(c.x, c.y - 1) +
                        signal.at(c.x, c.y + 1)) /
                       4;
  return beside >= 1.5F && beside >= least.beside * c.height;
}

/// Light that is all around, farther than any star's: where the sky's level is wrong, beside trees and
/// horizons, every grain of noise would be a bright candidate.
bool stands_on_light(const Plane& signal, const Candidate& c) {
  constexpr int r = 12;
  constexpr int d = 8;
  constexpr float share = 0.4F;
  int lit = 0;
  int seen = 0;
  for (const auto& [dx, dy] :
       {std::pair{r, 0}, {-r, 0}, {0, r}, {0, -r}, {d, d}, {d, -d}, {-d, d}, {-d, -d}}) {
    if (!signal.contains(c.x + dx, c.y + dy)) continue;
    ++seen;
    lit += signal.at(c.x + dx, c.y + dy) > share * c.height;
  }
  return seen > 0 && 2 * lit >= seen;
}

/// Nine pixels weighted 1 2 1 each way: as a Gaussian of variance 0.5, with 0.375 of a pixel's noise.
float smoothed(const Plane& signal, int x, int y) {
  float sum = 0;
  for (int j = -1; j <= 1; ++j) {
    for (int i = -1; i <= 1; ++i)
      sum += static_cast<float>((2 - std::abs(i)) * (2 - std::abs(j))) * signal.at(x + i, y + j);
  }
  return sum / 16;
}

/// Width of a Gaussian through three values, @p d apart: exact wherever in the pixel the star is.
std::optional<double> sigma_through(float before, float middle, float after, int d) {
  if (!(middle > 0) || !(before > 0) || !(after > 0)) return std::nullopt;
  const double curve = 2 * std::log(double(middle)) - std::log(double(before)) - std::log(double(after));
  if (!(curve > 0.02)) return std::nullopt;
  return d / std::sqrt(curve);
}

std::optional<double> round_sigma(std::optional<double> sx, std::optional<double> sy) {
  if (!sx || !sy || std::max(*sx, *sy) > 2.2 * std::min(*sx, *sy)) return std::nullopt;
  return std::sqrt(*sx * *sy);
}

/// For stars of two pixels and less.
std::optional<double> narrow_sigma(const Plane& signal, const Candidate& c, const Sharpest& least) {
  const auto floor = [](float v) { return std::max(v, 0.5F); };
  const auto sigma =
      round_sigma(sigma_through(floor(signal.at(c.x - 1, c.y)), c.height, floor(signal.at(c.x + 1, c.y)), 1),
                  sigma_through(floor(signal.at(c.x, c.y - 1)), c.height, floor(signal.at(c.x, c.y + 1)), 1));
  return sigma && *sigma >= least.sigma_px ? sigma : std::nullopt;
}

/// For wider stars, whose single pixels are noisy: through smoothed values, with light on all four sides.
std::optional<double> wide_sigma(const Plane& signal, const Candidate& c, int d) {
  if (c.x <= d || c.y <= d || c.x + d + 1 >= signal.width() || c.y + d + 1 >= signal.height())
    return std::nullopt;
  const float middle = smoothed(signal, c.x, c.y);
  const std::array<float, 4> sides{smoothed(signal, c.x - d, c.y), smoothed(signal, c.x + d, c.y),
                                   smoothed(signal, c.x, c.y - d), smoothed(signal, c.x, c.y + d)};
  if (*std::min_element(sides.begin(), sides.end()) < std::max(1.0F, 0.2F * middle)) return std::nullopt;
  const auto sigma =
      round_sigma(sigma_through(sides[0], middle, sides[1], d), sigma_through(sides[2], middle, sides[3], d));
  if (!sigma || *sigma * *sigma < 0.7) return std::nullopt;
  return std::sqrt(*sigma * *sigma - 0.5);
}

/// The half-sample mode: where the values are densest.
double mode_of(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  std::size_t from = 0;
  std::size_t n = values.size();
  while (n > 3) {
    const std::size_t half = (n + 1) / 2;
    std::size_t best = from;
    // Narrower in the logarithm: wide shapes scatter more.
    for (std::size_t i = from; i + half <= from + n; ++i) {
      if (values[i + half - 1] / values[i] < values[best + half - 1] / values[best]) best = i;
    }
    from = best;
    n = half;
  }
  return values[from + n / 2];
}

std::vector<Candidate> find_candidates(const Plane& signal, const Grid<std::uint8_t>& bad,
                                       bool apart_from_light) {
  std::vector<Candidate> found;
  std::vector<int> bright;
  for (int y = 2; y + 2 < signal.height(); ++y) {
    const float* row = signal.row(y);
    const float* above = signal.row(y - 1);
    const float* below = signal.row(y + 1);
    find_above(row, height_least, signal.width(), bright);
    for (const int x : bright) {
      if (x < 2 || x + 2 >= signal.width()) continue;
      const float v = row[x];
      if (v < row[x - 1] || v <= row[x + 1] || v < above[x] || v <= below[x] || v < above[x - 1] ||
          v < above[x + 1] || v <= below[x - 1] || v <= below[x + 1])
        continue;
      bool usable = true;
      for (int j = -1; j <= 1; ++j) {
        for (int i = -1; i <= 1; ++i) usable = usable && bad.at(x + i, y + j) == 0;
      }
      if (usable && !(apart_from_light && stands_on_light(signal, {x, y, v}))) found.push_back({x, y, v});
    }
  }
  if (found.size() > candidates_max) {
    std::nth_element(found.begin(), found.begin() + candidates_max, found.end(),
                     [](const Candidate& a, const Candidate& b) { return a.height > b.height; });
    found.resize(candidates_max);
  }
  return found;
}

/// The densest of the widths that @p width_of finds. @return it, and how many there were
template <class WidthOf>
std::pair<double, std::size_t> densest_sigma(std::vector<Candidate>& candidates, WidthOf&& width_of) {
  std::vector<double> sigmas;
  for (Candidate& c : candidates) {
    const auto sigma = width_of(c);
    c.sigma = sigma.value_or(0);
    if (sigma) sigmas.push_back(*sigma);
  }
  const std::size_t n = sigmas.size();
  return {n < 3 ? 0 : mode_of(std::move(sigmas)), n};
}

/// Which candidates say how wide stars are.
struct Brightest {
  std::size_t count;       ///< so many, but at most a third of all
  float height;            ///< at least
  double narrowest_per_d;  ///< below it a width is not measured over this distance
  double alike;            ///< share that agrees of those that can be measured
};
/// Where a galaxy or a nebula has more knots than the sky has stars, those outshine its knots.
constexpr Brightest outshining{15, 20, 0.5, 0.5};
constexpr Brightest bright{60, height_least, 0.65, 0.7};

/// Of their width to that of the others.
constexpr double clearly_narrower = 0.7;

/// The width that the brightest have in common if they have light on all four sides at all, as no particle
/// has: grains of a compressed picture or of a textured foreground outnumber the stars, but are not brighter.
std::optional<double> sigma_of_brightest(const Plane& signal, std::vector<Candidate> candidates,
                                         const Brightest& which) {
  constexpr std::size_t agreeing = 6;
  const std::size_t n = std::min(which.count, candidates.size() / 3);
  if (n < agreeing) return std::nullopt;
  std::nth_element(candidates.begin(), candidates.begin() + static_cast<std::ptrdiff_t>(n), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.height > b.height; });
  candidates.resize(n);
  std::erase_if(candidates, [&](const Candidate& c) { return c.height < which.height; });
  for (const int d : {5, 4, 3, 2}) {
    const auto [sigma, measured] =
        densest_sigma(candidates, [&](const Candidate& c) { return wide_sigma(signal, c, d); });
    if (measured < agreeing || sigma < which.narrowest_per_d * d) continue;
    const auto alike = std::count_if(candidates.begin(), candidates.end(), [&](const Candidate& c) {
      return c.sigma > 0.8 * sigma && c.sigma < 1.25 * sigma;
    });
    const double least = std::max(1.0 * agreeing, std::floor(which.alike * static_cast<double>(measured)));
    if (static_cast<double>(alike) >= least) return sigma;
  }
  return std::nullopt;
}

/// Leaves each candidate with its width, measured over a distance that suits the common one.
std::pair<double, std::size_t> measure_all(const Plane& signal, std::vector<Candidate>& candidates,
                                           double sigma) {
  const int d = std::clamp(static_cast<int>(std::lround(1.2 * sigma)), 2, 5);
  return densest_sigma(candidates, [&](const Candidate& c) { return wide_sigma(signal, c, d); });
}

/// The few that outshine all others decide.
std::optional<double> outshining_sigma(const Plane& signal, std::vector<Candidate>& candidates,
                                       const Sharpest& /*least*/) {
  const auto sigma = sigma_of_brightest(signal, candidates, outshining);
  if (sigma) (void)measure_all(signal, candidates, *sigma);
  return sigma;
}

/// The bright ones decide.
std::optional<double> bright_sigma(const Plane& signal, std::vector<Candidate>& candidates,
                                   const Sharpest& /*least*/) {
  const auto common = sigma_of_brightest(signal, candidates, bright);
  if (!common) return std::nullopt;
  const auto [sigma, n] = measure_all(signal, candidates, *common);
  return n >= 3 && sigma > 0.7 * *common && sigma < 1.4 * *common ? sigma : *common;
}

/// The most frequent width.
std::optional<double> common_sigma(const Plane& signal, std::vector<Candidate>& candidates,
                                   const Sharpest& least) {
  const auto [first, wide_ones] =
      densest_sigma(candidates, [&](const Candidate& c) { return wide_sigma(signal, c, 2); });
  // Of narrow stars, only blends show light two pixels away on all sides.
  if (first > 1.2 && wide_ones >= 5 && 4 * wide_ones >= candidates.size()) {
    const auto [sigma, n] = measure_all(signal, candidates, first);
    if (n >= 3) return sigma;
  }
  const auto [sigma, n] =
      densest_sigma(candidates, [&](const Candidate& c) { return narrow_sigma(signal, c, least); });
  return n >= 3 ? std::optional(sigma) : std::nullopt;
}

/// One star while the shape is being fitted.
struct Sample {
  double x;
  double y;
  double height;
};

/// Position and height of one star with the shape as it is.
bool fit_position(const Plane& signal, const Grid<std::uint8_t>& bad, const Psf& psf, int radius, Sample& s) {
  Patch patch;
  take_patch(signal, bad, s.x, s.y, radius, patch);
  for (int round = 0; round < 4; ++round) {
    const FitSums f = fit_sums(psf.profile(), patch, static_cast<float>(s.x), static_cast<float>(s.y),
                               static_cast<float>(s.height), 0);
    Eigen::Matrix3f normal;
    normal << f.xx, f.xy, f.xh, f.xy, f.yy, f.yh, f.xh, f.yh, f.hh;
    const Eigen::Vector3d step =
        normal.cast<double>().ldlt().solve(Eigen::Vector3f(f.rx, f.ry, f.rh).cast<double>());
    if (!step.allFinite() || std::hypot(step[0], step[1]) > 1.5) return false;
    s.x += step[0];
    s.y += step[1];
    s.height += step[2];
    if (!(s.height > 3)) return false;
    if (std::hypot(step[0], step[1]) < 1e-3) break;
  }
  return true;
}

/// One common shape for all samples: Gauss-Newton in the widths and gamma.
Psf::Shape fit_shape(const Plane& signal, const Grid<std::uint8_t>& bad, const std::vector<Sample>& samples,
                     Psf::Shape shape, int radius) {
  std::vector<Patch> patches(samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i)
    take_patch(signal, bad, samples[i].x, samples[i].y, radius, patches[i]);
  for (int round = 0; round < 12; ++round) {
    const Profile profile{static_cast<float>(shape.a), static_cast<float>(shape.b),
                          static_cast<float>(shape.c), static_cast<float>(shape.gamma)};
    Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
    Eigen::Vector4d right = Eigen::Vector4d::Zero();
    for (std::size_t i = 0; i < samples.size(); ++i) {
      // Neighbours and what the model lacks do not decide.
      const ShapeSums sums =
          shape_sums(profile, patches[i], static_cast<float>(samples[i].x), static_cast<float>(samples[i].y),
                     static_cast<float>(samples[i].height), 0.025F);
      std::size_t k = 0;
      for (int row = 0; row < 4; ++row) {
        right[row] += double(sums.right[static_cast<std::size_t>(row)]);
        for (int column = row; column < 4; ++column, ++k) {
          normal(row, column) += double(sums.normal[k]);
          if (column > row) normal(column, row) += double(sums.normal[k]);
        }
      }
    }
    normal(3, 3) += 25;  // gamma is 0.2 +- 0.2 where the stars do not say
    right(3) += 25 * (0.2 - shape.gamma);
    normal.diagonal() *= 1.0001;
    const Eigen::Vector4d step = normal.ldlt().solve(right);
    if (!step.allFinite()) break;
    const double size = std::sqrt(shape.a * shape.c);
    const double shorten =
        std::min(1.0, 0.3 * size / (std::abs(step[0]) + std::abs(step[1]) + std::abs(step[2]) + 1e-12));
    Psf::Shape next{shape.a + shorten * step[0], shape.b + shorten * step[1], shape.c + shorten * step[2],
                    std::clamp(shape.gamma + shorten * step[3], 0.0, 0.6)};
    if (next.a <= 0.005 || next.c <= 0.005 || next.a * next.c - next.b * next.b < 0.2 * next.a * next.c)
      break;
    const double moved =
        (std::abs(next.a - shape.a) + std::abs(next.b - shape.b) + std::abs(next.c - shape.c)) / size;
    const double turned = std::abs(next.gamma - shape.gamma);
    shape = next;
    if (moved < 1e-3 && turned < 2e-3) break;
  }
  return shape;
}

/// No other candidate of a tenth of its height within reach, and the whole patch in the frame and usable.
bool stands_alone(const Plane& signal, const Grid<std::uint8_t>& bad, const Candidate& c, double sigma) {
  const int reach = static_cast<int>(std::ceil(4 * sigma));
  if (c.x < reach || c.y < reach || c.x + reach >= signal.width() || c.y + reach >= signal.height())
    return false;
  for (int y = c.y - reach; y <= c.y + reach; ++y) {
    for (int x = c.x - reach; x <= c.x + reach; ++x) {
      const double r = std::hypot(x - c.x, y - c.y);
      if (bad.at(x, y) != 0) return false;
      if (r > 2.5 * sigma + 1 && double(signal.at(x, y)) > std::max(5.0, 0.15 * double(c.height)))
        return false;
    }
  }
  return true;
}

}  // namespace

Psf::Psf(const Shape& shape)
    : shape_(shape),
      a_(static_cast<float>(shape.a)),
      b_(static_cast<float>(shape.b)),
      c_(static_cast<float>(shape.c)),
      height_(table_size),
      slope_(table_size) {
  const double g = shape.gamma;
  const bool gaussian = g < 1e-3;
  for (std::size_t i = 0; i < table_size; ++i) {
    const double q = static_cast<double>(i) / double(table_per_q);
    const double height = gaussian ? std::exp(-q) : std::pow(1 + g * q, -1 / g);
    height_[i] = static_cast<float>(height);
    slope_[i] = static_cast<float>(gaussian ? -height : -height / (1 + g * q));
  }
  const double half = gaussian ? std::log(2.0) : (std::pow(2.0, g) - 1) / g;
  const double root = std::sqrt(shape.a * shape.c - shape.b * shape.b);
  fwhm_px_ = 2 * std::sqrt(half / root);
  flux_ = std::numbers::pi / root / (1 - g);
}

Psf Psf::round_gaussian(double fwhm_px) {
  const double k = 4 * std::log(2.0) / (fwhm_px * fwhm_px);
  return Psf({k, 0, k, 0});
}

int Psf::fit_radius() const {
  return std::clamp(static_cast<int>(std::ceil(1.25 * fwhm_px_)), 2, 12);
}

double Psf::radius_at(double height) const {
  const double g = shape_.gamma;
  const double q = g < 1e-3 ? -std::log(height) : (std::pow(height, -g) - 1) / g;
  return std::sqrt(q / std::sqrt(shape_.a * shape_.c - shape_.b * shape_.b));
}

namespace {

using SigmaOf = std::optional<double>(const Plane&, std::vector<Candidate>&, const Sharpest&);

/// The shape of the candidates that are as wide as @p sigma_of says, where that is at most @p sigma_most.
std::optional<Psf> shape_of_stars(const Plane& signal, const Grid<std::uint8_t>& bad,
                                  std::vector<Candidate> candidates, SigmaOf& sigma_of, double sigma_most,
                                  const Sharpest& least) {
  const auto sigma = sigma_of(signal, candidates, least);
  if (!sigma || *sigma > sigma_most) return std::nullopt;
  std::erase_if(candidates,
                [&](const Candidate& c) { return c.sigma < 0.75 * *sigma || c.sigma > 1.35 * *sigma; });
  std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
    return a.height != b.height ? a.height > b.height : (a.y != b.y ? a.y < b.y : a.x < b.x);
  });
  const double k = 0.5 / (*sigma * *sigma);
  Psf::Shape shape{k, 0, k, 0};
  std::vector<Sample> samples;
  {
    const Psf first(shape);
    const int radius = std::clamp(static_cast<int>(std::ceil(1.5 * *sigma)), 1, 6);
    for (const Candidate& c : candidates) {
      if (samples.size() >= stars_max) break;
      if (!stands_alone(signal, bad, c, *sigma)) continue;
      Sample s{double(c.x), double(c.y), double(c.height)};
      if (fit_position(signal, bad, first, radius, s)) samples.push_back(s);
    }
  }
  if (samples.size() < least.stars) return std::nullopt;
  for (int round = 0; round < 3; ++round) {
    const int radius = std::clamp(static_cast<int>(std::ceil((round == 0 ? 2.5 : 4) * *sigma)), 2, 14);
    shape = fit_shape(signal, bad, samples, shape, radius);
    const Psf psf(shape);
    std::erase_if(samples, [&](Sample& s) { return !fit_position(signal, bad, psf, psf.fit_radius(), s); });
    if (samples.size() < 3) return std::nullopt;
  }
  const double ratio = Psf(shape).fwhm_px() / (2.3548 * *sigma);
  const Psf psf(ratio < 0.7 || ratio > 1.6 ? Psf::Shape{k, 0, k, 0} : shape);
  return psf.fwhm_px() >= least.fwhm_px ? std::optional(psf) : std::nullopt;
}

}  // namespace

std::optional<Psf> measure_psf(const Plane& signal, const Grid<std::uint8_t>& bad, bool apart_from_light,
                               Optics optics) {
  const Sharpest& least = optics == Optics::usual ? usual : sharp;
  std::vector<Candidate> candidates = find_candidates(signal, bad, apart_from_light);
  std::erase_if(candidates, [&](const Candidate& c) { return !has_light_beside(signal, c, least); });
  auto psf = shape_of_stars(signal, bad, candidates, bright_sigma, sigma_most_px, least);
  if (!psf) psf = shape_of_stars(signal, bad, candidates, common_sigma, sigma_most_px, least);
  // Nothing in the sky is narrower than a star, and what is brightest may have been wide already.
  const double wide = psf ? std::min(sigma_most_px, double(psf->sigma_px())) : sigma_most_px;
  auto narrower = shape_of_stars(signal, bad, std::move(candidates), outshining_sigma, wide, least);
  return narrower && (!psf || narrower->fwhm_px() < clearly_narrower * psf->fwhm_px()) ? narrower : psf;
}

std::optional<double> width_of_brightest(const Plane& signal, const Grid<std::uint8_t>& bad,
                                         bool apart_from_light) {
  constexpr std::size_t enough = 9;
  std::vector<Candidate> candidates = find_candidates(signal, bad, apart_from_light);
  std::erase_if(candidates, [&](const Candidate& c) {
    return c.height < outshining.height || !has_light_beside(signal, c, usual);
  });
  std::sort(candidates.begin(), candidates.end(),
            [](const Candidate& a, const Candidate& b) { return a.height > b.height; });
  std::vector<float> widths;
  for (const Candidate& c : candidates) {
    auto sigma = wide_sigma(signal, c, 3);
    if (!sigma) sigma = wide_sigma(signal, c, 2);
    if (!sigma) sigma = narrow_sigma(signal, c, usual);
    if (sigma && *sigma < sigma_most_px && stands_alone(signal, bad, c, *sigma))
      widths.push_back(static_cast<float>(2.3548 * *sigma));
    if (widths.size() >= enough) break;
  }
  if (widths.empty()) return std::nullopt;
  // Nothing in the sky is narrower than a star; other things are wider.
  const auto quarter = widths.begin() + static_cast<std::ptrdiff_t>(widths.size() / 4);
  std::nth_element(widths.begin(), quarter, widths.end());
  return double(*quarter);
}

}  // namespace srfs::image
