// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Measures lib/ros, one subject per call, and prints one JSON object. Each run alternates between our code
// and its peers: Fast DDS used directly with the same transport and QoS (raw_dds.hpp), and bare UDP sockets
// where that makes sense. `./run bench ros` (tools/demo/bench.py) calls this program and judges the values.

#include <cstdio>
#include <exception>

#include <CLI/CLI.hpp>

#include "ros/launcher.hpp"
#include "tests/bench/measures.hpp"
#include "tests/bench/raw_dds.hpp"

int main(int argc, char** argv) {
  using namespace srfs::bench;
  CLI::App app{"Measures lib/ros beside raw Fast DDS; prints JSON"};
  app.require_subcommand(1);
  Json result;
  const auto bin = srfs::ros::suite_bin_folder();

  LatencyOptions latency;
  int pause_ms = 1;
  auto* c = app.add_subcommand("latency", "64 octets one way and a service round trip, two processes");
  c->add_option("--rounds", latency.rounds)->check(CLI::Range(10, 1000000))->capture_default_str();
  c->add_option("--pause-ms", pause_ms, "Before each message")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  c->add_flag("--pinned", latency.pinned,
              "Each process on one CPU, as a deployment pins time-critical nodes");
  c->add_option("--fifo", latency.fifo_priority, "SCHED_FIFO with this priority, as a deployment sets it")
      ->check(CLI::Range(0, 99));
  c->callback([&] {
    latency.pause = srfs::milliseconds(pause_ms);
    result = measure_latency(latency);
  });

  ImageOptions image;
  c = app.add_subcommand("image", "sensor_msgs/Image, two processes");
  c->add_option("--octets", image.octets)->check(CLI::Range(1024, 16 << 20))->capture_default_str();
  c->add_option("--images", image.images)->check(CLI::Range(1, 100000))->capture_default_str();
  c->add_option("--rate", image.rate_hz, "1/s, of ours and of the peer")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  c->callback([&] { result = measure_images(image); });

  int rounds = 60;
  int others = 10;
  c = app.add_subcommand("start", "Exec of a node to the first answered get_state");
  c->add_option("--rounds", rounds)->check(CLI::Range(1, 10000))->capture_default_str();
  c->add_option("--others", others, "Nodes that are up")->check(CLI::Range(1, 20))->capture_default_str();
  c->callback([&] { result = measure_start(bin, rounds, others); });

  int nodes = 9;
  int duration_s = 60;
  c = app.add_subcommand("idle", "Memory and CPU time of idle nodes");
  c->add_option("--nodes", nodes)->check(CLI::Range(1, 20))->capture_default_str();
  c->add_option("--duration", duration_s, "s")->check(CLI::Range(1, 3600))->capture_default_str();
  c->callback([&] { result = measure_idle(bin, nodes, srfs::seconds(duration_s)); });

  c = app.add_subcommand("ring", "CPU time of the liveness ring beside raw requests at its rate");
  c->add_option("--nodes", nodes)->check(CLI::Range(2, 20))->capture_default_str();
  c->add_option("--duration", duration_s, "s")->check(CLI::Range(1, 3600))->capture_default_str();
  c->callback([&] { result = measure_ring(bin, nodes, srfs::seconds(duration_s)); });

  int cycles = 1000;
  int survivors = 8;
  c = app.add_subcommand("cycles", "kill -9 and restart of a node beside others");
  c->add_option("--cycles", cycles)->check(CLI::Range(1, 100000))->capture_default_str();
  c->add_option("--survivors", survivors)->check(CLI::Range(1, 20))->capture_default_str();
  c->callback([&] { result = measure_cycles(bin, cycles, survivors); });

  int domain = 0;
  std::string name;
  int writers = 1;
  int readers = 1;
  std::vector<std::string> asked;
  int exit_code = 0;
  c = app.add_subcommand("raw-node", "The peer that the others start")->group("");
  c->add_option("--domain", domain)->required();
  c->add_option("--name", name)->required();
  c->add_option("--writers", writers);
  c->add_option("--readers", readers);
  c->add_option("--ask", asked, "Whom it asks every 100 ms");
  c->callback([&] { exit_code = run_raw_node(domain, name, writers, readers, asked); });

  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "bench_ros: %s\n", e.what());
    return 1;
  }
  if (!result.is_null()) std::printf("%s\n", result.dump().c_str());
  return exit_code;
}
