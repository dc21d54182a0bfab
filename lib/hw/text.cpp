// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw/can_bus.hpp"
#include "hw/gpio.hpp"
#include "hw/watchdog.hpp"

namespace srfs::hw {

const char* to_string(CanError error) {
  switch (error) {
    case CanError::queue_full:
      return "transmit queue full";
    case CanError::invalid_frame:
      return "invalid frame";
    case CanError::bus_off:
      return "bus off";
    case CanError::down:
      return "interface down";
    case CanError::gone:
      return "gone";
    case CanError::not_granted:
      return "not granted";
  }
  return "?";
}

const char* to_string(CanBusState state) {
  switch (state) {
    case CanBusState::active:
      return "active";
    case CanBusState::warning:
      return "warning";
    case CanBusState::passive:
      return "passive";
    case CanBusState::bus_off:
      return "bus off";
    case CanBusState::down:
      return "down";
    case CanBusState::gone:
      return "gone";
  }
  return "?";
}

const char* to_string(GpioError error) {
  switch (error) {
    case GpioError::gone:
      return "gone";
    case GpioError::no_line:
      return "no such line";
    case GpioError::not_ours:
      return "line held by another process";
    case GpioError::refused:
      return "refused";
    case GpioError::timeout:
      return "no answer";
  }
  return "?";
}

const char* to_string(WatchdogError error) {
  switch (error) {
    case WatchdogError::gone:
      return "gone";
    case WatchdogError::not_allowed:
      return "not allowed";
  }
  return "?";
}

}  // namespace srfs::hw
