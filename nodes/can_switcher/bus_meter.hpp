// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/time.hpp"

namespace srfs {

/// Load of the CAN bus from the frames heard on it, window by window, and whether it is flooded. Memory does
/// not grow with the flood. Pure.
class BusMeter {
 public:
  static constexpr double flooded_from = 0.9;  ///< load of a window
  static constexpr double quiet_below = 0.7;

  struct Window {
    double load = 0;  ///< share of the bit time, 0-1; a lower bound when frames were missed
    std::uint32_t frames = 0;
    std::uint32_t most_frequent = 0;  ///< the identifier of more than half of the frames, if there is one
  };
  enum class Flood : std::uint8_t { no_change, began, ended };

  explicit BusMeter(MonotonicTime now) : window_start_(now) {}

  /// @param bits  on the wire, stuff bits included
  void on_frame(std::uint32_t id, bool extended, unsigned bits);
  /// Ends the window and begins the next.
  Flood end_window(MonotonicTime now, std::uint32_t bit_rate);

  [[nodiscard]] const Window& last() const { return last_; }
  [[nodiscard]] double peak() const { return peak_; }
  [[nodiscard]] bool flooded() const { return flooded_since_.has_value(); }
  /// Of the flood that ended last.
  [[nodiscard]] nanoseconds flood_lasted() const { return flood_lasted_; }

  struct Counters {
    std::uint64_t frames = 0;
    /// Neither to nor from the computer (docs/reference/icd_can.md, section 1).
    std::uint64_t foreign_frames = 0;
    std::uint32_t floods = 0;
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  MonotonicTime window_start_;
  std::uint64_t bits_ = 0;
  std::uint32_t frames_ = 0;
  std::uint32_t candidate_ = 0;  ///< majority vote of Boyer and Moore
  std::uint32_t votes_ = 0;
  Window last_{};
  double peak_ = 0;
  std::optional<MonotonicTime> flooded_since_;
  nanoseconds flood_lasted_{0};
  Counters counters_;
};

}  // namespace srfs
