// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "tests/bench/process.hpp"

/// The measures of ./run bench ros. Each creates its processes and DDS domain, alternates between our code
/// and the peer so that both meet the same machine load, and returns its results as JSON. Names give the unit
/// of times, microseconds or milliseconds. A measure throws std::runtime_error if it cannot start.
namespace srfs::bench {

struct LatencyOptions {
  int rounds = 3000;
  milliseconds pause{1};  ///< before every message, so that the reader sleeps, as for flight topics
  bool pinned = false;    ///< each process on one CPU
  int fifo_priority = 0;  ///< 0: normal scheduling
  bool sealed = false;    ///< our datagrams bear a seal, as in a suite; the peer's and UDP's do not
};
/// One-way latency of 64 octets (in both directions) and service round trip, between two processes.
[[nodiscard]] Json measure_latency(const LatencyOptions& options);

struct ImageOptions {
  int octets = 1 << 20;
  int images = 100;  ///< for our code and for the peer, each
  int rate_hz = 10;
};
/// One-way latency of sensor_msgs/Image between two processes, and the number of lost images.
[[nodiscard]] Json measure_images(const ImageOptions& options);

/// Time from exec of a node to the first answered get_state, with @p others nodes running.
[[nodiscard]] Json measure_start(const std::filesystem::path& bin, int rounds, int others);

/// Memory and CPU time of idle nodes, compared with raw participants with as many endpoints.
[[nodiscard]] Json measure_idle(const std::filesystem::path& bin, int nodes, seconds duration);

/// CPU time that the liveness ring (100 ms) adds to @p nodes idle nodes, compared with the CPU time that the
/// ring's requests at the same rate add to raw participants. All four groups run at the same time.
[[nodiscard]] Json measure_ring(const std::filesystem::path& bin, int nodes, seconds duration);

/// kill -9 and restart of one node while @p survivors nodes keep running.
[[nodiscard]] Json measure_cycles(const std::filesystem::path& bin, int cycles, int survivors);

}  // namespace srfs::bench
