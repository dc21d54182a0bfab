// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/line_profile.hpp"

#include <algorithm>
#include <cmath>

#include "image/simd.hpp"
#include "image/vector_math.hpp"

namespace srfs::image {
namespace {

constexpr int block = 256;
constexpr std::size_t parameters = LineSums::parameters;

/// One block of pixels: what the sums are made of.
struct Terms {
  alignas(64) std::array<std::array<float, block>, parameters> gradient;
  alignas(64) std::array<float, block> residuum;
  alignas(64) std::array<float, block> weight;
  alignas(64) std::array<float, block> unit;  ///< light for height 1
};

struct Place {
  float along;
  float across;
};

[[gnu::always_inline]] inline Place place_of(const LineShape& l, float x, float y) {
  const float dx = x - l.x;
  const float dy = y - l.y;
  return {dx * l.ux + dy * l.uy, dy * l.ux - dx * l.uy};
}

[[gnu::always_inline]] inline void fill_terms(const LineShape l, const float* x, const float* y,
                                              const float* light, int n, const LineNoise noise, Terms& t) {
  const float per_along = 1 / l.sigma_along;
  const float per_across = 1 / l.sigma_across;
  constexpr float density = 0.39894228F;  // of a normal distribution in its middle
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const Place p = place_of(l, x[i], y[i]);
    const float u1 = (p.along - l.from) * per_along;
    const float u2 = (p.along - l.to) * per_along;
    const float b1 = bell(u1);
    const float b2 = bell(u2);
    const float v = p.across * per_across;
    const float across = bell(v);
    const float inside = share_below(u1, b1) - share_below(u2, b2);
    const float unit = inside * across;
    const float model = l.height * unit;
    const float by_offset = model * v * per_across;
    t.gradient[0][i] = -l.height * density * per_along * b1 * across;
    t.gradient[1][i] = l.height * density * per_along * b2 * across;
    t.gradient[2][i] = by_offset;
    t.gradient[3][i] = by_offset * p.along;
    t.gradient[4][i] = unit;
    t.gradient[5][i] = model * v * v * per_across;
    const float size = model < 0 ? -model : model;
    const float variance = 1 + noise.shot * size + noise.model_error * noise.model_error * model * model;
    const float r = light[i] - model;
    const float far = r * r / variance;
    // Three errors away: less.
    t.weight[i] = (far > 9 ? 3 / std::sqrt(far) : 1.0F) / variance;
    t.residuum[i] = r;
    t.unit[i] = unit;
  }
}

/// Four sums of products at a time: they do not wait for each other, and more do not stay in registers.
[[gnu::always_inline]] inline std::array<float, 4> dots(const float* with,
                                                        const std::array<const float*, 4>& of, int n) {
  const auto [a, b, c, d] = of;
  float with_a = 0, with_b = 0, with_c = 0, with_d = 0;
#pragma omp simd reduction(+ : with_a, with_b, with_c, with_d)
  for (int i = 0; i < n; ++i) {
    with_a += with[i] * a[i];
    with_b += with[i] * b[i];
    with_c += with[i] * c[i];
    with_d += with[i] * d[i];
  }
  return {with_a, with_b, with_c, with_d};
}

}  // namespace

SRFS_VECTORISED
LineSums line_sums(const LineShape& line, const LinePixels& pixels, const LineNoise& noise, bool with_ends) {
  LineSums sums;
  Terms t;
  std::array<float, block> weighted;
  const int size = static_cast<int>(pixels.size());
  for (int from = 0; from < size; from += block) {
    const int n = std::min(block, size - from);
    fill_terms(line, pixels.x.data() + from, pixels.y.data() + from, pixels.light.data() + from, n, noise, t);
    for (std::size_t a = with_ends ? 0 : 2; a < parameters; ++a) {
#pragma omp simd
      for (int i = 0; i < n; ++i) weighted[i] = t.weight[i] * t.gradient[a][i];
      // The products by pairs that are left, and with the residuum, four at a time.
      const auto factor = [&](std::size_t k) {
        return k < parameters ? t.gradient[k].data() : t.residuum.data();
      };
      for (std::size_t b = a; b <= parameters; b += 4) {
        const auto of = dots(weighted.data(), {factor(b), factor(b + 1), factor(b + 2), factor(b + 3)}, n);
        for (std::size_t k = 0; k < of.size() && b + k <= parameters; ++k)
          (b + k < parameters ? sums.normal[a][b + k] : sums.right[a]) += double(of[k]);
      }
    }
    const float* unit = t.unit.data();
    sums.energy += double(dots(unit, {unit, unit, unit, unit}, n)[0]);
  }
  return sums;
}

SRFS_VECTORISED
double line_mismatch(const LineShape& line, float model, const LinePixels& pixels, const LineNoise& noise) {
  Terms t;
  double sum = 0;
  const int size = static_cast<int>(pixels.size());
  for (int from = 0; from < size; from += block) {
    const int n = std::min(block, size - from);
    const float* light = pixels.light.data() + from;
    fill_terms(line, pixels.x.data() + from, pixels.y.data() + from, light, n, noise, t);
    float part = 0;
#pragma omp simd reduction(+ : part)
    for (int i = 0; i < n; ++i) {
      const float expected = line.height * t.unit[i];
      const float size_of = expected < 0 ? -expected : expected;
      const float variance =
          1 + noise.shot * size_of + noise.model_error * noise.model_error * expected * expected;
      const float r = light[i] - model * expected;
      part += r * r / variance;
    }
    sum += double(part);
  }
  return sum;
}

SRFS_VECTORISED
void line_places(const LineShape& line, const LinePixels& pixels, std::vector<float>& along,
                 std::vector<float>& endless) {
  along.resize(pixels.size());
  endless.resize(pixels.size());
  const float per_across = 1 / line.sigma_across;
  const int n = static_cast<int>(pixels.size());
  const float* x = pixels.x.data();
  const float* y = pixels.y.data();
  float* to_along = along.data();
  float* to_endless = endless.data();
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const Place p = place_of(line, x[i], y[i]);
    to_along[i] = p.along;
    to_endless[i] = bell(p.across * per_across);
  }
}

SRFS_VECTORISED
void line_heights(const LineShape& line, const LinePixels& pixels, std::vector<float>& out) {
  out.resize(pixels.size());
  const float per_along = 1 / line.sigma_along;
  const float per_across = 1 / line.sigma_across;
  const int n = static_cast<int>(pixels.size());
  const float* x = pixels.x.data();
  const float* y = pixels.y.data();
  float* to = out.data();
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const Place p = place_of(line, x[i], y[i]);
    const float u1 = (p.along - line.from) * per_along;
    const float u2 = (p.along - line.to) * per_along;
    to[i] = (share_below(u1, bell(u1)) - share_below(u2, bell(u2))) * bell(p.across * per_across);
  }
}

}  // namespace srfs::image
