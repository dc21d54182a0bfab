// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "tests/simulation/fault_injector.hpp"
#include "tests/simulation/spacecraft.hpp"

namespace srfs::simulation {

/// A run as a picture: mode, power, temperatures, slots, line, faults and recoveries over the time.
class Plot {
 public:
  /// Looks at a run. Changes nothing of it.
  void sample(nanoseconds at, Kernel& kernel, Spacecraft& spacecraft, const FaultInjector& faults);
  /// SVG 1.1.
  [[nodiscard]] std::string svg(const std::string& title) const;

 private:
  struct Sample {
    double at_s = 0;
    std::uint8_t mode = 0;
    double charge = 0;
    double solar_w = 0;
    double battery_k = 0;
    double radiator_k = 0;
    double granted = 0;
    double released = 0;
    double starts = 0;
    double boots = 0;
    bool line_cut = false;
    bool calm = false;
    std::array<std::uint64_t, fault_count> faults{};
  };
  std::vector<Sample> samples_;
};

}  // namespace srfs::simulation
