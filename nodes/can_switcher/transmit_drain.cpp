// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/transmit_drain.hpp"

namespace srfs {

using hw::CanError;

TransmitDrain::State TransmitDrain::step(hw::CanBus& bus, MonotonicTime now) {
  if (!deadline_) deadline_ = now + patience;
  if (written_ && bus.counters().echoed > echoes_before_) return State::empty;
  if (bus.unconfirmed() == 0) {
    if (taken_back_) return State::empty;
    written_ = false;  // not yet, or it was lost with the device or by a bus-off
  }
  if (!written_) {
    echoes_before_ = bus.counters().echoed;
    const auto sent = bus.send(marker);
    written_ = sent.has_value();
    if (!sent) {
      // An interface that goes down, and a hub that ends, forget what waits.
      if (sent.error() == CanError::down || sent.error() == CanError::gone) return State::empty;
      // What a controller keeps while it is off the bus is its driver's choice.
      if (sent.error() == CanError::bus_off && !tried_) return take_back(bus, now);
    }
  }
  return now < *deadline_ ? State::waiting : take_back(bus, now);
}

TransmitDrain::State TransmitDrain::take_back(hw::CanBus& bus, MonotonicTime now) {
  deadline_ = now + retry;
  tried_ = true;
  taken_back_ = bus.withdraw();
  if (!taken_back_) return State::unproven;
  return bus.unconfirmed() == 0 ? State::empty : State::waiting;
}

}  // namespace srfs
