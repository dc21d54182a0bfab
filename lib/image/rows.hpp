// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

/// Loops over the pixels of a row, written so that they become vector instructions.
namespace srfs::image {

/// Of the values within @p reach of @p centre, NaN apart: their number, and sums of their distances from it.
struct Moments {
  float n;
  float sum;
  float squares;
};
[[nodiscard]] Moments clipped_moments(const float* row, int n, float centre, float reach);
/// @param masked  0: the pixel counts
[[nodiscard]] Moments clipped_moments(const float* row, const std::uint8_t* masked, int n, float centre,
                                      float reach);

/// Smallest and largest of the finite values; the first above the second when there is none.
struct Extent {
  float low;
  float high;
  bool all_finite;
};
[[nodiscard]] Extent extent_of(const float* row, int n);

/// out = (in - level) / noise; what is not finite becomes 0.
void normalise(const float* in, const float* level, const float* noise, float noise_floor, float* out, int n);

/// Copies a row with 0 for the pixels that are hidden: not 0.
void hide_pixels(const float* in, const std::uint8_t* hidden, float* out, int n);

/// row *= factor / noise
void scale_down(float* row, const float* noise, float noise_floor, int n);

/// Values of a cubic polynomial at start, start + unit, ...
void fill_cubic(const float* coefficients, float start, float unit, float* out, int n);

/// row -= level
void subtract(float* row, const float* level, int n);

/// out = in, at most @p limit and at least -limit
void clip_row(const float* in, float limit, float* out, int n);

/// to += row
void add_row(const float* row, float* to, int n);

/// Places whose value is above @p limit (one, or one a place), in order. @param found  is overwritten
void find_above(const float* row, float limit, int n, std::vector<int>& found);
void find_above(const float* row, const float* limit, int n, std::vector<int>& found);

/// Adds values within @p reach of 0 to @p sums and their number to @p counts. @return the row's own: n and
/// sum
[[nodiscard]] Moments add_near_zero(const float* row, float reach, float* sums, float* counts, int n);

[[nodiscard]] int count_below(const float* row, float limit, int n);

/// out = taps[0] middle + sum over i of taps[i] (rows[radius - i] + rows[radius + i]), 2 radius + 1 rows.
void filter_column(const float* const* rows, const float* taps, int radius, float* out, int n);
/// The same along a row that has @p radius values on both sides.
void filter_row(const float* row, const float* taps, int radius, float* out, int n);
constexpr int filter_radius_max = 24;

/// to = first + second, of the sums along lines.
void add_sums(const std::int16_t* first, const std::int16_t* second, std::int16_t* to, int n);
[[nodiscard]] std::int16_t highest_of(const std::int16_t* values, int n);

}  // namespace srfs::image
