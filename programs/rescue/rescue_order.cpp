// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/rescue/rescue_order.hpp"

#include <array>

#include "nodes/ttc/command/packet_refusal.hpp"
#include "nodes/ttc/files/file_service.hpp"
#include "wire/pus.hpp"

namespace srfs::rescue {
namespace {

constexpr std::uint8_t function_service = 8;
constexpr std::uint8_t perform_function = 1;
constexpr std::uint16_t own_apid = mission::TtcSelectKeys::apid;

Refusal refusal_of(const mission::ArgumentError& error) {
  if (error.parameter == 0) return {.code = mission::failure::bad_arguments_length};
  return {.code = mission::failure::bad_argument, .parameter = {error.parameter}};
}

using Decoded = Result<Order, Refusal>;

struct Function {
  std::uint16_t apid;
  std::uint16_t id;
  Decoded (*decode)(OctetView arguments);
};

template <class Command>
constexpr Function function() {
  return {Command::apid, Command::function_id, [](OctetView arguments) -> Decoded {
            auto command = Command::decode(arguments);
            if (!command) return Err(refusal_of(command.error()));
            return Order(std::move(*command));
          }};
}

constexpr std::array functions{
    function<mission::TtcSelectKeys>(), function<mission::TtcTransmitterOn>(),
    function<mission::RescueReport>(),  function<mission::RescueStartSuite>(),
    function<mission::RescueReboot>(),  function<mission::RescueReset>(),
    function<mission::RescueMend>(),    function<mission::RescueRestore>(),
    function<mission::RescueFetch>(),   function<mission::RescueList>(),
};

Decoded decode_function(const wire::TcPacket& packet) {
  OctetReader reader(packet.application);
  const std::uint16_t id = reader.u16();
  if (!reader.ok()) return Err(Refusal{.code = mission::failure::bad_arguments_length});
  for (const Function& known : functions) {
    if (known.apid == packet.apid && known.id == id) return known.decode(reader.rest());
  }
  return Err(Refusal{.code = mission::failure::unknown_function, .parameter = octets_of_u16(id)});
}

Decoded decode_file_order(const wire::TcPacket& packet) {
  mission::Command command;
  command.service = packet.service;
  command.subtype = packet.subtype;
  auto order = file_order_of(command, packet.application);
  if (order) return Order(std::move(*order));
  return Err(Refusal{.code = mission::failure::bad_arguments_length});
}

Decoded decode(const wire::TcPacket& packet) {
  if (packet.service == mission::TtcPing::service && packet.subtype == mission::TtcPing::subtype) {
    if (packet.application.empty()) return Order(Ping{});
    return Err(Refusal{.code = mission::failure::bad_arguments_length});
  }
  using mission::HousekeepingOneShot;
  if (packet.service == HousekeepingOneShot::service && packet.subtype == HousekeepingOneShot::subtype) {
    auto structures = HousekeepingOneShot::decode(packet.application);
    if (!structures) return Err(refusal_of(structures.error()));
    return Order(std::move(*structures));
  }
  if (packet.service == function_service && packet.subtype == perform_function)
    return decode_function(packet);
  if (packet.apid == own_apid && packet.service == FileService::service_type)
    return decode_file_order(packet);
  return Err(Refusal{.code = mission::failure::unknown_service});
}

}  // namespace

JudgedOrder judge(OctetView octets) {
  JudgedOrder judged;
  judged.origin.apid = own_apid;
  const auto packet = wire::parse_tc_packet(octets);
  if (!packet) {
    judged.origin.request = wire::peek_request_id(octets).value_or(wire::RequestId{});
    judged.refusal = packet_refusal(packet.error());
    return judged;
  }
  judged.origin.request = wire::request_id(*packet);
  judged.origin.ack_flags = packet->ack_flags;
  judged.origin.source_id = packet->source_id;
  // Of other application processes none is there to answer.
  auto order = packet->apid == own_apid
                   ? decode(*packet)
                   : Decoded(Err(Refusal{.code = mission::failure::unknown_apid, .stage = Stage::routing}));
  if (order) {
    judged.order = std::move(*order);
  } else {
    judged.refusal = order.error();
  }
  return judged;
}

}  // namespace srfs::rescue
