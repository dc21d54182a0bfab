// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Measures the codecs and the packet store of the ground link, one subject per call, and prints one JSON
// object. `./run bench link` calls this program.

#include <cstdio>
#include <exception>
#include <filesystem>

#include <CLI/CLI.hpp>

#include "tests/bench/link_measures.hpp"

int main(int argc, char** argv) {
  using namespace srfs::bench;
  CLI::App app{"Measures the ground link's codecs and store; prints JSON"};
  app.require_subcommand(1);
  Json result;

  CodecOptions codecs;
  auto* c = app.add_subcommand("codecs", "Reed-Solomon beside libfec, whole CADUs and CLTUs");
  c->add_option("--rounds", codecs.rounds)->check(CLI::Range(10, 100000))->capture_default_str();
  c->add_option("--seed", codecs.seed)->capture_default_str();
  c->callback([&] { result = measure_codecs(codecs); });

  NoiseOptions noise;
  c = app.add_subcommand("noise", "Both directions under jamming and noise");
  c->add_option("--trials", noise.trials)->check(CLI::Range(10, 1000000))->capture_default_str();
  c->add_option("--units", noise.units)->check(CLI::Range(10, 10000000))->capture_default_str();
  c->add_option("--seed", noise.seed)->capture_default_str();
  c->callback([&] { result = measure_noise(noise); });

  StoreOptions store{.folder = std::filesystem::temp_directory_path()};
  c = app.add_subcommand("store", "A packet store: overhead, recovery with damage in it");
  c->add_option("--folder", store.folder, "On the medium to measure")
      ->check(CLI::ExistingDirectory)
      ->capture_default_str();
  c->add_option("--octets", store.octets)
      ->check(CLI::Range(std::size_t{4} << 20, std::size_t{1} << 30))
      ->capture_default_str();
  c->add_option("--rounds", store.rounds)->check(CLI::Range(1, 1000))->capture_default_str();
  c->add_option("--seed", store.seed)->capture_default_str();
  c->callback([&] { result = measure_store(store); });

  MonitorOptions monitors;
  c = app.add_subcommand("monitors", "On-board monitoring with 1000 definitions");
  c->add_option("--seconds", monitors.seconds)->check(CLI::Range(10, 1000000))->capture_default_str();
  c->add_option("--seed", monitors.seed)->capture_default_str();
  c->callback([&] { result = measure_monitors(monitors); });

  FillOptions fill;
  c = app.add_subcommand("fill", "Writes a store of reports of 2026-01-01 for a spacecraft that is not up");
  c->add_option("folder", fill.folder, "Of the store")->required();
  c->add_option("--packets", fill.packets)->check(CLI::Range(1, 1000000))->capture_default_str();
  c->callback([&] { result = fill_store(fill); });

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "bench_link: %s\n", e.what());
    return 1;
  }
  std::printf("%s\n", result.dump().c_str());
  return 0;
}
