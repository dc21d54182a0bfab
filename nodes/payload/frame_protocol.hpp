// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <variant>
#include <vector>

#include "nodes/payload/peripheral_link.hpp"
#include "wire/can_data_frame.hpp"

namespace srfs {

/// The frames of a peripheral that does not speak docs/reference/icd_can.md: what a request is on the bus,
/// and what the answer means. A mission writes this class; FramePeripheralLink does the rest. Pure; it holds
/// the state of one request.
class FrameProtocol {
 public:
  using Frames = std::vector<wire::CanDataFrame>;
  /// The answer is not complete.
  struct NotYet {};
  /// The peripheral awaits more before it answers; frames as of a request.
  struct SendMore {
    Frames frames;
  };
  /// What a frame of the peripheral meant: an outcome ends the request.
  using Heard = std::variant<NotYet, SendMore, PeripheralLink::Outcome>;

  virtual ~FrameProtocol() = default;

  /// The identifiers that it uses; constant, at least one pair. Each request is before 1CDA0101 in
  /// arbitration.
  [[nodiscard]] virtual std::vector<wire::CanIdentifierPair> identifiers() const = 0;
  /// A new request; what was heard for the one before is forgotten.
  /// @return its frames, at most FramePeripheralLink::frames_max; none: the peripheral has no such request
  [[nodiscard]] virtual Frames begin(const PeripheralLink::Body& request) = 0;
  /// A frame on one of the answers' identifiers, while a request is under way.
  [[nodiscard]] virtual Heard hear(const wire::CanDataFrame& frame) = 0;
};

/// The answer to a wake-up: a measurement block as the dictionary's raw structure.
[[nodiscard]] PeripheralLink::Outcome measured(Octets measurement);
/// The answer to a wake-up while the peripheral starts.
[[nodiscard]] PeripheralLink::Outcome still_booting();
/// The answer to a telecommand's request.
[[nodiscard]] PeripheralLink::Outcome carried_out(wire::PeripheralResult result);
/// The answer to a reset: the peripheral restarts now.
[[nodiscard]] PeripheralLink::Outcome restarting();
/// Frames that are no answer.
[[nodiscard]] PeripheralLink::Outcome not_understood(const char* why);

}  // namespace srfs
