// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

#include "tests/bench/process.hpp"

/// The measures of ./run bench can that need a program of their own.
namespace srfs::bench {

struct IsoTpOptions {
  int messages = 100;  ///< one after the other, as soon as the one before has left
  int octets = 4095;   ///< each; the first four are its number, the others random
  int block_size = 0;  ///< asked for by the receiver; 0: no flow control within a message
  std::uint64_t seed = 1;
  int frames_ahead = 0;   ///< of the sender; 0: as in flight
  int fifo_priority = 0;  ///< of all three processes; 0: normal scheduling
  /// N_As, N_Bs and N_Cr; 0: as in flight. A loaded machine that is not to fail a transfer needs more.
  milliseconds timeout{0};
};

/// ISO-TP one way through the hub of hw_sim, which paces 500 kbit/s: the simulator, the sender (this process)
/// and the receiver are three processes, both ends with the channel and the driver that flight uses. Beside
/// it the ideal: the same frames, flow control included, with their real stuff bits back to back on the bus.
/// @throws std::runtime_error when the machine does not let them start
[[nodiscard]] Json measure_isotp(const std::filesystem::path& bin, const IsoTpOptions& options);

/// The other end: checks what comes until SIGTERM, then prints its account.
[[nodiscard]] Json receive_isotp(const std::filesystem::path& var, const IsoTpOptions& options);

}  // namespace srfs::bench
