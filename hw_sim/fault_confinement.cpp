// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/fault_confinement.hpp"

#include <algorithm>

namespace srfs::sim {

void FaultConfinement::on_transmit_error() {
  transmit_errors_ = std::min(transmit_errors_ + 8, bus_off_above + 1);
}

void FaultConfinement::on_receive_error() {
  receive_errors_ = std::min(receive_errors_ + 1, bus_off_above);
}

void FaultConfinement::on_transmitted() {
  if (transmit_errors_ > 0 && transmit_errors_ <= bus_off_above) --transmit_errors_;
}

void FaultConfinement::on_received() {
  if (receive_errors_ >= passive_from) {
    receive_errors_ = 119;  // the standard: to a value between 119 and 127
  } else if (receive_errors_ > 0) {
    --receive_errors_;
  }
}

ErrorState FaultConfinement::state() const {
  if (transmit_errors_ > bus_off_above) return ErrorState::bus_off;
  const unsigned worse = std::max(transmit_errors_, receive_errors_);
  if (worse >= passive_from) return ErrorState::passive;
  return worse >= warning_from ? ErrorState::warning : ErrorState::active;
}

}  // namespace srfs::sim
