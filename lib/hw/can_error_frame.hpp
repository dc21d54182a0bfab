// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <linux/can.h>

#include <cstdint>
#include <optional>

#include "hw/can_bus.hpp"

namespace srfs::hw {

/// What one error frame of SocketCAN reports (linux/can/error.h): not a frame of the bus, but the
/// controller's report to its own computer. The hub of hw_sim sends the same.
struct CanErrorReport {
  bool bus_error = false;  ///< bit, form, stuff, CRC, acknowledgement, transceiver
  bool arbitration_lost = false;
  bool receive_overflow = false;
  bool bus_off = false;
  bool restarted = false;
  std::optional<CanBusState> state;  ///< active, warning, passive; the worse of transmit and receive side
  std::optional<std::uint16_t> transmit_errors;
  std::optional<std::uint16_t> receive_errors;
};

[[nodiscard]] constexpr bool is_error_frame(const can_frame& raw) {
  return (raw.can_id & CAN_ERR_FLAG) != 0;
}
/// @param raw  with CAN_ERR_FLAG
[[nodiscard]] CanErrorReport decode_error_frame(const can_frame& raw);

enum class CanTransition : std::uint8_t { none, state_changed, went_bus_off, restarted };
/// The controller after @p report; bus-off is left by a restart only, whatever else is reported meanwhile.
CanTransition apply(const CanErrorReport& report, CanController& controller, CanCounters& counters);

}  // namespace srfs::hw
