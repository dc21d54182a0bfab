// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <optional>

#include "base/time.hpp"

namespace srfs {

/// When rejected inputs are reported: the first at once, those that follow together after `period`, so that a
/// flood is one event in a while. Pure.
class RejectionLog {
 public:
  static constexpr seconds period{10};

  /// @return whether to report now
  [[nodiscard]] bool add(MonotonicTime now) {
    if (count_ < std::numeric_limits<std::uint32_t>::max()) ++count_;
    held_back_ = reported_ && now - *reported_ < period;
    if (!held_back_) reported_ = now;
    return !held_back_;
  }
  /// When to report what add() held back; nullopt: nothing.
  [[nodiscard]] std::optional<MonotonicTime> due() const {
    return held_back_ ? std::optional(*reported_ + period) : std::nullopt;
  }
  /// @return whether to report now
  [[nodiscard]] bool on_time(MonotonicTime now) {
    if (!held_back_ || now < *reported_ + period) return false;
    held_back_ = false;
    reported_ = now;
    return true;
  }
  [[nodiscard]] std::uint32_t count() const { return count_; }

 private:
  std::uint32_t count_ = 0;
  bool held_back_ = false;
  std::optional<MonotonicTime> reported_;
};

}  // namespace srfs
