// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Measures the CAN path, one subject per call, and prints one JSON object. `./run bench can` calls this
// program.

#include <cstdio>
#include <exception>
#include <filesystem>

#include <CLI/CLI.hpp>

#include "tests/bench/can_measures.hpp"
#include "wire/isotp.hpp"

int main(int argc, char** argv) {
  using namespace srfs::bench;
  CLI::App app{"Measures the CAN path; prints JSON"};
  app.require_subcommand(1);
  Json result;
  const auto bin = std::filesystem::read_symlink("/proc/self/exe").parent_path();

  IsoTpOptions options;
  int timeout_ms = 0;
  const auto add_options = [&](CLI::App* c) {
    c->add_option("--octets", options.octets, "Of a message")
        ->check(CLI::Range(8, 4095))
        ->capture_default_str();
    c->add_option("--block-size", options.block_size, "Of the flow control; 0: one for a whole message")
        ->check(CLI::Range(0, 255))
        ->capture_default_str();
    c->add_option("--seed", options.seed)->capture_default_str();
    c->add_option("--timeout-ms", timeout_ms, "N_As, N_Bs, N_Cr; 0: as in flight")
        ->check(CLI::Range(0, 60000))
        ->capture_default_str();
  };
  auto* c = app.add_subcommand("isotp", "ISO-TP one way through the simulator's bus, beside the ideal");
  add_options(c);
  c->add_option("--messages", options.messages)->check(CLI::Range(1, 100000))->capture_default_str();
  c->add_option("--fifo", options.fifo_priority, "SCHED_FIFO of all three processes; 0: normal scheduling")
      ->check(CLI::Range(0, 99))
      ->capture_default_str();
  c->add_option("--frames-ahead", options.frames_ahead, "Of the sender; 0: as in flight")
      ->check(CLI::Range(0, static_cast<int>(srfs::wire::isotp_most_ahead)))
      ->capture_default_str();
  c->callback([&] {
    options.timeout = srfs::milliseconds(timeout_ms);
    result = measure_isotp(bin, options);
  });

  std::string var;
  c = app.add_subcommand("isotp-receiver", "The other end that isotp starts")->group("");
  add_options(c);
  c->add_option("--var", var)->required();
  c->callback([&] {
    options.timeout = srfs::milliseconds(timeout_ms);
    result = receive_isotp(var, options);
  });

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "bench_can: %s\n", e.what());
    return 1;
  }
  std::printf("%s\n", result.dump().c_str());
  return 0;
}
