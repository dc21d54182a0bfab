// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw/can_error_frame.hpp"

#include <linux/can/error.h>

namespace srfs::hw {
namespace {

std::optional<CanBusState> state_of(std::uint8_t status) {
  if ((status & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) return CanBusState::passive;
  if ((status & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0) return CanBusState::warning;
  if ((status & CAN_ERR_CRTL_ACTIVE) != 0) return CanBusState::active;
  return std::nullopt;
}

}  // namespace

CanErrorReport decode_error_frame(const can_frame& raw) {
  const canid_t id = raw.can_id;
  CanErrorReport report;
  report.bus_error = (id & (CAN_ERR_PROT | CAN_ERR_ACK | CAN_ERR_BUSERROR | CAN_ERR_TRX)) != 0;
  report.arbitration_lost = (id & CAN_ERR_LOSTARB) != 0;
  report.bus_off = (id & CAN_ERR_BUSOFF) != 0;
  report.restarted = (id & CAN_ERR_RESTARTED) != 0;
  if ((id & CAN_ERR_CRTL) != 0) {
    report.receive_overflow = (raw.data[1] & CAN_ERR_CRTL_RX_OVERFLOW) != 0;
    report.state = state_of(raw.data[1]);
  }
  // Without the flag a kernel before 6.0 may have written them, or not: they are not believed.
  if ((id & CAN_ERR_CNT) != 0) {
    report.transmit_errors = raw.data[6];
    report.receive_errors = raw.data[7];
  }
  return report;
}

CanTransition apply(const CanErrorReport& report, CanController& controller, CanCounters& counters) {
  if (report.bus_error) ++counters.bus_errors;
  if (report.arbitration_lost) ++counters.arbitration_lost;
  if (report.receive_overflow) ++counters.receive_overruns;
  if (report.transmit_errors) controller.transmit_errors = report.transmit_errors;
  if (report.receive_errors) controller.receive_errors = report.receive_errors;

  const CanBusState before = controller.state;
  if (report.restarted) {
    controller.state = report.state.value_or(CanBusState::active);
    if (controller.transmit_errors) controller.transmit_errors = report.transmit_errors.value_or(0);
    if (controller.receive_errors) controller.receive_errors = report.receive_errors.value_or(0);
    if (before != CanBusState::bus_off) return CanTransition::none;
    ++counters.restarts;
    return CanTransition::restarted;
  }
  if (report.bus_off) {
    controller.state = CanBusState::bus_off;
    if (before == CanBusState::bus_off) return CanTransition::none;
    ++counters.bus_off;
    return CanTransition::went_bus_off;
  }
  if (before == CanBusState::bus_off || !report.state || *report.state == before) return CanTransition::none;
  controller.state = *report.state;
  return CanTransition::state_changed;
}

}  // namespace srfs::hw
