// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "wire/farm1.hpp"

namespace srfs {

/// What the uplink must remember across a restart, or old frames would be executed again.
struct LinkState {
  struct Channel {
    std::uint8_t vc = 0;
    wire::FarmState farm;
    friend bool operator==(const Channel&, const Channel&) = default;
  };
  struct Association {
    std::uint16_t spi = 0;
    std::uint64_t counter = 0;  ///< of the last accepted frame
    friend bool operator==(const Association&, const Association&) = default;
  };
  std::uint64_t generation = 0;  ///< counts changes; of two valid copies the higher one is true
  /// Telecommand ids from here on were never given to a node; 0: not known. Not part of the generation.
  std::uint64_t next_telecommand_id = 0;
  std::vector<Channel> channels;
  std::vector<Association> associations;  ///< only those that accepted a frame ever
  friend bool operator==(const LinkState&, const LinkState&) = default;
};

/// Where lost counters go on. A ground station whose counters are milliseconds of its clock is above, a
/// recording older than lost_counter_tolerance is below.
inline constexpr seconds lost_counter_tolerance{60};
[[nodiscard]] std::uint64_t lost_counter_floor(UtcTime now);
/// Milliseconds of UTC, what counters are on a strict link.
[[nodiscard]] std::uint64_t clock_counter(UtcTime now);
/// Milliseconds of the year 2004: a ground station whose counters are lower counts no clock.
inline constexpr std::uint64_t lowest_clock_counter = std::uint64_t{1} << 40U;

/// Octets of one copy on disk, whatever it holds.
inline constexpr std::size_t link_state_octets = 512;
inline constexpr std::size_t max_link_channels = 16;
inline constexpr std::size_t max_link_associations = 16;

/// Generation, next telecommand id, channels, associations: as short as it is.
void write_link_state(OctetWriter& writer, const LinkState& state);
/// @param with_telecommand_id  false: as version 1 of the copy on disk had it
[[nodiscard]] std::optional<LinkState> read_link_state(OctetReader& reader, bool with_telecommand_id = true);

/// One copy: magic, version, generation, next telecommand id, channels, associations, zeros, CRC-32C.
[[nodiscard]] Octets encode_link_state(const LinkState& state);
/// Version 1 had no telecommand id. nullopt: not a whole, undamaged copy of a known version.
[[nodiscard]] std::optional<LinkState> decode_link_state(OctetView octets);

}  // namespace srfs
