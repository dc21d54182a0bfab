// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "base/result.hpp"
#include "base/time.hpp"
#include "ground/archive/archive.hpp"
#include "ground/archive/database.hpp"
#include "wire/pus.hpp"

namespace srfs::ground {

// What the tables mean, for those that work with them.
inline constexpr std::int64_t minute_ns = 60'000'000'000;
inline constexpr int live_copy = 1;
/// In a packet's copies, beside what receiving it says: archive copy added it. That is no news to a reader.
inline constexpr int added_by_copy = 8;
inline constexpr seconds gap_tolerance{120};  ///< times of a node's packets are not quite in order
/// Gaps in which another station's packets are looked for. A longer one is a step of the spacecraft's clock.
inline constexpr std::chrono::hours elsewhere_longest{48};

/// Of a telecommand's column `request`.
[[nodiscard]] inline std::int64_t number_of(const wire::RequestId& request) {
  return static_cast<std::int64_t>(request.packet_identification) << 16 | request.packet_sequence_control;
}
/// Of a time in nanoseconds.
[[nodiscard]] inline std::int64_t minute_of(std::int64_t ns) {
  return ns >= 0 ? ns / minute_ns : (ns - minute_ns + 1) / minute_ns;
}

/// The connection of an archive whose tables are those of this program. A PostgreSQL is connected. The error
/// is ready to print.
[[nodiscard]] Result<std::unique_ptr<Database>, std::string> open_archive_database(const ArchivePlace& place,
                                                                                   ArchiveUse use);

}  // namespace srfs::ground
