// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/leaky_bucket.hpp"
#include "base/time.hpp"

namespace srfs {

/// Judges unsolicited frames of the peripheral. A late answer is a handful of frames, a babbling peripheral
/// never stops: a leaky bucket distinguishes them. Pure.
class BabbleMonitor {
 public:
  struct Settings {
    std::uint32_t tolerated_frames = 64;            ///< at once
    nanoseconds forgiven_every = milliseconds(50);  ///< one frame of them
    std::uint32_t power_cycles = 3;                 ///< that may fail to help in a row
    nanoseconds at_once = seconds(10);  ///< babbling so soon after power-on: the cycle did not help
  };
  enum class Verdict : std::uint8_t {
    tolerable,
    power_cycle,
    keep_off,  ///< power cycles do not help
  };

  void change_settings(const Settings& settings) { settings_ = settings; }
  [[nodiscard]] Verdict on_unsolicited_frame(MonotonicTime now);
  void on_switched_on(MonotonicTime now);
  /// An operator gives the peripheral another chance.
  void forgive();
  /// Power cycles in a row that did not help.
  [[nodiscard]] std::uint32_t in_a_row() const { return in_a_row_; }

 private:
  Settings settings_;
  LeakyBucket frames_;
  bool judged_ = false;  ///< a power cycle was asked for before
  std::optional<MonotonicTime> switched_on_;
  std::uint32_t in_a_row_ = 0;
};

}  // namespace srfs
