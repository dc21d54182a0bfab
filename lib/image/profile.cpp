// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/profile.hpp"

#include <algorithm>
#include <cmath>

#include "image/simd.hpp"
#include "image/vector_math.hpp"

namespace srfs::image {
namespace {

constexpr float gaussian_below = 0.004F;

struct Shape {
  float a, b, c, gamma, exponent;
};

struct HeightAndSlope {
  float height;
  float slope;  ///< d height / d q
};

struct Gaussian : Shape {
  explicit Gaussian(const Profile& p) : Shape{p.a, p.b, p.c, 0, -1.44269504F} {}
  [[nodiscard]] HeightAndSlope operator()(float q) const {
    const float h = power_of_two(exponent * q);
    return {h, -h};
  }
};

struct Moffat : Shape {
  explicit Moffat(const Profile& p) : Shape{p.a, p.b, p.c, p.gamma, -1 / p.gamma} {}
  [[nodiscard]] HeightAndSlope operator()(float q) const {
    const float u = 1 + gamma * q;
    const float h = power_of_two(exponent * log_of_two(u));
    return {h, -h / u};
  }
};

/// A patch's pixels, beside a star at (x, y) of the frame.
struct Places {
  Places(const Patch& patch, float x, float y)
      : dx(patch.dx.data()),
        dy(patch.dy.data()),
        left(static_cast<float>(patch.x) - x),
        up(static_cast<float>(patch.y) - y),
        n(static_cast<int>(patch.size()) / Patch::lanes * Patch::lanes) {}
  const float* dx;
  const float* dy;
  float left;
  float up;
  int n;
};

// The bodies are inlined into each of the compiled variants below.

template <class Height>
[[gnu::always_inline]] inline FitSums sum_fit(const Height f, const Patch& patch, float x, float y,
                                              float height, float shot) {
  float xx = 0, xy = 0, yy = 0, xh = 0, yh = 0, hh = 0, rx = 0, ry = 0, rh = 0, energy = 0;
  const Places at(patch, x, y);
  const float* const light = patch.light.data();
  const float* const use = patch.use.data();
#pragma omp simd reduction(+ : xx, xy, yy, xh, yh, hh, rx, ry, rh, energy)
  for (int i = 0; i < at.n; ++i) {
    const float dx = at.dx[i] + at.left;
    const float dy = at.dy[i] + at.up;
    const float ax = f.a * dx + f.b * dy;
    const float ay = f.b * dx + f.c * dy;
    const auto [p, slope] = f(dx * ax + dy * ay);
    const float s = -2 * height * slope;
    const float gx = s * ax;
    const float gy = s * ay;
    const float weight = use[i] / (1 + shot * height * p);
    const float r = weight * (light[i] - height * p);
    xx += weight * gx * gx;
    xy += weight * gx * gy;
    yy += weight * gy * gy;
    xh += weight * gx * p;
    yh += weight * gy * p;
    hh += weight * p * p;
    rx += gx * r;
    ry += gy * r;
    rh += p * r;
    energy += use[i] * p * p;
  }
  return {xx, xy, yy, xh, yh, hh, rx, ry, rh, energy};
}

template <class Height>
[[gnu::always_inline]] inline WidthSums sum_width(const Height f, const Patch& patch, float x, float y,
                                                  float height, float narrower, float shot) {
  float ss = 0, sh = 0, hh = 0, rs = 0, rh = 0;
  const Places at(patch, x, y);
  const float* const light = patch.light.data();
  const float* const use = patch.use.data();
#pragma omp simd reduction(+ : ss, sh, hh, rs, rh)
  for (int i = 0; i < at.n; ++i) {
    const float dx = at.dx[i] + at.left;
    const float dy = at.dy[i] + at.up;
    const float q = narrower * (f.a * dx * dx + 2 * f.b * dx * dy + f.c * dy * dy);
    const auto [p, slope] = f(q);
    const float g = -2 * height * slope * q;
    const float weight = use[i] / (1 + shot * height * p);
    const float r = weight * (light[i] - height * p);
    ss += weight * g * g;
    sh += weight * g * p;
    hh += weight * p * p;
    rs += g * r;
    rh += p * r;
  }
  return {ss, sh, hh, rs, rh};
}

template <class Height>
[[gnu::always_inline]] inline ShapeSums sum_shape(const Height f, const Patch& patch, float x, float y,
                                                  float height, float model_error) {
  float aa = 0, ab = 0, ac = 0, ag = 0, bb = 0, bc = 0, bg = 0, cc = 0, cg = 0, gg = 0, ra = 0, rb = 0,
        rc = 0, rg = 0;
  const Places at(patch, x, y);
  const float gamma = f.gamma > 0.05F ? f.gamma : 0.05F;  // its derivative hardly changes below
  const float variance = 1 + model_error * model_error * height * height;
  const float* const light = patch.light.data();
  const float* const use = patch.use.data();
#pragma omp simd reduction(+ : aa, ab, ac, ag, bb, bc, bg, cc, cg, gg, ra, rb, rc, rg)
  for (int i = 0; i < at.n; ++i) {
    const float dx = at.dx[i] + at.left;
    const float dy = at.dy[i] + at.up;
    const float q = f.a * dx * dx + 2 * f.b * dx * dy + f.c * dy * dy;
    const auto [p, slope] = f(q);
    const float u = 1 + gamma * q;
    const float by_a = height * slope * dx * dx;
    const float by_b = height * slope * 2 * dx * dy;
    const float by_c = height * slope * dy * dy;
    const float by_gamma = height * p * (0.69314718F * log_of_two(u) / (gamma * gamma) - q / (gamma * u));
    const float r = light[i] - height * p;
    const float error = std::sqrt(variance);
    const float size = std::abs(r) + 1e-9F;
    const float robust = 3 * error < size ? 3 * error / size : 1.0F;
    const float weight = use[i] * robust / variance;
    aa += weight * by_a * by_a;
    ab += weight * by_a * by_b;
    ac += weight * by_a * by_c;
    ag += weight * by_a * by_gamma;
    bb += weight * by_b * by_b;
    bc += weight * by_b * by_c;
    bg += weight * by_b * by_gamma;
    cc += weight * by_c * by_c;
    cg += weight * by_c * by_gamma;
    gg += weight * by_gamma * by_gamma;
    ra += weight * r * by_a;
    rb += weight * r * by_b;
    rc += weight * r * by_c;
    rg += weight * r * by_gamma;
  }
  return {{aa, ab, ac, ag, bb, bc, bg, cc, cg, gg}, {ra, rb, rc, rg}};
}

template <class Height>
[[gnu::always_inline]] inline void fill_heights(const Height f, const Patch& patch, float x, float y,
                                                float* out) {
  const Places at(patch, x, y);
#pragma omp simd
  for (int i = 0; i < at.n; ++i) {
    const float dx = at.dx[i] + at.left;
    const float dy = at.dy[i] + at.up;
    out[i] = f(f.a * dx * dx + 2 * f.b * dx * dy + f.c * dy * dy).height;
  }
}

template <class Height>
[[gnu::always_inline]] inline void fill_gradients(const Height f, const Patch& patch, float x, float y,
                                                  float* height, float* by_x, float* by_y) {
  const Places at(patch, x, y);
#pragma omp simd
  for (int i = 0; i < at.n; ++i) {
    const float dx = at.dx[i] + at.left;
    const float dy = at.dy[i] + at.up;
    const float ax = f.a * dx + f.b * dy;
    const float ay = f.b * dx + f.c * dy;
    const auto [h, slope] = f(dx * ax + dy * ay);
    height[i] = h;
    by_x[i] = -2 * slope * ax;
    by_y[i] = -2 * slope * ay;
  }
}

template <class Height>
[[gnu::always_inline]] inline void add_row(const Height f, float height, float left, float dy, float* row,
                                           int n) {
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const float dx = left + static_cast<float>(i);
    row[i] += height * f(f.a * dx * dx + 2 * f.b * dx * dy + f.c * dy * dy).height;
  }
}

}  // namespace

namespace {

/// The places of a patch's pixels.
void lay_out(int radius, Patch& patch) {
  patch.radius = radius;
  patch.half.clear();
  patch.dx.clear();
  patch.dy.clear();
  const double reach = radius + 0.5;
  for (int j = -radius; j <= radius; ++j) {
    const int half = static_cast<int>(std::sqrt(reach * reach - j * j));
    patch.half.push_back(half);
    for (int i = -half; i <= half; ++i) {
      patch.dx.push_back(static_cast<float>(i));
      patch.dy.push_back(static_cast<float>(j));
    }
  }
  const std::size_t padded = (patch.dx.size() + Patch::lanes - 1) / Patch::lanes * Patch::lanes;
  for (std::vector<float>* values : {&patch.dx, &patch.dy}) values->resize(padded);
  // Rows are copied by whole lanes.
  for (std::vector<float>* values : {&patch.light, &patch.use}) values->assign(padded + Patch::lanes, 0);
}

struct Row {
  const float* light;
  const std::uint8_t* flaws;
};

[[gnu::always_inline]] inline void copy_pixels(const Row& row, int n, float* light, float* use) {
  for (int i = 0; i < n; ++i) {
    light[i] = row.light[i];
    use[i] = row.flaws[i] == 0 ? 1.0F : 0.0F;
  }
}

/// Rows that are all in the frame, with as many pixels behind them as fill the lanes: what is copied too much
/// the next row overwrites.
SRFS_VECTORISED
void copy_rows(const Row& middle, std::ptrdiff_t step, Patch& patch) {
  float* light = patch.light.data();
  float* use = patch.use.data();
  for (int j = -patch.radius; j <= patch.radius; ++j) {
    const int half = patch.half[static_cast<std::size_t>(j + patch.radius)];
    const Row row{middle.light + j * step - half, middle.flaws + j * step - half};
    const int width = 2 * half + 1;
    for (int i = 0; i < width; i += Patch::lanes)
      copy_pixels({row.light + i, row.flaws + i}, Patch::lanes, light + i, use + i);
    light += width;
    use += width;
  }
  std::fill(use, patch.use.data() + patch.use.size(), 0.0F);
}

}  // namespace

void take_patch(const Grid<float>& light, const Grid<std::uint8_t>& flaws, double x, double y, int radius,
                Patch& patch) {
  if (patch.radius != radius) lay_out(radius, patch);
  patch.x = static_cast<int>(std::lround(x));
  patch.y = static_cast<int>(std::lround(y));
  if (patch.x >= radius && patch.x + radius + Patch::lanes < light.width() && patch.y >= radius &&
      patch.y + radius < light.height()) {
    copy_rows({light.row(patch.y) + patch.x, flaws.row(patch.y) + patch.x}, light.width(), patch);
    return;
  }
  float* to = patch.light.data();
  float* use = patch.use.data();
  for (int j = -radius; j <= radius; ++j) {
    const int half = patch.half[static_cast<std::size_t>(j + radius)];
    const int width = 2 * half + 1;
    const int row = patch.y + j;
    const bool inside = row >= 0 && row < light.height();
    const int from = inside ? std::clamp(patch.x - half, 0, light.width()) : 0;
    const int end = inside ? std::clamp(patch.x + half + 1, from, light.width()) : 0;
    if (end - from < width) {
      std::fill_n(to, width, 0.0F);
      std::fill_n(use, width, 0.0F);
    }
    if (from < end) {
      const int before = from - (patch.x - half);
      copy_pixels({light.row(row) + from, flaws.row(row) + from}, end - from, to + before, use + before);
    }
    to += width;
    use += width;
  }
}

SRFS_VECTORISED
ShapeSums shape_sums(const Profile& profile, const Patch& patch, float x, float y, float height,
                     float model_error) {
  return profile.gamma < gaussian_below ? sum_shape(Gaussian(profile), patch, x, y, height, model_error)
                                        : sum_shape(Moffat(profile), patch, x, y, height, model_error);
}

SRFS_VECTORISED
FitSums fit_sums(const Profile& profile, const Patch& patch, float x, float y, float height, float shot) {
  return profile.gamma < gaussian_below ? sum_fit(Gaussian(profile), patch, x, y, height, shot)
                                        : sum_fit(Moffat(profile), patch, x, y, height, shot);
}

SRFS_VECTORISED
WidthSums width_sums(const Profile& profile, const Patch& patch, float x, float y, float height,
                     float narrower, float shot) {
  return profile.gamma < gaussian_below ? sum_width(Gaussian(profile), patch, x, y, height, narrower, shot)
                                        : sum_width(Moffat(profile), patch, x, y, height, narrower, shot);
}

SRFS_VECTORISED
void profile_heights(const Profile& profile, const Patch& patch, float x, float y, std::vector<float>& out) {
  out.resize(patch.size());
  if (profile.gamma < gaussian_below)
    fill_heights(Gaussian(profile), patch, x, y, out.data());
  else
    fill_heights(Moffat(profile), patch, x, y, out.data());
}

SRFS_VECTORISED
void profile_gradients(const Profile& profile, const Patch& patch, float x, float y, ProfileGradients& out) {
  for (std::vector<float>* values : {&out.height, &out.x, &out.y}) values->resize(patch.size());
  if (profile.gamma < gaussian_below)
    fill_gradients(Gaussian(profile), patch, x, y, out.height.data(), out.x.data(), out.y.data());
  else
    fill_gradients(Moffat(profile), patch, x, y, out.height.data(), out.x.data(), out.y.data());
}

SRFS_VECTORISED
PairSums pair_sums(const std::array<ProfileGradients, 2>& stars, const Patch& patch,
                   const std::array<float, 2>& heights, float shot) {
  PairSums sums{};
  constexpr int lanes = Patch::lanes;
  std::array<std::array<float, lanes>, 28> totals{};
  const float* const light = patch.light.data();
  const float* const use = patch.use.data();
  const std::array<const float*, 2> h{stars[0].height.data(), stars[1].height.data()};
  const std::array<const float*, 2> gx{stars[0].x.data(), stars[1].x.data()};
  const std::array<const float*, 2> gy{stars[0].y.data(), stars[1].y.data()};
  std::array<std::array<float, lanes>, 6> g;
  std::array<float, lanes> weight;
  std::array<float, lanes> residuum;
  for (std::size_t at = 0; at < patch.size(); at += lanes) {
#pragma omp simd
    for (std::size_t i = 0; i < lanes; ++i) {
      g[0][i] = heights[0] * gx[0][at + i];
      g[1][i] = heights[0] * gy[0][at + i];
      g[2][i] = h[0][at + i];
      g[3][i] = heights[1] * gx[1][at + i];
      g[4][i] = heights[1] * gy[1][at + i];
      g[5][i] = h[1][at + i];
      const float model = heights[0] * g[2][i] + heights[1] * g[5][i];
      weight[i] = use[at + i] / (1 + shot * (model > 0 ? model : 0.0F));
      residuum[i] = light[at + i] - model;
    }
    std::size_t k = 0;
    for (std::size_t a = 0; a < 6; ++a) {
      std::array<float, lanes> weighted;
#pragma omp simd
      for (std::size_t i = 0; i < lanes; ++i) weighted[i] = weight[i] * g[a][i];
      for (std::size_t b = a; b < 6; ++b, ++k) {
#pragma omp simd
        for (std::size_t i = 0; i < lanes; ++i) totals[k][i] += weighted[i] * g[b][i];
      }
#pragma omp simd
      for (std::size_t i = 0; i < lanes; ++i) totals[21 + a][i] += weighted[i] * residuum[i];
    }
#pragma omp simd
    for (std::size_t i = 0; i < lanes; ++i) totals[27][i] += weight[i] * residuum[i] * residuum[i];
  }
  const auto sum = [&totals](std::size_t k) {
    float all = 0;
    for (const float v : totals[k]) all += v;
    return all;
  };
  for (std::size_t k = 0; k < sums.normal.size(); ++k) sums.normal[k] = sum(k);
  for (std::size_t k = 0; k < sums.right.size(); ++k) sums.right[k] = sum(21 + k);
  sums.mismatch = sum(27);
  return sums;
}

SRFS_VECTORISED
void add_profile(const Profile& profile, float height, float dx, float dy, float* row, int n) {
  if (profile.gamma < gaussian_below)
    add_row(Gaussian(profile), height, dx, dy, row, n);
  else
    add_row(Moffat(profile), height, dx, dy, row, n);
}

}  // namespace srfs::image
