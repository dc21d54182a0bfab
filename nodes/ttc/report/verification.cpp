// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/report/verification.hpp"

namespace srfs {
namespace {

constexpr std::uint8_t verification_service = 1;

OctetWriter begin_report(const TelecommandOrigin& origin, Stage stage, std::uint8_t step) {
  OctetWriter writer;
  writer.u16(origin.request.packet_identification);
  writer.u16(origin.request.packet_sequence_control);
  if (stage == Stage::progress) writer.u8(step);
  return writer;
}

}  // namespace

bool wants_success(const TelecommandOrigin& origin, Stage stage) {
  const unsigned bit = (static_cast<unsigned>(stage) - 1) / 2;
  return (origin.ack_flags >> bit & 1U) != 0;
}

Report success_report(const TelecommandOrigin& origin, Stage stage, std::uint8_t step) {
  OctetWriter writer = begin_report(origin, stage, step);
  return Report{.apid = origin.apid,
                .service = verification_service,
                .subtype = static_cast<std::uint8_t>(stage),
                .destination_id = origin.source_id,
                .data = writer.take(),
                .urgent = true};
}

Report failure_report(const TelecommandOrigin& origin, Stage stage, std::uint16_t failure_code,
                      OctetView data, std::uint8_t step) {
  OctetWriter writer = begin_report(origin, stage, step);
  writer.u16(failure_code);
  writer.bytes(data);
  return Report{.apid = origin.apid,
                .service = verification_service,
                .subtype = static_cast<std::uint8_t>(static_cast<std::uint8_t>(stage) + 1),
                .destination_id = origin.source_id,
                .data = writer.take(),
                .urgent = true};
}

}  // namespace srfs
