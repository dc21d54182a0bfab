// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/link_noise.hpp"

#include <string>

#include "tests/bench/link_measures.hpp"

namespace srfs::bench {
namespace {

using testing_support::Disturbance;
using testing_support::Downlink;
using testing_support::NoisyLine;
using testing_support::Uplink;

template <class Direction>
Json acquisition(const NoiseOptions& options, Disturbance disturbance) {
  NoisyLine line(options.seed);
  std::vector<double> octets;
  std::uint64_t never = 0;
  for (int trial = 0; trial < options.trials; ++trial) {
    const auto found = testing_support::octets_to_acquire(Direction(), disturbance, line);
    found ? octets.push_back(static_cast<double>(*found)) : static_cast<void>(++never);
  }
  return {{"disturbance", to_text(disturbance)}, {"octets", summary(octets)}, {"never", never}};
}

template <class Direction>
Json in_noise(Direction direction, double rate, const NoiseOptions& options) {
  NoisyLine line(options.seed);
  for (int i = 0; i < options.units; ++i) {
    Octets unit = direction.next_unit();
    line.spoil_bits(unit, rate);
    direction.take(unit);
  }
  return {{"bit_error_rate", rate},
          {"unit_octets", direction.unit_octets()},
          {"sent", direction.sent()},
          {"accepted", direction.accepted()},
          {"corrected", direction.corrected()}};
}

}  // namespace

Json measure_noise(const NoiseOptions& options) {
  Json result;
  for (const Disturbance disturbance : testing_support::all_disturbances) {
    result["acquisition"]["down"].push_back(acquisition<Downlink>(options, disturbance));
    result["acquisition"]["up"].push_back(acquisition<Uplink>(options, disturbance));
  }
  for (const double rate : {1e-5, 1e-4, 1e-3, 3e-3, 1e-2}) {
    result["noise"]["down"].push_back(in_noise(Downlink(), rate, options));
    result["noise"]["up"].push_back(in_noise(Uplink(), rate, options));
    result["noise"]["up_long"].push_back(in_noise(Uplink(900), rate, options));
  }
  return result;
}

}  // namespace srfs::bench
