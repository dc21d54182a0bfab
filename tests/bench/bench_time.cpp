// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Measures the time discipline with the simulated receiver, in simulated time. Prints one JSON object.
// `./run bench time` calls this program.

#include <cstdio>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "tests/timing_simulation.hpp"

namespace {

using namespace srfs;
using testing_support::TimingSimulation;
using Json = nlohmann::json;

struct Case {
  const char* name;
  double drift_ppm;
  double jitter_us;
  double wander_ppm;
  sim::GpsDisturbance disturbance;
};

sim::GpsSettings settings_of(const Case& c, std::uint64_t seed) {
  sim::GpsSettings settings;
  settings.start = TimingSimulation::default_start();
  settings.drift_ppm = c.drift_ppm;
  settings.jitter_us = c.jitter_us;
  settings.wander_ppm = c.wander_ppm;
  settings.seed = seed;
  return settings;
}

/// The worst result of all seeds.
Json measure(const Case& c, std::uint64_t seeds) {
  double rms_60_ns = 0;
  double rms_ns = 0;
  double holdover_ns = 0;
  double estimated_ns = 0;
  double interval = 0;
  bool locked = true;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    TimingSimulation s(settings_of(c, seed));
    s.receiver().disturb(c.disturbance);
    // Each seed places the loss at a different phase of the orbit.
    const auto before = 1200 + static_cast<std::int64_t>(seed % 8) * 700;
    s.run(before);
    locked = locked && s.samples()[60].state == mission::SyncState::locked;
    rms_60_ns = std::max(rms_60_ns, s.rms_error_ns(60, 120));
    rms_ns = std::max(rms_ns, s.rms_error_ns(60, before));
    s.receiver().disturb({.fault = sim::GpsFault::off});
    s.run(3600);
    holdover_ns = std::max(holdover_ns, std::abs(static_cast<double>(s.last().error.count())));
    estimated_ns =
        std::max(estimated_ns, static_cast<double>(s.last().estimated.value_or(nanoseconds(0)).count()));
    interval = std::max(interval, s.worst_interval());
  }
  return {{"name", c.name},
          {"drift_ppm", c.drift_ppm},
          {"jitter_us", c.jitter_us},
          {"wander_ppm", c.wander_ppm},
          {"locked_at_60", locked},
          {"rms_60_to_120_us", rms_60_ns * 1e-3},
          {"rms_us", rms_ns * 1e-3},
          {"holdover_1h_us", holdover_ns * 1e-3},
          {"holdover_1h_estimated_us", estimated_ns * 1e-3},
          {"worst_interval_percent", interval * 100}};
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Measures the time discipline in simulation; prints JSON"};
  std::uint64_t seeds = 20;
  app.add_option("--seeds", seeds)->check(CLI::Range(1, 1000))->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const Case cases[] = {
      {"as required", 1, 1, 0, {}},
      {"temperature of an orbit", 1, 1, 0.1, {}},
      {"uncalibrated crystal", 50, 1, 0.1, {}},
      {"GPIO edges, 10 us", 50, 10, 0.1, {}},
      {"lost and false pulses", 1, 1, 0.1, {.lost_pulses = 0.2, .false_pulses = 0.2}},
      {"two receivers", 1, 1, 0.1, {.second_receiver = milliseconds(300)}},
  };
  Json result = Json::array();
  for (const Case& c : cases) result.push_back(measure(c, seeds));
  std::printf("%s\n", result.dump().c_str());
  return 0;
}
