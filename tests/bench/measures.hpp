// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "tests/bench/process.hpp"

/// The measures of ./run bench ros. Each makes its processes and DDS domain itself, runs ours and the peer
/// alternately so that both meet the same machine, and returns what it found as JSON. Times in microseconds
/// or milliseconds as the names say. They throw std::runtime_error when the machine does not let them start.
namespace srfs::bench {

struct LatencyOptions {
  int rounds = 3000;
  milliseconds pause{1};  ///< before every message: flight topics find their reader asleep
  bool pinned = false;    ///< each process on one CPU
  int fifo_priority = 0;  ///< 0: normal scheduling
};
/// 64 octets one way (there and back), and a service round trip, between two processes.
[[nodiscard]] Json measure_latency(const LatencyOptions& options);

struct ImageOptions {
  int octets = 1 << 20;
  int images = 100;  ///< of ours and of the peer
  int rate_hz = 10;
};
/// One way of sensor_msgs/Image between two processes, and how many never came.
[[nodiscard]] Json measure_images(const ImageOptions& options);

/// From exec of a node to the first answered get_state, with @p others up.
[[nodiscard]] Json measure_start(const std::filesystem::path& bin, int rounds, int others);

/// Memory and CPU time of idle nodes beside raw participants with as many endpoints.
[[nodiscard]] Json measure_idle(const std::filesystem::path& bin, int nodes, seconds duration);

/// CPU time of @p nodes idle nodes with the liveness ring (100 ms) above the same without it, beside raw
/// participants that send the ring's requests at its rate above such that send none; all in the same time.
[[nodiscard]] Json measure_ring(const std::filesystem::path& bin, int nodes, seconds duration);

/// kill -9 and restart of one node beside @p survivors.
[[nodiscard]] Json measure_cycles(const std::filesystem::path& bin, int cycles, int survivors);

}  // namespace srfs::bench
