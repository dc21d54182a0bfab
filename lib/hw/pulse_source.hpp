// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/time.hpp"

namespace srfs::hw {

/// One pulse per second of a GPS receiver.
struct Pulse {
  MonotonicTime edge;         ///< the rising edge, on CLOCK_MONOTONIC
  std::uint64_t counter = 0;  ///< of the source; a gap means missed pulses
  friend bool operator==(const Pulse&, const Pulse&) = default;
};

struct PulseCounters {
  std::uint64_t received = 0;
  std::uint64_t dropped = 0;    ///< unread pulses above the queue of 8; the oldest makes room
  std::uint64_t malformed = 0;  ///< not a pulse, or an edge that cannot be placed on CLOCK_MONOTONIC
  std::uint64_t reopened = 0;
};

/// Source of second pulses. Not thread-safe. A vanished source is opened again, at most every 100 ms; fd()
/// stays the same.
class PulseSource {
 public:
  virtual ~PulseSource() = default;

  /// Readable (EPOLLIN, level-triggered) when read() has something to do. Same number for the object's
  /// lifetime.
  [[nodiscard]] virtual int fd() const = 0;
  /// The oldest unread pulse; nullopt when there is none. Never blocks.
  [[nodiscard]] virtual std::optional<Pulse> read() = 0;
  /// Why there is no source at present, for a person; empty while there is one.
  [[nodiscard]] virtual std::string reason() const = 0;
  [[nodiscard]] virtual const PulseCounters& counters() const = 0;
};

}  // namespace srfs::hw
