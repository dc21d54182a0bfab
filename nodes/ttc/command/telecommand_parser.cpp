// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/command/telecommand_parser.hpp"

#include <mission/structures.hpp>

#include "nodes/ttc/command/packet_refusal.hpp"
#include "nodes/ttc/services/connection_tester.hpp"

namespace srfs {
namespace {

constexpr std::uint8_t function_service = 8;
constexpr std::uint8_t perform_function = 1;
constexpr std::ptrdiff_t function_id_octets = 2;

}  // namespace

JudgedTelecommand TelecommandParser::parse(OctetView packet) const {
  JudgedTelecommand judged;
  TelecommandOrigin& origin = judged.telecommand.origin;
  origin.apid = own_apid_;
  auto parsed = wire::parse_tc_packet(packet);
  if (!parsed) {
    origin.request = wire::peek_request_id(packet).value_or(wire::RequestId{});
    judged.refusal = packet_refusal(parsed.error());
    return judged;
  }
  origin.request = wire::request_id(*parsed);
  origin.ack_flags = parsed->ack_flags;
  origin.source_id = parsed->source_id;
  // Only ttc can answer for an application process that does not exist.
  if (dictionary_.apid(parsed->apid) != nullptr) origin.apid = parsed->apid;
  const auto command = find_command(*parsed);
  if (!command) {
    judged.refusal = command.error();
    return judged;
  }
  judged.telecommand.command = *command;
  Octets& arguments = judged.telecommand.arguments = std::move(parsed->application);
  if ((*command)->is_function()) arguments.erase(arguments.begin(), arguments.begin() + function_id_octets);
  return judged;
}

Result<const mission::Command*, Refusal> TelecommandParser::find_command(const wire::TcPacket& packet) const {
  if (dictionary_.apid(packet.apid) == nullptr)
    return Err(Refusal{.code = mission::failure::unknown_apid, .stage = Stage::routing});
  if (packet.service == function_service && packet.subtype == perform_function) {
    OctetReader reader(packet.application);
    const std::uint16_t function_id = reader.u16();
    if (!reader.ok()) return Err(Refusal{.code = mission::failure::bad_arguments_length});
    const mission::Command* function = dictionary_.function(packet.apid, function_id);
    if (function == nullptr)
      return Err(
          Refusal{.code = mission::failure::unknown_function, .parameter = octets_of_u16(function_id)});
    return function;
  }
  const mission::Command* request = dictionary_.request(packet.apid, packet.service, packet.subtype);
  if (request != nullptr) return request;
  // Every application process can be asked whether it is alive; ttc asks its node.
  if (packet.service == ConnectionTester::service_type && packet.subtype == ConnectionTester::are_you_alive)
    return dictionary_.request(own_apid_, packet.service, packet.subtype);
  const bool service_known =
      packet.service == function_service || dictionary_.has_service(packet.apid, packet.service);
  return Err(
      Refusal{.code = service_known ? mission::failure::unknown_subtype : mission::failure::unknown_service});
}

std::optional<Refusal> TelecommandParser::check_arguments(const Telecommand& telecommand) const {
  const auto checked = dictionary_.check_arguments(*telecommand.command, telecommand.arguments);
  if (checked) return std::nullopt;
  const std::uint8_t position = checked.error().parameter;
  if (position == 0) return Refusal{.code = mission::failure::bad_arguments_length};
  return Refusal{.code = mission::failure::bad_argument, .parameter = {position}};
}

}  // namespace srfs
