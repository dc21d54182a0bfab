// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"
#include "hw/can_bus.hpp"
#include "wire/can_data_frame.hpp"

namespace srfs {

/// Proves that no frame of a dead process waits any more to be sent. When a writer is killed, its frames stay
/// in the interface's queue and in the controller, and no driver reports the latter. But frames leave an
/// interface in the order in which they were written. So a marker frame, to which no station listens, is
/// written behind them, and its echo is the proof. Without the echo in time the bus is jammed, and all
/// waiting frames are taken back, the marker too. Pure but for the handle of the bus; one object for each
/// proof.
class TransmitDrain {
 public:
  /// From the computer to itself, without data, behind every frame of a payload in arbitration
  /// (docs/reference/icd_can.md).
  static constexpr hw::CanFrame marker{
      .id = wire::transmit_marker_id, .extended = true, .size = 0, .data = {}, .timestamp = {}};
  static constexpr nanoseconds patience = milliseconds(25);  ///< for the echo: N_As of ISO-TP
  static constexpr nanoseconds retry = milliseconds(500);    ///< where frames cannot be taken back
  static constexpr nanoseconds period = milliseconds(1);     ///< of step()

  enum class State : std::uint8_t {
    waiting,
    empty,     ///< proven; the last step
    unproven,  ///< once for each wait that ended without proof; it goes on
  };

  /// To call each period, after what @p bus received was taken from it.
  State step(hw::CanBus& bus, MonotonicTime now);

 private:
  State take_back(hw::CanBus& bus, MonotonicTime now);

  std::optional<MonotonicTime> deadline_;
  bool written_ = false;
  bool tried_ = false;       ///< to take back
  bool taken_back_ = false;  ///< the answer to withdraw() may still be on its way
  std::uint64_t echoes_before_ = 0;
};

}  // namespace srfs
