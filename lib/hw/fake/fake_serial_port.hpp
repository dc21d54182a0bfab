// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <limits>
#include <string>

#include "hw/fake/readiness.hpp"
#include "hw/serial_port.hpp"

namespace srfs::hw {

/// An in-memory serial line for tests.
class FakeSerialPort : public SerialPort {
 public:
  [[nodiscard]] int fd() const override { return readiness_.fd(); }
  [[nodiscard]] Result<std::size_t, SerialError> read(std::span<std::uint8_t> into) override {
    if (gone) return Err(SerialError::gone);
    const std::size_t n = std::min(into.size(), incoming_.size());
    std::copy_n(incoming_.begin(), n, into.begin());
    incoming_.erase(incoming_.begin(), incoming_.begin() + static_cast<std::ptrdiff_t>(n));
    if (incoming_.empty()) readiness_.clear();
    counters_.octets_read += n;
    return n;
  }
  [[nodiscard]] Result<std::size_t, SerialError> write(OctetView octets) override {
    if (gone) return Err(SerialError::gone);
    const std::size_t n = std::min(octets.size(), room);
    room -= n;
    written.insert(written.end(), octets.begin(), octets.begin() + static_cast<std::ptrdiff_t>(n));
    counters_.octets_written += n;
    return n;
  }
  [[nodiscard]] std::size_t output_pending() const override { return pending; }
  [[nodiscard]] std::string reason() const override { return gone ? "fake" : ""; }
  [[nodiscard]] const SerialCounters& counters() const override { return counters_; }

  void deliver(OctetView octets) {
    incoming_.insert(incoming_.end(), octets.begin(), octets.end());
    if (!incoming_.empty()) readiness_.set();
  }

  Octets written;
  std::size_t room = std::numeric_limits<std::size_t>::max();  ///< octets the driver still takes
  std::size_t pending = 0;
  bool gone = false;

 private:
  Readiness readiness_;
  Octets incoming_;
  SerialCounters counters_;
};

}  // namespace srfs::hw
