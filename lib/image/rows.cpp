// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/rows.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "image/simd.hpp"

namespace srfs::image {
namespace {

constexpr float largest = std::numeric_limits<float>::max();
constexpr int chunk = 32;  ///< pixels that are processed together

template <int Radius>
[[gnu::always_inline]] inline void filter_columns(const float* const* rows, const float* taps, float* out,
                                                  int n) {
  std::array<const float*, 2 * Radius + 1> r;
  for (int i = 0; i <= 2 * Radius; ++i) r[i] = rows[i];
  std::array<float, Radius + 1> t;
  for (int i = 0; i <= Radius; ++i) t[i] = taps[i];
#pragma omp simd
  for (int x = 0; x < n; ++x) {
    float sum = t[0] * r[Radius][x];
#pragma GCC unroll 16
    for (int i = 1; i <= Radius; ++i) sum += t[i] * (r[Radius - i][x] + r[Radius + i][x]);
    out[x] = sum;
  }
}

template <int Radius>
[[gnu::always_inline]] inline void filter_along(const float* row, const float* taps, float* out, int n) {
  std::array<float, Radius + 1> t;
  for (int i = 0; i <= Radius; ++i) t[i] = taps[i];
#pragma omp simd
  for (int x = 0; x < n; ++x) {
    float sum = t[0] * row[x];
#pragma GCC unroll 16
    for (int i = 1; i <= Radius; ++i) sum += t[i] * (row[x - i] + row[x + i]);
    out[x] = sum;
  }
}

}  // namespace

SRFS_VECTORISED
Moments clipped_moments(const float* row, int n, float centre, float reach) {
  float count = 0, sum = 0, squares = 0;
#pragma omp simd reduction(+ : count, sum, squares)
  for (int i = 0; i < n; ++i) {
    const float d = row[i] - centre;
    const bool near = std::abs(d) <= reach;
    const float v = near ? d : 0.0F;
    count += near ? 1.0F : 0.0F;
    sum += v;
    squares += v * v;
  }
  return {count, sum, squares};
}

SRFS_VECTORISED
Moments clipped_moments(const float* row, const std::uint8_t* masked, int n, float centre, float reach) {
  float count = 0, sum = 0, squares = 0;
#pragma omp simd reduction(+ : count, sum, squares)
  for (int i = 0; i < n; ++i) {
    const float d = row[i] - centre;
    const float used = masked[i] != 0 ? -1.0F : reach;
    const bool near = std::abs(d) <= used;
    const float v = near ? d : 0.0F;
    count += near ? 1.0F : 0.0F;
    sum += v;
    squares += v * v;
  }
  return {count, sum, squares};
}

SRFS_VECTORISED
Extent extent_of(const float* row, int n) {
  float low = largest, high = -largest, bad = 0;
#pragma omp simd reduction(min : low) reduction(max : high) reduction(+ : bad)
  for (int i = 0; i < n; ++i) {
    const bool finite = std::abs(row[i]) <= largest;
    const float a = finite ? row[i] : largest;
    const float b = finite ? row[i] : -largest;
    low = a < low ? a : low;
    high = b > high ? b : high;
    bad += finite ? 0.0F : 1.0F;
  }
  return {low, high, bad == 0};
}

SRFS_VECTORISED
void normalise(const float* in, const float* level, const float* noise, float noise_floor, float* out,
               int n) {
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const float v = in[i] - level[i];
    const float unit = noise[i] > noise_floor ? noise[i] : noise_floor;
    out[i] = std::abs(v) <= largest ? v / unit : 0.0F;
  }
}

SRFS_VECTORISED
void hide_pixels(const float* in, const std::uint8_t* hidden, float* out, int n) {
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const float v = in[i];
    out[i] = hidden[i] != 0 ? 0.0F : v;
  }
}

SRFS_VECTORISED
void scale_down(float* row, const float* noise, float noise_floor, int n) {
#pragma omp simd
  for (int i = 0; i < n; ++i) row[i] /= noise[i] > noise_floor ? noise[i] : noise_floor;
}

SRFS_VECTORISED
void fill_cubic(const float* coefficients, float start, float unit, float* out, int n) {
  const float a = coefficients[0], b = coefficients[1], c = coefficients[2], d = coefficients[3];
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const float t = start + unit * static_cast<float>(i);
    out[i] = a + t * (b + t * (c + t * d));
  }
}

SRFS_VECTORISED
void subtract(float* row, const float* level, int n) {
#pragma omp simd
  for (int i = 0; i < n; ++i) row[i] -= level[i];
}

SRFS_VECTORISED
void clip_row(const float* in, float limit, float* out, int n) {
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const float v = in[i] < limit ? in[i] : limit;
    out[i] = v > -limit ? v : -limit;
  }
}

SRFS_VECTORISED
void add_row(const float* row, float* to, int n) {
#pragma omp simd
  for (int i = 0; i < n; ++i) to[i] += row[i];
}

SRFS_VECTORISED
void find_above(const float* row, float limit, int n, std::vector<int>& found) {
  found.clear();
  for (int from = 0; from < n; from += chunk) {
    const int end = std::min(n, from + chunk);
    float highest = row[from];
#pragma omp simd reduction(max : highest)
    for (int i = from; i < end; ++i) highest = row[i] > highest ? row[i] : highest;
    if (!(highest > limit)) continue;
    for (int i = from; i < end; ++i) {
      if (row[i] > limit) found.push_back(i);
    }
  }
}

SRFS_VECTORISED
void find_above(const float* row, const float* limit, int n, std::vector<int>& found) {
  found.clear();
  for (int from = 0; from < n; from += chunk) {
    const int end = std::min(n, from + chunk);
    float highest = row[from] - limit[from];
#pragma omp simd reduction(max : highest)
    for (int i = from; i < end; ++i) {
      const float over = row[i] - limit[i];
      highest = over > highest ? over : highest;
    }
    if (!(highest > 0)) continue;
    for (int i = from; i < end; ++i) {
      if (row[i] > limit[i]) found.push_back(i);
    }
  }
}

SRFS_VECTORISED
Moments add_near_zero(const float* row, float reach, float* sums, float* counts, int n) {
  float all = 0, sum = 0;
#pragma omp simd reduction(+ : all, sum)
  for (int i = 0; i < n; ++i) {
    const bool near = std::abs(row[i]) < reach;
    const float v = near ? row[i] : 0.0F;
    const float one = near ? 1.0F : 0.0F;
    sums[i] += v;
    counts[i] += one;
    sum += v;
    all += one;
  }
  return {all, sum, 0};
}

SRFS_VECTORISED
int count_below(const float* row, float limit, int n) {
  int count = 0;
#pragma omp simd reduction(+ : count)
  for (int i = 0; i < n; ++i) count += row[i] < limit ? 1 : 0;
  return count;
}

SRFS_VECTORISED
void filter_column(const float* const* rows, const float* taps, int radius, float* out, int n) {
  switch (radius) {
    case 1:
      return filter_columns<1>(rows, taps, out, n);
    case 2:
      return filter_columns<2>(rows, taps, out, n);
    case 3:
      return filter_columns<3>(rows, taps, out, n);
    case 4:
      return filter_columns<4>(rows, taps, out, n);
    case 5:
      return filter_columns<5>(rows, taps, out, n);
    case 6:
      return filter_columns<6>(rows, taps, out, n);
    case 7:
      return filter_columns<7>(rows, taps, out, n);
    default:
      break;
  }
  const float* middle = rows[radius];
#pragma omp simd
  for (int x = 0; x < n; ++x) out[x] = taps[0] * middle[x];
  for (int i = 1; i <= radius; ++i) {
    const float* above = rows[radius - i];
    const float* below = rows[radius + i];
    const float t = taps[i];
#pragma omp simd
    for (int x = 0; x < n; ++x) out[x] += t * (above[x] + below[x]);
  }
}

SRFS_VECTORISED
void filter_row(const float* row, const float* taps, int radius, float* out, int n) {
  switch (radius) {
    case 1:
      return filter_along<1>(row, taps, out, n);
    case 2:
      return filter_along<2>(row, taps, out, n);
    case 3:
      return filter_along<3>(row, taps, out, n);
    case 4:
      return filter_along<4>(row, taps, out, n);
    case 5:
      return filter_along<5>(row, taps, out, n);
    case 6:
      return filter_along<6>(row, taps, out, n);
    case 7:
      return filter_along<7>(row, taps, out, n);
    default:
      break;
  }
#pragma omp simd
  for (int x = 0; x < n; ++x) out[x] = taps[0] * row[x];
  for (int i = 1; i <= radius; ++i) {
    const float t = taps[i];
#pragma omp simd
    for (int x = 0; x < n; ++x) out[x] += t * (row[x - i] + row[x + i]);
  }
}

SRFS_VECTORISED
void add_sums(const std::int16_t* first, const std::int16_t* second, std::int16_t* to, int n) {
#pragma omp simd
  for (int i = 0; i < n; ++i) to[i] = static_cast<std::int16_t>(first[i] + second[i]);
}

SRFS_VECTORISED
std::int16_t highest_of(const std::int16_t* values, int n) {
  std::int16_t highest = values[0];
#pragma omp simd reduction(max : highest)
  for (int i = 0; i < n; ++i) highest = values[i] > highest ? values[i] : highest;
  return highest;
}

}  // namespace srfs::image
