// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/sky.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace srfs::hw_sim {

std::uint64_t SkyRandom::next() {  // SplitMix64
  state_ += 0x9E3779B97F4A7C15U;
  std::uint64_t z = state_;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
  return z ^ (z >> 31);
}

double SkyRandom::uniform() {
  return static_cast<double>(next() >> 11) * 0x1.0p-53;
}

double SkyRandom::normal() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_;
  }
  const double r = std::sqrt(-2 * std::log(1 - uniform()));
  const double angle = 2 * std::numbers::pi * uniform();
  spare_ = r * std::sin(angle);
  has_spare_ = true;
  return r * std::cos(angle);
}

double SkyRandom::poisson(double mean) {
  if (mean > 50) return std::max(0.0, std::round(mean + std::sqrt(mean) * normal()));
  const double limit = std::exp(-mean);
  double product = uniform();
  int n = 0;
  for (; product > limit && n < 500; ++n) product *= uniform();
  return n;
}

}  // namespace srfs::hw_sim
