#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"
#include "hw/can_bus.hpp"

namespace srfs {

/// Proves that nothing a dead process wrote waits any more to be sent. What was written stays with the
/// interface when its writer is killed, in the queue and in the controller, and no driver tells the second.
/// But frames leave an interface in the order in which they were written: so one frame that nobody listens to
/// is written behind them, and its echo is the proof. If it does not come in time the bus is jammed, and all
/// that waits is taken back, the marker too. Pure but for the handle of the bus; one object for each proof.
class TransmitDrain {
 public:
  /// From the computer to itself, without data, behind every frame of a payload in arbitration
  /// (docs/icd_can.md).
  static constexpr hw::CanFrame marker{
      .id = 0x1CDA0101, .extended = true, .size = 0, .data = {}, .timestamp = {}};
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
