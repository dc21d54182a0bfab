// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "base/time.hpp"
#include "nodes/payload/payload_cycle.hpp"
#include "wire/can_data_frame.hpp"
#include "wire/peripheral_protocol.hpp"

namespace srfs {

/// The computer's end of the conversation with one peripheral: one request at a time, and its answer. How
/// long a request may take is the caller's; only time-outs within the protocol run here. Pure.
///
/// Use: after on_frame() and on_transmit_confirm() take_outcome(), which has what the frames alone decide;
/// after every call and at next_deadline() poll() until it gives nothing, then take_outcome().
class PeripheralLink {
 public:
  struct Failure {
    RequestFailure kind = RequestFailure::silent;
    std::string detail;
  };
  using Body = decltype(SendRequest::body);
  using Outcome = Result<wire::PeripheralResponse, Failure>;
  struct Counters {
    std::uint32_t late_answers = 0;      ///< to an earlier request, or to none
    std::uint64_t transport_errors = 0;  ///< frames that did not fit, and time-outs within the protocol
  };

  virtual ~PeripheralLink() = default;

  /// What it sends and hears; constant, at least one.
  [[nodiscard]] virtual std::vector<wire::CanIdentifierPair> identifiers() const = 0;

  /// Starts a request; one under way is forgotten.
  virtual void request(const Body& body, MonotonicTime now) = 0;
  /// Forgets the request under way: nothing more is sent, a late answer is only counted.
  virtual void abort() = 0;

  virtual void on_frame(const wire::CanDataFrame& frame, MonotonicTime now) = 0;
  /// The echo of an own frame: it has left on the bus.
  virtual void on_transmit_confirm(const wire::CanDataFrame& frame, MonotonicTime now) = 0;
  /// The driver has no room for the frame that poll() gave last: it is given again.
  virtual void on_transmit_refused(MonotonicTime now) = 0;
  /// The next frame for the bus.
  [[nodiscard]] virtual std::optional<wire::CanDataFrame> poll(MonotonicTime now) = 0;
  [[nodiscard]] virtual std::optional<MonotonicTime> next_deadline() const = 0;
  /// The answer to the request under way, or why there will be none; once. After poll().
  [[nodiscard]] virtual std::optional<Outcome> take_outcome() = 0;

  [[nodiscard]] virtual Counters counters() const = 0;
};

}  // namespace srfs
