// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <random>

namespace srfs::sim {

/// Gaussian noise of sensors, the same again for the same seed.
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : random_(seed) {}
  /// @param sigma  standard deviation
  [[nodiscard]] double operator()(double sigma) { return sigma * normal_(random_); }

 private:
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
};

}  // namespace srfs::sim
