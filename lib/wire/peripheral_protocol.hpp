// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <variant>

#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs::wire {

/// What the computer and a peripheral exchange in one ISO-TP message (docs/reference/icd_can.md). Big-endian;
/// each message ends with a CRC-16 (CCITT polynomial, start value FFFF) over everything before it.
enum class PeripheralOpcode : std::uint8_t { wake_up = 0x01, command = 0x02, reset = 0x03 };

enum class PeripheralStatus : std::uint8_t { ready = 0, booting = 1 };

enum class PeripheralResult : std::uint8_t {
  done = 0,
  already_done = 1,  ///< this telecommand id is among the last 16 executed; nothing happened now
  unknown_function = 2,
  bad_argument = 3,
  cannot_now = 4,
};

/// Room for variable parts within one ISO-TP message of 4095 octets.
inline constexpr std::size_t peripheral_arguments_max = 4095 - 2 - 5 - 2;
inline constexpr std::size_t peripheral_measurement_max = 4095 - 2 - 5 - 2;

struct WakeUpRequest {
  friend bool operator==(const WakeUpRequest&, const WakeUpRequest&) = default;
};
struct CommandRequest {
  std::uint32_t telecommand_id =
      0;  ///< low 32 bits of the telecommand's id; the peripheral recognises repeats by it
  std::uint8_t function = 0;
  Octets arguments{};
  friend bool operator==(const CommandRequest&, const CommandRequest&) = default;
};
struct ResetRequest {
  friend bool operator==(const ResetRequest&, const ResetRequest&) = default;
};
struct PeripheralRequest {
  std::uint8_t sequence = 0;  ///< returned in the response
  std::variant<WakeUpRequest, CommandRequest, ResetRequest> body;
  friend bool operator==(const PeripheralRequest&, const PeripheralRequest&) = default;
};

struct WakeUpResponse {
  PeripheralStatus status = PeripheralStatus::ready;
  std::uint32_t uptime_ms = 0;  ///< since the peripheral's start; wraps
  Octets measurement{};         ///< raw measurement block; empty while booting
  friend bool operator==(const WakeUpResponse&, const WakeUpResponse&) = default;
};
struct CommandResponse {
  std::uint32_t telecommand_id = 0;
  PeripheralResult result = PeripheralResult::done;
  friend bool operator==(const CommandResponse&, const CommandResponse&) = default;
};
/// The last message before the peripheral restarts.
struct ResetResponse {
  PeripheralStatus status = PeripheralStatus::ready;
  friend bool operator==(const ResetResponse&, const ResetResponse&) = default;
};
struct PeripheralResponse {
  std::uint8_t sequence = 0;
  std::variant<WakeUpResponse, CommandResponse, ResetResponse> body;
  friend bool operator==(const PeripheralResponse&, const PeripheralResponse&) = default;
};

enum class PeripheralProtocolError : std::uint8_t {
  too_short,  ///< fewer octets than the opcode's fixed fields and CRC
  too_long,   ///< octets left over, or above 4095
  bad_crc,
  wrong_opcode,    ///< unknown, or not the answer to what was asked
  wrong_sequence,  ///< answer to another request
  bad_value,       ///< a status or result outside its enumeration
};
[[nodiscard]] const char* to_string(PeripheralProtocolError error);

[[nodiscard]] PeripheralOpcode opcode_of(const PeripheralRequest& request);
[[nodiscard]] PeripheralOpcode opcode_of(const PeripheralResponse& response);

/// The octets of one message. Variable parts longer than their maximum above are a bug (assert).
[[nodiscard]] Octets encode(const PeripheralRequest& request);
[[nodiscard]] Octets encode(const PeripheralResponse& response);

/// Reads one complete message; the CRC is checked before anything else is believed.
[[nodiscard]] Result<PeripheralRequest, PeripheralProtocolError> decode_request(OctetView message);
[[nodiscard]] Result<PeripheralResponse, PeripheralProtocolError> decode_response(OctetView message);
/// The same, and it must be the answer to @p request.
[[nodiscard]] Result<PeripheralResponse, PeripheralProtocolError> decode_response(
    OctetView message, const PeripheralRequest& request);

}  // namespace srfs::wire
