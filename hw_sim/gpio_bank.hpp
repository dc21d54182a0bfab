// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>

#include "base/octets.hpp"

namespace srfs::sim {

struct GpioCounters {
  std::uint64_t requests = 0;
  std::uint64_t refused = 0;
};

/// Lines 0-7: power switches, on at the start. Lines 8-11: inputs. Pure.
class GpioBank {
 public:
  static constexpr std::size_t switch_count = 8;
  enum Status : std::uint8_t { ok = 0, no_such_line = 1, not_an_output = 2, bad_request = 3 };

  /// @param inputs    the levels of lines 8-11, bits 0-3
  /// @param on_switch  called when a power switch changes
  GpioBank(std::function<std::uint8_t()> inputs, std::function<void(std::size_t line, bool on)> on_switch)
      : inputs_(std::move(inputs)), on_switch_(std::move(on_switch)) {}

  /// One request of the sim: protocol (docs/reference/icd_can.md): {op, line, value, 0} -> {status, line,
  /// value, 0}.
  [[nodiscard]] std::array<std::uint8_t, 4> on_request(OctetView request);
  /// Holds the inputs at fixed levels; nullopt: back to the sensors.
  void force_inputs(std::optional<std::uint8_t> bits) { forced_ = bits; }
  [[nodiscard]] bool power(std::size_t line) const { return power_.at(line); }
  [[nodiscard]] const GpioCounters& counters() const { return counters_; }

 private:
  static constexpr std::uint8_t first_input = 8;
  static constexpr std::uint8_t input_count = 4;
  [[nodiscard]] std::uint8_t inputs() const {
    return static_cast<std::uint8_t>(forced_.value_or(inputs_()) & 0x0FU);
  }
  [[nodiscard]] std::array<std::uint8_t, 4> read_line(std::uint8_t line) const;
  [[nodiscard]] std::array<std::uint8_t, 4> write_line(std::uint8_t line, std::uint8_t value);

  std::function<std::uint8_t()> inputs_;
  std::function<void(std::size_t, bool)> on_switch_;
  std::array<bool, switch_count> power_{true, true, true, true, true, true, true, true};
  std::optional<std::uint8_t> forced_;
  GpioCounters counters_;
};

}  // namespace srfs::sim
