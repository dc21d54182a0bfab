// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/payload_events.hpp"

#include <cassert>

#include <mission/structures.hpp>

namespace srfs {

EncodedEvent to_event(const PayloadEvent& event) {
  using Kind = PayloadEvent::Kind;
  switch (event.kind) {
    case Kind::peripheral_silent:
      return encode_event(mission::PayloadPeripheralSilentEvent{.slots = event.number});
    case Kind::peripheral_garbage:
      return encode_event(mission::PayloadPeripheralGarbageEvent{.reason = event.text});
    case Kind::peripheral_back:
      return encode_event(mission::PayloadPeripheralBackEvent{.slots = event.number});
    case Kind::peripheral_reset:
      return encode_event(mission::PayloadPeripheralResetEvent{.reason = event.text});
    case Kind::peripheral_power_cycled:
      return encode_event(mission::PayloadPeripheralPowerCycledEvent{.reason = event.text});
    case Kind::peripheral_babbles:
      return encode_event(mission::PayloadPeripheralBabblesEvent{.cycles = event.number});
    case Kind::peripheral_kept_off:
      return encode_event(mission::PayloadPeripheralKeptOffEvent{.cycles = event.number});
    case Kind::telecommand_failed:
      return encode_event(
          mission::PayloadTelecommandFailedEvent{.telecommand = event.id, .code = event.code});
  }
  assert(false);
  return {};
}

}  // namespace srfs
