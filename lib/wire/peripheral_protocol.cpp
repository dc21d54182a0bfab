// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/peripheral_protocol.hpp"

#include <cassert>
#include <optional>
#include <utility>

#include "wire/crc16.hpp"

namespace srfs::wire {
namespace {

constexpr std::uint8_t response_bit = 0x80;
constexpr std::size_t message_max = 4095;
constexpr std::size_t header_size = 2;  // opcode, sequence
constexpr std::size_t crc_size = 2;

Octets with_crc(OctetWriter writer) {
  writer.u16(crc16(writer.view()));
  assert(writer.ok());
  return writer.take();
}

/// Header and body of a message whose CRC holds.
struct Opened {
  std::uint8_t opcode;
  std::uint8_t sequence;
  OctetView body;
};

Result<Opened, PeripheralProtocolError> open_message(OctetView message) {
  if (message.size() < header_size + crc_size) return Err(PeripheralProtocolError::too_short);
  if (message.size() > message_max) return Err(PeripheralProtocolError::too_long);
  if (crc16(message) != 0) return Err(PeripheralProtocolError::bad_crc);
  return Opened{.opcode = message[0],
                .sequence = message[1],
                .body = message.subspan(header_size, message.size() - header_size - crc_size)};
}

/// What is wrong with a body that was read; nothing if it was read exactly.
std::optional<PeripheralProtocolError> left_over(const OctetReader& reader) {
  if (!reader.ok()) return PeripheralProtocolError::too_short;
  if (reader.remaining() != 0) return PeripheralProtocolError::too_long;
  return std::nullopt;
}

std::optional<PeripheralStatus> to_status(std::uint8_t octet) {
  if (octet > static_cast<std::uint8_t>(PeripheralStatus::booting)) return std::nullopt;
  return static_cast<PeripheralStatus>(octet);
}

Result<WakeUpResponse, PeripheralProtocolError> read_wake_up(OctetReader reader) {
  const auto status = to_status(reader.u8());
  const std::uint32_t uptime_ms = reader.u32();
  const OctetView measurement = reader.rest();
  if (!reader.ok()) return Err(PeripheralProtocolError::too_short);
  if (!status) return Err(PeripheralProtocolError::bad_value);
  return WakeUpResponse{.status = *status,
                        .uptime_ms = uptime_ms,
                        .measurement = Octets(measurement.begin(), measurement.end())};
}

Result<CommandResponse, PeripheralProtocolError> read_command(OctetReader reader) {
  const std::uint32_t telecommand_id = reader.u32();
  const std::uint8_t result = reader.u8();
  if (const auto wrong = left_over(reader)) return Err(*wrong);
  if (result > static_cast<std::uint8_t>(PeripheralResult::cannot_now))
    return Err(PeripheralProtocolError::bad_value);
  return CommandResponse{.telecommand_id = telecommand_id, .result = static_cast<PeripheralResult>(result)};
}

Result<ResetResponse, PeripheralProtocolError> read_reset(OctetReader reader) {
  const auto status = to_status(reader.u8());
  if (const auto wrong = left_over(reader)) return Err(*wrong);
  if (!status) return Err(PeripheralProtocolError::bad_value);
  return ResetResponse{.status = *status};
}

template <class Body>
Result<PeripheralResponse, PeripheralProtocolError> respond(std::uint8_t sequence,
                                                            Result<Body, PeripheralProtocolError> body) {
  if (!body) return Err(body.error());
  return PeripheralResponse{.sequence = sequence, .body = std::move(*body)};
}

}  // namespace

const char* to_string(PeripheralProtocolError error) {
  switch (error) {
    case PeripheralProtocolError::too_short:
      return "too short";
    case PeripheralProtocolError::too_long:
      return "too long";
    case PeripheralProtocolError::bad_crc:
      return "bad CRC";
    case PeripheralProtocolError::wrong_opcode:
      return "wrong opcode";
    case PeripheralProtocolError::wrong_sequence:
      return "wrong sequence";
    case PeripheralProtocolError::bad_value:
      return "bad value";
  }
  return "?";
}

PeripheralOpcode opcode_of(const PeripheralRequest& request) {
  if (std::holds_alternative<WakeUpRequest>(request.body)) return PeripheralOpcode::wake_up;
  if (std::holds_alternative<CommandRequest>(request.body)) return PeripheralOpcode::command;
  return PeripheralOpcode::reset;
}

PeripheralOpcode opcode_of(const PeripheralResponse& response) {
  if (std::holds_alternative<WakeUpResponse>(response.body)) return PeripheralOpcode::wake_up;
  if (std::holds_alternative<CommandResponse>(response.body)) return PeripheralOpcode::command;
  return PeripheralOpcode::reset;
}

Octets encode(const PeripheralRequest& request) {
  OctetWriter writer(message_max);
  writer.u8(static_cast<std::uint8_t>(opcode_of(request)));
  writer.u8(request.sequence);
  if (const auto* command = std::get_if<CommandRequest>(&request.body)) {
    writer.u32(command->telecommand_id);
    writer.u8(command->function);
    writer.bytes(command->arguments);
  }
  return with_crc(std::move(writer));
}

Octets encode(const PeripheralResponse& response) {
  OctetWriter writer(message_max);
  writer.u8(static_cast<std::uint8_t>(opcode_of(response)) | response_bit);
  writer.u8(response.sequence);
  if (const auto* wake_up = std::get_if<WakeUpResponse>(&response.body)) {
    writer.u8(static_cast<std::uint8_t>(wake_up->status));
    writer.u32(wake_up->uptime_ms);
    writer.bytes(wake_up->measurement);
  } else if (const auto* command = std::get_if<CommandResponse>(&response.body)) {
    writer.u32(command->telecommand_id);
    writer.u8(static_cast<std::uint8_t>(command->result));
  } else if (const auto* reset = std::get_if<ResetResponse>(&response.body)) {
    writer.u8(static_cast<std::uint8_t>(reset->status));
  }
  return with_crc(std::move(writer));
}

Result<PeripheralRequest, PeripheralProtocolError> decode_request(OctetView message) {
  const auto opened = open_message(message);
  if (!opened) return Err(opened.error());
  OctetReader reader(opened->body);
  PeripheralRequest request{.sequence = opened->sequence, .body = {}};
  switch (static_cast<PeripheralOpcode>(opened->opcode)) {
    case PeripheralOpcode::wake_up:
      request.body = WakeUpRequest{};
      break;
    case PeripheralOpcode::reset:
      request.body = ResetRequest{};
      break;
    case PeripheralOpcode::command: {
      CommandRequest command{.telecommand_id = reader.u32(), .function = reader.u8(), .arguments = {}};
      const OctetView arguments = reader.rest();
      command.arguments.assign(arguments.begin(), arguments.end());
      request.body = std::move(command);
      break;
    }
    default:
      return Err(PeripheralProtocolError::wrong_opcode);
  }
  if (const auto wrong = left_over(reader)) return Err(*wrong);
  return request;
}

Result<PeripheralResponse, PeripheralProtocolError> decode_response(OctetView message) {
  const auto opened = open_message(message);
  if (!opened) return Err(opened.error());
  if ((opened->opcode & response_bit) == 0) return Err(PeripheralProtocolError::wrong_opcode);
  const OctetReader reader(opened->body);
  switch (static_cast<PeripheralOpcode>(opened->opcode & ~response_bit)) {
    case PeripheralOpcode::wake_up:
      return respond(opened->sequence, read_wake_up(reader));
    case PeripheralOpcode::command:
      return respond(opened->sequence, read_command(reader));
    case PeripheralOpcode::reset:
      return respond(opened->sequence, read_reset(reader));
  }
  return Err(PeripheralProtocolError::wrong_opcode);
}

Result<PeripheralResponse, PeripheralProtocolError> decode_response(OctetView message,
                                                                    const PeripheralRequest& request) {
  auto response = decode_response(message);
  if (!response) return response;
  if (opcode_of(*response) != opcode_of(request)) return Err(PeripheralProtocolError::wrong_opcode);
  if (response->sequence != request.sequence) return Err(PeripheralProtocolError::wrong_sequence);
  const auto* command = std::get_if<CommandRequest>(&request.body);
  if (command != nullptr &&
      std::get<CommandResponse>(response->body).telecommand_id != command->telecommand_id) {
    return Err(PeripheralProtocolError::wrong_sequence);
  }
  return response;
}

}  // namespace srfs::wire
