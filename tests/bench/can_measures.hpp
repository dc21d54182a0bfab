// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

#include "tests/bench/process.hpp"

/// The measures of ./run bench can that need a separate program.
namespace srfs::bench {

struct IsoTpOptions {
  int messages = 100;  ///< sent back to back
  int octets = 4095;   ///< per message: four octets of message number, then random octets
  int block_size = 0;  ///< of the receiver; 0: no flow control within a message
  std::uint64_t seed = 1;
  int frames_ahead = 0;   ///< of the sender; 0: as in flight
  int fifo_priority = 0;  ///< of all three processes; 0: normal scheduling
  /// N_As, N_Bs and N_Cr; 0: as in flight. On a loaded machine a transfer may need longer time-outs.
  milliseconds timeout{0};
};

/// Measures ISO-TP in one direction through the hub of hw_sim, which paces 500 kbit/s. The simulator, the
/// sender (this process) and the receiver are three processes; both ends use the flight channel and driver.
/// Also returns the ideal: the same frames including flow control, with their real stuff bits, back to back.
/// @throws std::runtime_error when the processes cannot start
[[nodiscard]] Json measure_isotp(const std::filesystem::path& bin, const IsoTpOptions& options);

/// The receiver: checks incoming messages until SIGTERM. @return its results
[[nodiscard]] Json receive_isotp(const std::filesystem::path& var, const IsoTpOptions& options);

}  // namespace srfs::bench
