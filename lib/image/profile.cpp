#include "image/profile.hpp"

#include <bit>
#include <cstdint>

#include "image/simd.hpp"

namespace srfs::image {
namespace {

constexpr float gaussian_below = 0.004F;

/// 2^x for x <= 0.
inline float power_of_two(float x) {
  constexpr float to_integer = 12582912.0F;  // 1.5 * 2^23: the sum's last bit is worth 1
  x = x < -126.0F ? -126.0F : x;
  const float shifted = x + to_integer;
  const std::int32_t exponent =
      std::bit_cast<std::int32_t>(shifted) - std::bit_cast<std::int32_t>(to_integer);
  const float f = x - (shifted - to_integer);
  const float p =
      1 + f * (0.69314718F + f * (0.24022651F + f * (0.05550411F + f * (0.00961813F + f * 0.00133336F))));
  return std::bit_cast<float>((exponent + 127) << 23) * p;
}

/// log2(u) for u >= 1, finite. The polynomial is that of the Cephes library's logf.
inline float log_of_two(float u) {
  const std::int32_t bits = std::bit_cast<std::int32_t>(u);
  const std::int32_t exponent = (bits - 0x3F3504F3) >> 23;  // so that the rest is 0.707 to 1.414
  const float t = std::bit_cast<float>(bits - (exponent << 23)) - 1;
  float p = 7.0376836292E-2F;
  p = p * t - 1.1514610310E-1F;
  p = p * t + 1.1676998740E-1F;
  p = p * t - 1.2420140846E-1F;
  p = p * t + 1.4249322787E-1F;
  p = p * t - 1.6668057665E-1F;
  p = p * t + 2.0000714765E-1F;
  p = p * t - 2.4999993993E-1F;
  p = p * t + 3.3333331174E-1F;
  return (t - 0.5F * t * t + t * t * t * p) * 1.44269504F + static_cast<float>(exponent);
}

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

// The bodies are inlined into each of the compiled variants below.

template <class Height>
[[gnu::always_inline]] inline FitSums sum_fit(const Height f, const Patch& patch, float x, float y,
                                              float height, float shot) {
  float xx = 0, xy = 0, yy = 0, xh = 0, yh = 0, hh = 0, rx = 0, ry = 0, rh = 0, energy = 0;
  const int n = patch.width;
  const float left = static_cast<float>(patch.x0) - x;
  for (int j = 0; j < patch.rows; ++j) {
    const float* light = patch.light.data() + static_cast<std::ptrdiff_t>(j) * n;
    const float* use = patch.use.data() + static_cast<std::ptrdiff_t>(j) * n;
    const float dy = static_cast<float>(patch.y0 + j) - y;
#pragma omp simd reduction(+ : xx, xy, yy, xh, yh, hh, rx, ry, rh, energy)
    for (int i = 0; i < n; ++i) {
      const float dx = left + static_cast<float>(i);
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
  }
  return {xx, xy, yy, xh, yh, hh, rx, ry, rh, energy};
}

template <class Height>
[[gnu::always_inline]] inline WidthSums sum_width(const Height f, const Patch& patch, float x, float y,
                                                  float height, float narrower, float shot) {
  float ss = 0, sh = 0, hh = 0, rs = 0, rh = 0;
  const int n = patch.width;
  const float left = static_cast<float>(patch.x0) - x;
  for (int j = 0; j < patch.rows; ++j) {
    const float* light = patch.light.data() + static_cast<std::ptrdiff_t>(j) * n;
    const float* use = patch.use.data() + static_cast<std::ptrdiff_t>(j) * n;
    const float dy = static_cast<float>(patch.y0 + j) - y;
#pragma omp simd reduction(+ : ss, sh, hh, rs, rh)
    for (int i = 0; i < n; ++i) {
      const float dx = left + static_cast<float>(i);
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
  }
  return {ss, sh, hh, rs, rh};
}

template <class Height>
[[gnu::always_inline]] inline void fill_heights(const Height f, const Patch& patch, float x, float y,
                                                float* out) {
  const int n = patch.width;
  const float left = static_cast<float>(patch.x0) - x;
  for (int j = 0; j < patch.rows; ++j) {
    const float dy = static_cast<float>(patch.y0 + j) - y;
    float* to = out + static_cast<std::ptrdiff_t>(j) * n;
#pragma omp simd
    for (int i = 0; i < n; ++i) {
      const float dx = left + static_cast<float>(i);
      to[i] = f(f.a * dx * dx + 2 * f.b * dx * dy + f.c * dy * dy).height;
    }
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
void add_profile(const Profile& profile, float height, float dx, float dy, float* row, int n) {
  if (profile.gamma < gaussian_below)
    add_row(Gaussian(profile), height, dx, dy, row, n);
  else
    add_row(Moffat(profile), height, dx, dy, row, n);
}

}  // namespace srfs::image
