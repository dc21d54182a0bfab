// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs::hw {

enum class SerialError : std::uint8_t {
  gone,  ///< no device, or no peer at the other end of the pty, at present; it is opened again by later calls
};

struct SerialCounters {
  std::uint64_t octets_read = 0;
  std::uint64_t octets_written = 0;
  std::uint64_t overruns = 0;        ///< of the UART or the driver (TIOCGICOUNT, where the driver has it)
  std::uint64_t framing_errors = 0;  ///< likewise
  std::uint64_t reopened = 0;
};

/// A serial line: 8 data bits, no parity, 1 stop bit, raw, no flow control, held exclusively. Not
/// thread-safe. A vanished device is opened again by later calls, at most every 100 ms; fd() stays the same.
class SerialPort {
 public:
  virtual ~SerialPort() = default;

  /// Readable (EPOLLIN, level-triggered) when read() has something to do. Same number for the object's
  /// lifetime.
  [[nodiscard]] virtual int fd() const = 0;
  /// Reads what is there, up to the size of @p into; 0 when there is nothing. Never blocks.
  [[nodiscard]] virtual Result<std::size_t, SerialError> read(std::span<std::uint8_t> into) = 0;
  /// Writes what fits into the driver's buffer and returns how many octets that were (0 when full). Never
  /// blocks. There is no "writable" event: ask output_pending(), or write again after the time the octets
  /// take at the line's speed.
  [[nodiscard]] virtual Result<std::size_t, SerialError> write(OctetView octets) = 0;
  /// Octets accepted by write() that have not left yet, as far as the driver knows; 0 when gone.
  [[nodiscard]] virtual std::size_t output_pending() const = 0;
  /// Drops what has not left yet, so that closing does not wait for a transmitter that is stuck. Never
  /// blocks.
  virtual void discard_output() {}
  /// Why the device is gone, for a person; empty while it is there.
  [[nodiscard]] virtual std::string reason() const = 0;
  [[nodiscard]] virtual const SerialCounters& counters() const = 0;
};

}  // namespace srfs::hw
