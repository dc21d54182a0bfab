// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// srfs-simulate: the whole mission in one deterministic process (docs/how-to/simulate_the_mission.md).
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <memory>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "base/file.hpp"
#include "tests/simulation/commandability.hpp"
#include "tests/simulation/run.hpp"

namespace {

using namespace srfs;
using namespace srfs::simulation;

constexpr int violated = 1;
constexpr int misused = 2;

struct Options {
  double days = 1.0 / 24;
  std::uint64_t seed = 1;
  std::string seeds;
  std::string shard = "1/1";
  std::string faults = "swarm";
  std::string trace;
  std::string plot;
  double stop_at_s = 0;
  std::size_t pairs = 0;
  bool shrink = true;
  bool coverage = false;
};

std::optional<std::pair<std::uint64_t, std::uint64_t>> two_numbers(const std::string& text,
                                                                   const char* between) {
  const std::size_t at = text.find(between);
  if (at == std::string::npos) return std::nullopt;
  char* end = nullptr;
  const std::uint64_t first = std::strtoull(text.c_str(), &end, 10);
  if (end != text.c_str() + at) return std::nullopt;
  const char* rest = text.c_str() + at + std::string_view(between).size();
  const std::uint64_t second = std::strtoull(rest, &end, 10);
  if (*rest == '\0' || *end != '\0') return std::nullopt;
  return std::pair(first, second);
}

void print_violation(const RunSettings& settings, const RunOutcome& outcome, bool with_shrink) {
  fmt::print("\nVIOLATION of {}: {}\nseed {}, {:.6f} s after the start, faults {}\n\n{}\n",
             outcome.violation->requirement, outcome.violation->text, settings.seed,
             static_cast<double>(outcome.at.count()) / 1e9, to_text(settings.faults), outcome.diagram);
  FaultSet fewest = settings.faults;
  if (with_shrink) {
    fewest = shrink(settings, outcome);
    fmt::print("Fewest faults that still fail: {}\n", to_text(fewest));
  }
  fmt::print("Again: ./run simulate --seed {} --days {} --faults {}\n", settings.seed,
             static_cast<double>(settings.duration.count()) / 86400e9, to_text(fewest));
}

/// @return whether it was written
bool write_plot(const std::string& file, const std::string& svg) {
  const auto written = write_file_atomically(file, svg);
  if (!written) fmt::print(stderr, "srfs-simulate: {}\n", written.error().message);
  return written.has_value();
}

bool fly(const RunSettings& settings, bool with_shrink, TransitionCounts& transitions) {
  const std::clock_t begun = std::clock();  // time of the CPU: other programs do not count
  const RunOutcome outcome = run(settings);
  const double took = static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC;
  const double simulated = static_cast<double>(outcome.at.count()) / 1e9;
  fmt::print(
      "seed {:>6}  {:016x}  {:>9.0f} s in {:>7.2f} s ({:>5.0f}x)  {:>8} slots  {:>5} telecommands  {:>5} "
      "completed  {:>4} released  {:>6} stored  {:>3} retrieved  {:>3} files  {:>2} installed  {:>5} starts  "
      "{:>3} boots  "
      "{:>5} faults  {}\n",
      settings.seed, outcome.hash, simulated, took, simulated / took, outcome.slots, outcome.telecommands,
      outcome.completed, outcome.released, outcome.stored, outcome.retrieved, outcome.files,
      outcome.installed, outcome.starts, outcome.boots, outcome.faults,
      outcome.violation ? "VIOLATION" : "ok");
  if (outcome.violation) print_violation(settings, outcome, with_shrink);
  std::fflush(stdout);
  add(transitions, outcome.transitions);
  return !outcome.violation;
}

/// @return whether the spacecraft could be commanded after each pair
bool give_pairs(std::uint64_t seed, std::size_t pairs) {
  const std::clock_t begun = std::clock();
  const CommandabilityOutcome outcome = run_commandability({.seed = seed, .pairs = pairs});
  fmt::print(
      "seed {:>6}  {:>6} pairs of {} orders in {:>7.2f} s  {:>6} telecommands completed  {:>4} kills  "
      "{:>3} boots  slowest {:.1f} s  {}\n",
      seed, outcome.pairs, outcome.orders, static_cast<double>(std::clock() - begun) / CLOCKS_PER_SEC,
      outcome.completed, outcome.kills, outcome.boots, static_cast<double>(outcome.slowest.count()) / 1e9,
      outcome.violation ? "VIOLATION" : "ok");
  if (outcome.violation)
    fmt::print("\nVIOLATION of {}: {}\n\n{}\nAgain: ./run simulate --seed {} --pairs {}\n",
               outcome.violation->requirement, outcome.violation->text, outcome.diagram, seed, pairs);
  std::fflush(stdout);
  return !outcome.violation;
}

int simulate(const Options& options) {
  auto seeds = std::optional(std::pair(options.seed, options.seed));
  if (!options.seeds.empty()) seeds = two_numbers(options.seeds, "..");
  const auto shard = two_numbers(options.shard, "/");
  if (!seeds || seeds->first > seeds->second) {
    fmt::print(stderr, "srfs-simulate: --seeds: expected A..B, found '{}'\n", options.seeds);
    return misused;
  }
  if (!shard || shard->first < 1 || shard->first > shard->second) {
    fmt::print(stderr, "srfs-simulate: --shard: expected K/N with K from 1 to N, found '{}'\n",
               options.shard);
    return misused;
  }
  const auto chosen = options.faults == "swarm" ? std::optional(FaultSet()) : faults_from(options.faults);
  if (!chosen) {
    fmt::print(stderr, "srfs-simulate: --faults: expected swarm, all, none or some of {}; found '{}'\n",
               to_text(FaultSet().set()), options.faults);
    return misused;
  }
  RunSettings settings;
  settings.duration = nanoseconds(static_cast<std::int64_t>(options.days * 86400e9));
  if (options.stop_at_s > 0)
    settings.duration = nanoseconds(static_cast<std::int64_t>(options.stop_at_s * 1e9));
  const auto close = [](std::FILE* file) { return std::fclose(file); };
  std::unique_ptr<std::FILE, decltype(close)> trace(
      options.trace.empty() ? nullptr : std::fopen(options.trace.c_str(), "w"), close);
  if (!options.trace.empty() && !trace) {
    fmt::print(stderr, "srfs-simulate: {} cannot be written: {}\n", options.trace, std::strerror(errno));
    return misused;
  }
  settings.trace = trace.get();
  std::string svg;
  if (!options.plot.empty()) settings.plot = &svg;
  bool all_well = true;
  TransitionCounts transitions{};
  for (std::uint64_t seed = seeds->first; seed <= seeds->second; ++seed) {
    if ((seed - seeds->first) % shard->second != shard->first - 1) continue;
    if (options.pairs > 0) {
      all_well = give_pairs(seed, options.pairs) && all_well;
      continue;
    }
    settings.seed = seed;
    settings.faults = options.faults == "swarm" ? swarm_of(seed) : *chosen;
    all_well = fly(settings, options.shrink, transitions) && all_well;
  }
  if (!options.plot.empty() && !svg.empty() && !write_plot(options.plot, svg)) return misused;
  if (options.coverage) fmt::print("\n{}", report(transitions));
  return all_well ? 0 : violated;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Flies the whole mission in one deterministic process, in virtual time. A seed gives the same run "
      "again, octet by octet.\n"
      "Exit code: 0 all invariants held, 1 one was violated, 2 wrong options."};
  Options options;
  app.add_option("--days", options.days, "virtual time of a run")
      ->check(CLI::Range(0.0, 3660.0))
      ->capture_default_str();
  app.add_option("--seed", options.seed, "one run")->capture_default_str();
  app.add_option("--seeds", options.seeds, "A..B: a run for each of them");
  app.add_option("--shard", options.shard, "K/N: every Nth of the seeds, from the Kth on")
      ->capture_default_str();
  app.add_option("--faults", options.faults,
                 "kinds of faults: swarm (the seed chooses), all, none, or a list with commas")
      ->capture_default_str();
  app.add_option("--trace", options.trace, "file for all steps");
  app.add_option("--stop-at", options.stop_at_s,
                 "seconds of virtual time after which a run ends, instead of --days");
  app.add_option("--pairs", options.pairs,
                 "instead of faults: so many pairs of telecommands, with the smallest and the largest "
                 "arguments; after each the spacecraft can be commanded");
  app.add_option("--plot", options.plot,
                 "SVG file: mode, power, temperatures, slots, faults and recoveries of the last run");
  app.add_flag("--coverage", options.coverage, "behind the runs: which state transitions they had");
  app.add_flag("!--no-shrink", options.shrink, "a violation keeps all its faults");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : misused;
  }
  return simulate(options);
}
