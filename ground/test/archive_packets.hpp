// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "ground/downlink.hpp"
#include "wire/pus.hpp"

// Packets for tests of the archive.
namespace srfs::ground {

inline const UtcTime start = *from_iso8601("2026-11-21T08:00:00Z");

inline ReceivedPacket made(wire::TmPacket packet, std::uint8_t vc = tm_channel::live) {
  ReceivedPacket received{.vc = vc, .packet = packet, .raw = wire::make_tm_packet(packet)};
  return received;
}

/// Housekeeping of timing, with a number that the test chooses.
inline ReceivedPacket timing(std::uint16_t sequence, UtcTime time, std::uint32_t ticks,
                             std::uint8_t vc = tm_channel::live) {
  mission::TimingHousekeeping fields{};
  fields.pulses_seen = ticks;
  OctetWriter source;
  source.u16(mission::structure::timing);
  fields.encode(source);
  return made({.apid = 2,
               .sequence_count = sequence,
               .time_reference = 1,
               .service = 3,
               .subtype = 25,
               .time = to_tai(time),
               .source = source.take()},
              vc);
}

inline ReceivedPacket verification(wire::RequestId request, std::uint8_t subtype, std::uint16_t sequence,
                                   OctetView more = {}) {
  OctetWriter source;
  source.u16(request.packet_identification);
  source.u16(request.packet_sequence_control);
  source.bytes(more);
  return made({.apid = 17,
               .sequence_count = sequence,
               .service = 1,
               .subtype = subtype,
               .time = to_tai(start),
               .source = source.take()});
}

}  // namespace srfs::ground
