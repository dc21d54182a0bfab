// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "msgs/mission/encoded_event.hpp"
#include "nodes/payload/isotp_peripheral_link.hpp"
#include "nodes/payload/payload_cycle.hpp"
#include "suite/commanding/command_set.hpp"

namespace srfs {

/// A housekeeping structure of the mission dictionary, encoded.
struct EncodedStructure {
  std::uint16_t id = 0;
  Octets data;
};
/// The counters as the payload's own structure: its cycle and the groups that all payloads share.
template <class Housekeeping>
[[nodiscard]] EncodedStructure encode_counters(MissionCycle cycle, const mission::PayloadCounters& counters,
                                               const mission::SensorInputs& inputs) {
  Housekeeping hk;
  hk.cycle = cycle;
  hk.counters = counters;
  hk.inputs = inputs;
  return {Housekeeping::structure_id, hk.encoded()};
}

/// What a measurement became.
struct Processed {
  Octets housekeeping;  ///< the payload's housekeeping structure, encoded
  std::vector<EncodedEvent> events;
};

/// What makes one payload different from another. process(), on_command_done(), state() and restore_state()
/// are called on one worker thread (restore_state() before it starts); the others are constant.
class PayloadProfile {
 public:
  virtual ~PayloadProfile() = default;

  [[nodiscard]] virtual std::uint16_t apid() const = 0;
  [[nodiscard]] virtual std::uint16_t structure_id() const = 0;

  [[nodiscard]] virtual EncodedStructure counters(MissionCycle cycle,
                                                  const mission::PayloadCounters& counters,
                                                  const mission::SensorInputs& inputs) const = 0;

  /// How its peripheral is asked; by default the protocol of docs/reference/icd_can.md. For another one: a
  /// FramePeripheralLink.
  [[nodiscard]] virtual std::unique_ptr<PeripheralLink> make_link(std::uint8_t can_address) const {
    return std::make_unique<IsoTpPeripheralLink>(can_address);
  }

  /// What a telecommand asks for, every argument checked against the dictionary. Any thread.
  [[nodiscard]] virtual Result<PayloadCommand, FailureCode> decode_command(std::uint16_t function,
                                                                           OctetView arguments) const = 0;
  /// @param block  the raw measurement structure of the dictionary
  /// @return nullopt when the block is not one
  [[nodiscard]] virtual std::optional<Processed> process(OctetView block, MissionCycle cycle,
                                                         const mission::SlotStatistics& slots) = 0;
  /// The peripheral executed this. @return true when state() changed
  virtual bool on_command_done(const PeripheralFunction& /*command*/) { return false; }
  /// What processing must remember across a restart of the node; may be empty.
  [[nodiscard]] virtual Octets state() const { return {}; }
  /// @return false: this version cannot read it, and nothing has changed
  [[nodiscard]] virtual bool restore_state(OctetView /*state*/) { return true; }
};

/// A command that goes to the peripheral as it is: its arguments lie in the request exactly as in the
/// telecommand.
template <class Command>
[[nodiscard]] Result<PayloadCommand, FailureCode> to_peripheral(OctetView arguments) {
  if (const auto command = Command::decode(arguments); !command) return Err(failure_code(command.error()));
  return PayloadCommand(
      PeripheralFunction{Command::peripheral_function, Octets(arguments.begin(), arguments.end())});
}
template <class Command>
[[nodiscard]] Result<PayloadCommand, FailureCode> to_reset(OctetView arguments) {
  if (const auto command = Command::decode(arguments); !command) return Err(failure_code(command.error()));
  return PayloadCommand(ResetPeripheral{});
}
template <class Command>
[[nodiscard]] Result<PayloadCommand, FailureCode> to_power_cycle(OctetView arguments) {
  const auto command = Command::decode(arguments);
  if (!command) return Err(failure_code(command.error()));
  return PayloadCommand(PowerCyclePeripheral{milliseconds(command->off_ms)});
}

}  // namespace srfs
