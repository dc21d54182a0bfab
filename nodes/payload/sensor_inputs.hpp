// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"

namespace srfs {

/// The on-board sensor inputs on GPIO that one payload node reports. Bit n of a bank is line 8 + n. Pure.
class SensorInputs {
 public:
  /// At most one event in this time; what changes meanwhile is reported then, if it still differs.
  static constexpr nanoseconds event_period = seconds(5);

  struct Reading {
    std::uint8_t levels = 0;
    std::uint8_t read = 0;  ///< inputs that could be read; the others keep what was known of them
  };
  struct Change {
    std::uint8_t before = 0;
    std::uint8_t after = 0;
    friend bool operator==(const Change&, const Change&) = default;
  };

  /// @param assigned  the inputs that are read
  explicit SensorInputs(std::uint8_t assigned) : assigned_(assigned) {}

  /// @return what to report, if anything. The first level of an input is no change.
  [[nodiscard]] std::optional<Change> on_reading(Reading reading, MonotonicTime now);

  [[nodiscard]] std::uint8_t levels() const { return levels_; }
  /// Inputs that were read the last time; the level of another one is old, or unknown.
  [[nodiscard]] std::uint8_t valid() const { return valid_; }
  [[nodiscard]] std::uint32_t changes() const { return changes_; }
  [[nodiscard]] std::uint32_t failures() const { return failures_; }  ///< readings that missed an input

 private:
  std::uint8_t assigned_;
  std::uint8_t levels_ = 0;
  std::uint8_t valid_ = 0;
  std::uint8_t known_ = 0;     ///< read at least once
  std::uint8_t reported_ = 0;  ///< levels that the last event, or the first reading, reported
  std::optional<MonotonicTime> last_event_;
  std::uint32_t changes_ = 0;
  std::uint32_t failures_ = 0;
};

}  // namespace srfs
