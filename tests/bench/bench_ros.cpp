// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Measures lib/ros, one subject per call, and prints one JSON object. Each run alternates between our code
// and its peers: Fast DDS used directly with the same transport and QoS (raw_dds.hpp), and bare UDP sockets
// where that makes sense. `./run bench ros` (python/srfs/measures/ros.py) calls this program and judges the
// values.

#include <cstdio>
#include <exception>

#include <CLI/CLI.hpp>

#include "suite/launcher.hpp"
#include "tests/bench/measures.hpp"
#include "tests/bench/raw_dds.hpp"

namespace {

using namespace srfs::bench;

struct Arguments {
  LatencyOptions latency;
  int pause_ms = 1;
  ImageOptions image;
  int rounds = 60;
  int others = 10;
  int nodes = 9;
  int duration_s = 60;
  int cycles = 1000;
  int survivors = 8;
  int domain = 0;
  std::string name;
  int writers = 1;
  int readers = 1;
  std::vector<std::string> asked;
  Json result;
  int exit_code = 0;
};

void add_latency(CLI::App& app, Arguments& a) {
  auto* c = app.add_subcommand("latency", "64 octets one way and a service round trip, two processes");
  c->add_option("--rounds", a.latency.rounds)->check(CLI::Range(10, 1000000))->capture_default_str();
  c->add_option("--pause-ms", a.pause_ms, "Before each message")
      ->check(CLI::Range(0, 1000))
      ->capture_default_str();
  c->add_flag("--pinned", a.latency.pinned,
              "Each process on one CPU, as a deployment pins time-critical nodes");
  c->add_option("--fifo", a.latency.fifo_priority, "SCHED_FIFO with this priority, as a deployment sets it")
      ->check(CLI::Range(0, 99));
  c->add_flag("--sealed", a.latency.sealed, "Our datagrams bear a seal, as those of a suite");
  c->callback([&a] {
    a.latency.pause = srfs::milliseconds(a.pause_ms);
    a.result = measure_latency(a.latency);
  });
}

void add_image(CLI::App& app, Arguments& a) {
  auto* c = app.add_subcommand("image", "sensor_msgs/Image, two processes");
  c->add_option("--octets", a.image.octets)->check(CLI::Range(1024, 16 << 20))->capture_default_str();
  c->add_option("--images", a.image.images)->check(CLI::Range(1, 100000))->capture_default_str();
  c->add_option("--rate", a.image.rate_hz, "1/s, of ours and of the peer")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  c->callback([&a] { a.result = measure_images(a.image); });
}

void add_suites(CLI::App& app, Arguments& a) {
  const auto bin = srfs::suite::suite_bin_folder();
  auto* c = app.add_subcommand("start", "Exec of a node to the first answered get_state");
  c->add_option("--rounds", a.rounds)->check(CLI::Range(1, 10000))->capture_default_str();
  c->add_option("--others", a.others, "Nodes that are up")->check(CLI::Range(1, 20))->capture_default_str();
  c->callback([&a, bin] { a.result = measure_start(bin, a.rounds, a.others); });

  c = app.add_subcommand("idle", "Memory and CPU time of idle nodes");
  c->add_option("--nodes", a.nodes)->check(CLI::Range(1, 20))->capture_default_str();
  c->add_option("--duration", a.duration_s, "s")->check(CLI::Range(1, 3600))->capture_default_str();
  c->callback([&a, bin] { a.result = measure_idle(bin, a.nodes, srfs::seconds(a.duration_s)); });

  c = app.add_subcommand("ring", "CPU time of the liveness ring beside raw requests at its rate");
  c->add_option("--nodes", a.nodes)->check(CLI::Range(2, 20))->capture_default_str();
  c->add_option("--duration", a.duration_s, "s")->check(CLI::Range(1, 3600))->capture_default_str();
  c->callback([&a, bin] { a.result = measure_ring(bin, a.nodes, srfs::seconds(a.duration_s)); });

  c = app.add_subcommand("cycles", "kill -9 and restart of a node beside others");
  c->add_option("--cycles", a.cycles)->check(CLI::Range(1, 100000))->capture_default_str();
  c->add_option("--survivors", a.survivors)->check(CLI::Range(1, 20))->capture_default_str();
  c->callback([&a, bin] { a.result = measure_cycles(bin, a.cycles, a.survivors); });
}

void add_raw_node(CLI::App& app, Arguments& a) {
  auto* c = app.add_subcommand("raw-node", "The peer that the others start")->group("");
  c->add_option("--domain", a.domain)->required();
  c->add_option("--name", a.name)->required();
  c->add_option("--writers", a.writers);
  c->add_option("--readers", a.readers);
  c->add_option("--ask", a.asked, "Whom it asks every 100 ms");
  c->callback([&a] { a.exit_code = run_raw_node(a.domain, a.name, a.writers, a.readers, a.asked); });
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Measures lib/ros beside raw Fast DDS; prints JSON"};
  app.require_subcommand(1);
  Arguments arguments;
  add_latency(app, arguments);
  add_image(app, arguments);
  add_suites(app, arguments);
  add_raw_node(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "bench_ros: %s\n", e.what());
    return 1;
  }
  if (!arguments.result.is_null()) std::printf("%s\n", arguments.result.dump().c_str());
  return arguments.exit_code;
}
