// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

#include "tests/bench/process.hpp"

/// The measures of ./run bench link that need no running suite.
namespace srfs::bench {

struct CodecOptions {
  int rounds = 200;  ///< of each subject, alternating between our code and the peer
  std::uint64_t seed = 1;
};

/// Codecs of the ground link on one core: RS(255,223), compared with libfec on the same words, a whole CADU,
/// and a whole CLTU. Checks the output against the input and against the peer.
/// @throws std::runtime_error when an answer is wrong
[[nodiscard]] Json measure_codecs(const CodecOptions& options);

struct NoiseOptions {
  int trials = 2000;  ///< of each disturbance
  int units = 20000;  ///< CADUs and CLTUs at each bit error rate
  std::uint64_t seed = 1;
};

/// Jamming and noise on both directions of the link: octets of the line from the end of a disturbance to the
/// next frame that is accepted, and how many frames pass through noise. Frames are sealed and secured.
[[nodiscard]] Json measure_noise(const NoiseOptions& options);

struct StoreOptions {
  std::filesystem::path folder;    ///< on the medium to measure; the measure uses a temporary subfolder
  std::size_t octets = 64U << 20;  ///< size of the store
  std::size_t packet_octets = 120;
  int rounds = 9;
  std::uint64_t seed = 1;
};

/// A packet store of that size: overhead per record, and recovery from a flipped bit and a torn tail. No
/// other data may be lost. The file cache is warm.
/// @throws std::runtime_error when the store cannot be created or more data is lost
[[nodiscard]] Json measure_store(const StoreOptions& options);

struct MonitorOptions {
  int seconds = 2000;  ///< of a flight
  std::uint64_t seed = 1;
};

/// On-board monitoring with a full table: CPU for the periodic samples of all nodes at their intervals, and
/// for one change of the table. @throws std::runtime_error when nothing was checked
[[nodiscard]] Json measure_monitors(const MonitorOptions& options);

struct FillOptions {
  std::filesystem::path folder;  ///< of the store; must not contain segments
  std::uint64_t packets = 1000;
  std::size_t packet_octets = 120;
};

/// Writes a store while the spacecraft is down: ten reports per second from 2026-01-01T00:00:00Z on.
/// @throws std::runtime_error when it cannot be written
[[nodiscard]] Json fill_store(const FillOptions& options);

}  // namespace srfs::bench
