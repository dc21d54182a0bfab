// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstdint>

/// Functions in single precision without branches, for loops that become vector instructions.
namespace srfs::image {

/// 2^x for x <= 0; relative error 4e-6. Below 2^-30 it stays there, which is nothing beside any noise:
/// numbers so small that products of them are denormal take processors a hundred times longer.
[[gnu::always_inline]] inline float power_of_two(float x) {
  constexpr float to_integer = 12582912.0F;  // 1.5 * 2^23: the sum's last bit is worth 1
  x = x < -30.0F ? -30.0F : x;
  const float shifted = x + to_integer;
  const std::int32_t exponent =
      std::bit_cast<std::int32_t>(shifted) - std::bit_cast<std::int32_t>(to_integer);
  const float f = x - (shifted - to_integer);
  const float p =
      1 + f * (0.69314718F + f * (0.24022651F + f * (0.05550411F + f * (0.00961813F + f * 0.00133336F))));
  return std::bit_cast<float>((exponent + 127) << 23) * p;
}

/// log2(u) for u >= 1, finite. The polynomial is that of the Cephes library's logf.
[[gnu::always_inline]] inline float log_of_two(float u) {
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

/// exp(-x^2 / 2)
[[gnu::always_inline]] inline float bell(float x) {
  return power_of_two(-0.72134752F * x * x);
}

/// Share of a normal distribution below x, of which @p bell_of_x is the bell; error 1e-7 (Abramowitz and
/// Stegun 7.1.26).
[[gnu::always_inline]] inline float share_below(float x, float bell_of_x) {
  const float size = (x < 0 ? -x : x) * 0.70710678F;
  const float t = 1 / (1 + 0.3275911F * size);
  const float p =
      t * (0.254829592F + t * (-0.284496736F + t * (1.421413741F + t * (-1.453152027F + t * 1.061405429F))));
  const float above = 0.5F * p * bell_of_x;
  return x < 0 ? above : 1 - above;
}

}  // namespace srfs::image
