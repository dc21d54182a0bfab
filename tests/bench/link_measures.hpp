// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

#include "tests/bench/process.hpp"

/// The measures of ./run bench link that need no flight.
namespace srfs::bench {

struct CodecOptions {
  int rounds = 200;  ///< of each subject, ours and the peer's in turn
  std::uint64_t seed = 1;
};

/// Codecs of the ground link on one core: RS(255,223) beside libfec on the same words, a whole CADU, a whole
/// CLTU. Checks what comes out against what went in and against the peer.
/// @throws std::runtime_error when an answer is wrong
[[nodiscard]] Json measure_codecs(const CodecOptions& options);

struct StoreOptions {
  std::filesystem::path folder;    ///< on the medium to measure; a folder below it is made and removed
  std::size_t octets = 64U << 20;  ///< of the store
  std::size_t packet_octets = 120;
  int rounds = 9;
  std::uint64_t seed = 1;
};

/// A packet store of that size: overhead of a record, and recovery with a flipped bit and a torn tail in it;
/// nothing else may be lost. The file cache is warm.
/// @throws std::runtime_error when the store cannot be made or more is lost
[[nodiscard]] Json measure_store(const StoreOptions& options);

struct FillOptions {
  std::filesystem::path folder;  ///< of the store; must not have segments
  std::uint64_t packets = 1000;
  std::size_t packet_octets = 120;
};

/// Writes a store for a spacecraft that is not up: reports of 2026-01-01T00:00:00Z and on, ten a second.
/// @throws std::runtime_error when it cannot be written
[[nodiscard]] Json fill_store(const FillOptions& options);

}  // namespace srfs::bench
