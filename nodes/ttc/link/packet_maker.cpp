// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/packet_maker.hpp"

#include "wire/pus.hpp"

namespace srfs {

Octets PacketMaker::make(const Report& report, TaiTime time, TimeReference reference) {
  std::uint16_t& sequence = sequence_counts_[report.apid];
  const Type type{report.apid, report.destination_id, report.service, report.subtype};
  if (type_counters_.size() == max_type_counters && !type_counters_.contains(type)) {
    type_counters_.erase(type_counters_.begin());
  }
  std::uint16_t& type_counter = type_counters_[type];
  wire::TmPacket packet;
  packet.apid = report.apid;
  packet.sequence_count = sequence;
  packet.time_reference = static_cast<std::uint8_t>(reference);
  packet.service = report.service;
  packet.subtype = report.subtype;
  packet.type_counter = type_counter;
  packet.destination_id = report.destination_id;
  packet.time = time;
  packet.source = report.data;
  sequence = static_cast<std::uint16_t>((sequence + 1) & 0x3FFF);
  ++type_counter;
  return wire::make_tm_packet(packet);
}

}  // namespace srfs
