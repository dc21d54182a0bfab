// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "wire/can_data_frame.hpp"

namespace srfs::sim {

/// The peripheral's end of the conversation with the computer: requests come out of frames, answers go into
/// frames. The times are the simulator's running time. Pure.
class PeripheralChannel {
 public:
  struct Counters {
    std::uint64_t frames_sent = 0;
    std::uint64_t frames_received = 0;
    std::uint64_t timeouts = 0;
  };

  virtual ~PeripheralChannel() = default;

  /// What it hears (request) and sends (answer).
  [[nodiscard]] virtual std::vector<wire::CanIdentifierPair> identifiers() const = 0;
  virtual void on_frame(const wire::CanDataFrame& frame, MonotonicTime now) = 0;
  virtual void on_transmit_confirm(const wire::CanDataFrame& frame, MonotonicTime now) = 0;
  virtual void on_transmit_refused(MonotonicTime now) = 0;
  /// The next complete request: wire::encode(PeripheralRequest).
  [[nodiscard]] virtual std::optional<Octets> take_request() = 0;
  /// An answer has begun and not ended.
  [[nodiscard]] virtual bool sending() const = 0;
  /// Begins an answer: wire::encode(PeripheralResponse), or what a fault has made of it.
  /// @return false: it cannot now
  virtual bool send(OctetView answer, MonotonicTime now) = 0;
  /// Forgets what is under way in both directions.
  virtual void abort() = 0;
  [[nodiscard]] virtual std::optional<wire::CanDataFrame> poll(MonotonicTime now) = 0;
  [[nodiscard]] virtual std::optional<MonotonicTime> next_deadline() const = 0;
  [[nodiscard]] virtual Counters counters() const = 0;
};

}  // namespace srfs::sim
