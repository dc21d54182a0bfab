// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

/// What stands and moves in a frame of the sky, and reproducible chance.
namespace srfs::hw_sim {

struct SkyStar {
  double x;
  double y;
  double flux_e;
};

/// A moving object: its light lies evenly between the ends.
struct SkyStreak {
  double x1;
  double y1;
  double x2;
  double y2;
  double flux_e;
};

/// Reproducible numbers; the standard's distributions differ between libraries.
class SkyRandom {
 public:
  explicit SkyRandom(std::uint64_t seed) : state_(seed) {}
  double uniform();  ///< [0, 1)
  double uniform(double from, double to) { return from + (to - from) * uniform(); }
  double normal();
  double poisson(double mean);  ///< rounded normal above 50

 private:
  std::uint64_t next();
  std::uint64_t state_;
  double spare_ = 0;
  bool has_spare_ = false;
};

}  // namespace srfs::hw_sim
