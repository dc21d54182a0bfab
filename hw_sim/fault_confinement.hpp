// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/time.hpp"

namespace srfs::sim {

enum class ErrorState : unsigned char { active, warning, passive, bus_off };

/// The error counters of one CAN controller (ISO 11898-1, fault confinement), in the rules that whole frames
/// and whole error frames need: a transmitter's error +8, its success -1; a receiver's error +1, its success
/// -1. Left out: the extra +8 of a receiver that sees a dominant bit after its error flag, the exceptions for
/// acknowledgement errors, overload frames. Pure.
class FaultConfinement {
 public:
  void on_transmit_error();
  void on_receive_error();
  void on_transmitted();
  void on_received();
  void force_bus_off() { transmit_errors_ = bus_off_above + 1; }
  void restart() { *this = {}; }

  [[nodiscard]] ErrorState state() const;
  /// TEC; above 255 it means bus-off, and stays.
  [[nodiscard]] unsigned transmit_errors() const { return transmit_errors_; }
  [[nodiscard]] unsigned receive_errors() const { return receive_errors_; }

  static constexpr unsigned warning_from = 96;
  static constexpr unsigned passive_from = 128;
  static constexpr unsigned bus_off_above = 255;
  /// A restarted controller listens for 128 times 11 recessive bits before it takes part again.
  static constexpr unsigned recovery_bits = 128 * 11;

 private:
  unsigned transmit_errors_ = 0;
  unsigned receive_errors_ = 0;
};

}  // namespace srfs::sim
