// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/time.hpp"

namespace srfs {

/// Why a task ends without all its frames: a failure code of the mission dictionary and words for people.
struct CaptureFailure {
  std::uint16_t code = 0;
  std::string reason;
};

/// What a goal asks for.
struct CaptureRequest {
  std::uint32_t task = 0;
  std::optional<UtcTime> start;  ///< nothing: at once
  microseconds exposure{0};
  double gain_db = 0;
  std::uint16_t frames = 0;
  milliseconds interval{0};  ///< from begin to begin of two exposures; 0: as fast as the camera can
};

/// Ranges as in the mission dictionary (image.capture).
[[nodiscard]] std::optional<CaptureFailure> refuse(const CaptureRequest& request);

/// A task's time cannot be met any more. @param latest  so much later it may still begin
[[nodiscard]] std::optional<CaptureFailure> refuse_past(UtcTime start, UtcTime now, nanoseconds latest);

/// Which frame of a task is due when, and what becomes of unsound ones. Times are since the start of the
/// task. Never reads a clock.
class CaptureSequence {
 public:
  /// Tries of one frame before the task fails.
  static constexpr int tries_max = 3;

  CaptureSequence(std::uint16_t frames, nanoseconds interval) : frames_(frames), interval_(interval) {}

  [[nodiscard]] bool all_taken() const { return taken_ == frames_; }
  /// Number of the frame to take next, from 0.
  [[nodiscard]] std::uint16_t next() const { return taken_; }
  /// When its exposure is due; nothing: as soon as it can, without an interval, from the second on.
  [[nodiscard]] std::optional<nanoseconds> due() const;
  /// @param start_error_us  begin of the exposure minus when it was due
  void on_sound(std::int32_t start_error_us);
  /// @return whether it is tried again
  [[nodiscard]] bool on_unsound();
  [[nodiscard]] int tries() const { return tries_; }
  /// Largest of all frames by its magnitude; 0 before the first.
  [[nodiscard]] std::int32_t largest_start_error_us() const { return largest_error_us_; }

 private:
  std::uint16_t frames_;
  nanoseconds interval_;
  std::uint16_t taken_ = 0;
  int tries_ = 0;
  std::int32_t largest_error_us_ = 0;
};

/// Begin minus due, within the range of 32 bits.
[[nodiscard]] std::int32_t start_error_us(MonotonicTime begin, MonotonicTime due);

}  // namespace srfs
